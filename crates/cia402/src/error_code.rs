//! Error codes of object 0x603F in words (CiA 402-2, "Error codes"; the same numbers as IEC 61800-7-201).

use core::fmt;

/// An error code as object 0x603F and emergency messages carry it.
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct ErrorCode(pub u16);

impl ErrorCode {
    /// No error.
    pub const NONE: ErrorCode = ErrorCode(0);

    /// What the code means; a code that the profile doesn't list is told by its group.
    pub fn text(self) -> &'static str {
        match TEXTS.binary_search_by_key(&self.0, |(code, _)| *code) {
            Ok(found) => TEXTS[found].1,
            Err(_) => self.group(),
        }
    }

    /// The group of errors that the code belongs to.
    pub const fn group(self) -> &'static str {
        match self.0 {
            0x0000..=0x00FF => "no error",
            0x1000..=0x10FF => "generic error",
            0x2000..=0x20FF => "current",
            0x2100..=0x21FF => "current at the device's input",
            0x2200..=0x22FF => "current inside the device",
            0x2300..=0x23FF => "current at the device's output",
            0x3000..=0x30FF => "voltage",
            0x3100..=0x31FF => "mains voltage",
            0x3200..=0x32FF => "DC link voltage",
            0x3300..=0x33FF => "output voltage",
            0x4000..=0x40FF => "temperature",
            0x4100..=0x41FF => "ambient temperature",
            0x4200..=0x42FF => "device temperature",
            0x4300..=0x43FF => "drive temperature",
            0x4400..=0x44FF => "supply temperature",
            0x5000..=0x5FFF => "device hardware",
            0x6000..=0x60FF => "device software",
            0x6100..=0x61FF => "internal software",
            0x6200..=0x62FF => "user software",
            0x6300..=0x63FF => "data set",
            0x7000..=0x7FFF => "additional modules",
            0x8000..=0x80FF => "monitoring",
            0x8100..=0x81FF => "communication",
            0x8200..=0x82FF => "protocol error",
            0x8300..=0x83FF => "torque control",
            0x8400..=0x84FF => "velocity control",
            0x8500..=0x85FF => "position control",
            0x8600..=0x86FF => "positioning control",
            0x8700..=0x87FF => "synchronisation control",
            0x8800..=0x88FF => "winding control",
            0x8900..=0x89FF => "process data monitoring",
            0x8A00..=0x8AFF => "control monitoring",
            0x9000..=0x90FF => "external error",
            0xF000..=0xF0FF => "additional functions",
            0xFF00..=0xFFFF => "the manufacturer's own error",
            _ => "a code outside the profile: see the drive's manual",
        }
    }
}

impl ErrorCode {
    /// Whether it is about the bus: communication, protocol, or the synchronisation by it.
    pub const fn is_communication(self) -> bool {
        matches!(self.0, 0x7500..=0x75FF | 0x8100..=0x82FF | 0x8700..=0x87FF)
    }
}

impl fmt::Debug for ErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ErrorCode({:#06x})", self.0)
    }
}

impl fmt::Display for ErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:04X} ({})", self.0, self.text())
    }
}

/// By rising code, for the search.
const TEXTS: &[(u16, &str)] = &[
    (0x0000, "no error"),
    (0x1000, "generic error"),
    (0x2110, "short circuit or earth leakage at the input"),
    (0x2120, "earth leakage at the input"),
    (0x2121, "earth leakage, phase L1"),
    (0x2122, "earth leakage, phase L2"),
    (0x2123, "earth leakage, phase L3"),
    (0x2130, "short circuit at the input"),
    (0x2131, "short circuit, phases L1-L2"),
    (0x2132, "short circuit, phases L2-L3"),
    (0x2133, "short circuit, phases L3-L1"),
    (0x2211, "internal current no. 1"),
    (0x2212, "internal current no. 2"),
    (0x2213, "over-current in ramp function"),
    (0x2214, "over-current in the sequence"),
    (0x2220, "continuous over-current inside the device"),
    (0x2221, "continuous over-current inside the device no. 1"),
    (0x2222, "continuous over-current inside the device no. 2"),
    (0x2230, "short circuit or earth leakage inside the device"),
    (0x2240, "earth leakage inside the device"),
    (0x2250, "short circuit inside the device"),
    (0x2310, "continuous over-current at the motor"),
    (0x2311, "continuous over-current at the motor no. 1"),
    (0x2312, "continuous over-current at the motor no. 2"),
    (0x2320, "short circuit or earth leakage at the motor"),
    (0x2330, "earth leakage at the motor"),
    (0x2331, "earth leakage, phase U"),
    (0x2332, "earth leakage, phase V"),
    (0x2333, "earth leakage, phase W"),
    (0x2340, "short circuit at the motor"),
    (0x2341, "short circuit, phases U-V"),
    (0x2342, "short circuit, phases V-W"),
    (0x2343, "short circuit, phases W-U"),
    (0x2350, "load level fault (I2t, thermal state)"),
    (0x2351, "load level warning (I2t, thermal state)"),
    (0x3110, "mains over-voltage"),
    (0x3111, "mains over-voltage, phase L1"),
    (0x3112, "mains over-voltage, phase L2"),
    (0x3113, "mains over-voltage, phase L3"),
    (0x3120, "mains under-voltage"),
    (0x3121, "mains under-voltage, phase L1"),
    (0x3122, "mains under-voltage, phase L2"),
    (0x3123, "mains under-voltage, phase L3"),
    (0x3130, "phase failure"),
    (0x3131, "phase failure L1"),
    (0x3132, "phase failure L2"),
    (0x3133, "phase failure L3"),
    (0x3134, "phase sequence"),
    (0x3140, "mains frequency"),
    (0x3141, "mains frequency too high"),
    (0x3142, "mains frequency too low"),
    (0x3210, "DC link over-voltage"),
    (0x3211, "DC link over-voltage no. 1"),
    (0x3212, "DC link over-voltage no. 2"),
    (0x3220, "DC link under-voltage"),
    (0x3221, "DC link under-voltage no. 1"),
    (0x3222, "DC link under-voltage no. 2"),
    (0x3230, "load error"),
    (0x3310, "output over-voltage"),
    (0x3311, "output over-voltage, phase U"),
    (0x3312, "output over-voltage, phase V"),
    (0x3313, "output over-voltage, phase W"),
    (0x3320, "armature circuit"),
    (0x3321, "armature circuit interrupted"),
    (0x3330, "field circuit"),
    (0x3331, "field circuit interrupted"),
    (0x4110, "ambient temperature too high"),
    (0x4120, "ambient temperature too low"),
    (0x4130, "temperature of the supply air"),
    (0x4140, "temperature at the air outlet"),
    (0x4210, "device temperature too high"),
    (0x4220, "device temperature too low"),
    (0x4310, "drive temperature too high"),
    (0x4320, "drive temperature too low"),
    (0x4410, "supply temperature too high"),
    (0x4420, "supply temperature too low"),
    (0x5100, "supply"),
    (0x5110, "low-voltage supply"),
    (0x5111, "±15 V supply"),
    (0x5112, "+24 V supply"),
    (0x5113, "+5 V supply"),
    (0x5120, "supply of the intermediate circuit"),
    (0x5200, "control hardware"),
    (0x5210, "measurement circuit"),
    (0x5220, "computing circuit"),
    (0x5300, "operating unit"),
    (0x5400, "power section"),
    (0x5410, "output stages"),
    (0x5420, "chopper"),
    (0x5430, "input stages"),
    (0x5440, "contacts"),
    (0x5450, "fuses"),
    (0x5500, "data memory"),
    (0x5510, "working memory (RAM)"),
    (0x5520, "program memory (ROM)"),
    (0x5530, "non-volatile memory (EEPROM)"),
    (0x6010, "software reset (watchdog)"),
    (0x6310, "loss of parameters"),
    (0x6320, "parameter error"),
    (0x7100, "power module"),
    (0x7110, "brake chopper"),
    (0x7111, "brake chopper failure"),
    (0x7112, "brake chopper over-current"),
    (0x7113, "protective circuit of the brake chopper"),
    (0x7120, "motor"),
    (0x7121, "motor blocked"),
    (0x7122, "motor error or commutation malfunction"),
    (0x7123, "motor tilted"),
    (0x7200, "measurement circuit module"),
    (0x7300, "sensor"),
    (0x7301, "tachometer fault"),
    (0x7302, "tachometer polarity wrong"),
    (0x7303, "resolver 1 fault"),
    (0x7304, "resolver 2 fault"),
    (0x7305, "incremental encoder 1 fault"),
    (0x7306, "incremental encoder 2 fault"),
    (0x7307, "incremental encoder 3 fault"),
    (0x7310, "speed sensor"),
    (0x7320, "position sensor"),
    (0x7400, "computation circuit module"),
    (0x7500, "communication module"),
    (0x7510, "serial interface no. 1"),
    (0x7520, "serial interface no. 2"),
    (0x7600, "data storage module"),
    (0x8311, "excess torque"),
    (0x8312, "difficult start up"),
    (0x8313, "standstill torque"),
    (0x8321, "insufficient torque"),
    (0x8331, "torque fault"),
    (0x8400, "velocity controller"),
    (0x8500, "position controller"),
    (0x8600, "positioning controller"),
    (0x8611, "following error"),
    (0x8612, "reference limit"),
    (0x8700, "synchronisation controller"),
    (0xF001, "deceleration"),
    (0xF002, "sub-synchronous run"),
    (0xF003, "stroke operation"),
    (0xF004, "control"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_rises_and_unlisted_codes_have_a_group() {
        assert!(TEXTS.windows(2).all(|pair| pair[0].0 < pair[1].0));
        assert_eq!(ErrorCode(0x8611).text(), "following error");
        assert_eq!(ErrorCode(0x8612).to_string(), "0x8612 (reference limit)");
        assert_eq!(ErrorCode(0x2301).text(), "current at the device's output");
        assert_eq!(ErrorCode(0xFF12).text(), "the manufacturer's own error");
        for code in 0..=u16::MAX {
            assert!(!ErrorCode(code).text().is_empty());
        }
    }
}
