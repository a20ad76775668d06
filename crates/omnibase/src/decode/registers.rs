//! Names of ESC registers, and the values of those that people look for in words.

use omnibase_ethercat_wire::bytes::{u16_at, u32_at, u64_at};
use omnibase_ethercat_wire::{AlState, AlStatusCode, register};

/// A register or an area of them: first address, bytes, name.
const NAMES: &[(u16, u16, &str)] = &[
    (register::TYPE, 1, "type"),
    (register::REVISION, 1, "revision"),
    (register::BUILD, 2, "build"),
    (register::FMMU_COUNT, 1, "FMMU count"),
    (register::SM_COUNT, 1, "SM count"),
    (register::RAM_SIZE, 1, "RAM size"),
    (register::PORT_DESCRIPTOR, 1, "port descriptor"),
    (register::FEATURES, 2, "features"),
    (register::STATION_ADDRESS, 2, "station address"),
    (register::STATION_ALIAS, 2, "station alias"),
    (0x0020, 1, "write register enable"),
    (0x0021, 1, "write register protection"),
    (0x0030, 1, "ESC write enable"),
    (0x0031, 1, "ESC write protection"),
    (0x0040, 1, "ESC reset"),
    (0x0041, 1, "ESC reset PDI"),
    (register::DL_CONTROL, 4, "DL control"),
    (0x0108, 2, "physical read/write offset"),
    (register::DL_STATUS, 2, "DL status"),
    (register::AL_CONTROL, 2, "AL control"),
    (register::AL_STATUS, 2, "AL status"),
    (register::AL_STATUS_CODE, 2, "AL status code"),
    (0x0138, 1, "run LED override"),
    (0x0139, 1, "error LED override"),
    (register::PDI_CONTROL, 1, "PDI control"),
    (register::ESC_CONFIGURATION, 1, "ESC configuration"),
    (0x0150, 4, "PDI configuration"),
    (register::ECAT_EVENT_MASK, 2, "ECAT event mask"),
    (register::AL_EVENT_MASK, 4, "AL event mask"),
    (register::ECAT_EVENT, 2, "ECAT event request"),
    (register::AL_EVENT, 4, "AL event request"),
    (register::RX_ERROR_COUNTERS, 8, "rx error counters"),
    (register::FORWARDED_ERROR_COUNTERS, 4, "forwarded rx error counters"),
    (register::PROCESSING_ERROR_COUNTER, 1, "processing unit error counter"),
    (register::PDI_ERROR_COUNTER, 1, "PDI error counter"),
    (register::LOST_LINK_COUNTERS, 4, "lost link counters"),
    (register::WATCHDOG_DIVIDER, 2, "watchdog divider"),
    (register::WATCHDOG_PDI, 2, "watchdog time PDI"),
    (register::WATCHDOG_PROCESS_DATA, 2, "watchdog time process data"),
    (register::WATCHDOG_STATUS, 2, "watchdog status process data"),
    (register::WATCHDOG_COUNTER, 1, "watchdog counter process data"),
    (0x0443, 1, "watchdog counter PDI"),
    (register::SII_CONFIG, 1, "SII configuration"),
    (register::SII_PDI_ACCESS, 1, "SII PDI access"),
    (register::SII_CONTROL, 2, "SII control/status"),
    (register::SII_ADDRESS, 4, "SII address"),
    (register::SII_DATA, 8, "SII data"),
    (0x0510, 8, "MII management"),
    (register::DC_RECEIVE_TIMES, 16, "DC receive times"),
    (register::DC_SYSTEM_TIME, 8, "DC system time"),
    (register::DC_RECEIVE_TIME_UNIT, 8, "DC receive time processing unit"),
    (register::DC_SYSTEM_TIME_OFFSET, 8, "DC system time offset"),
    (register::DC_SYSTEM_TIME_DELAY, 4, "DC system time delay"),
    (register::DC_SYSTEM_TIME_DIFFERENCE, 4, "DC system time difference"),
    (register::DC_SPEED_COUNTER_START, 2, "DC speed counter start"),
    (register::DC_SPEED_COUNTER_DIFFERENCE, 2, "DC speed counter difference"),
    (register::DC_FILTER_DEPTHS, 2, "DC filter depths"),
    (register::DC_CYCLIC_CONTROL, 1, "DC cyclic unit control"),
    (register::DC_ACTIVATION, 1, "DC activation"),
    (register::DC_PULSE_LENGTH, 2, "SYNC pulse length"),
    (register::DC_ACTIVATION_STATUS, 1, "DC activation status"),
    (register::DC_SYNC0_STATUS, 1, "SYNC0 status"),
    (register::DC_SYNC1_STATUS, 1, "SYNC1 status"),
    (register::DC_START_TIME, 8, "DC start time"),
    (register::DC_NEXT_SYNC1, 8, "next SYNC1"),
    (register::DC_SYNC0_CYCLE, 4, "SYNC0 cycle time"),
    (register::DC_SYNC1_CYCLE, 4, "SYNC1 cycle time"),
    (0x09A8, 2, "latch control"),
    (0x09AE, 2, "latch status"),
    (0x09B0, 32, "latch times"),
    (0x0E00, 0x100, "product and vendor ID, power-on values"),
    (0x0F00, 0x80, "digital IO"),
    (0x0F80, 0x80, "user RAM"),
];

/// The name of the register at `address`, with the number of an FMMU or SyncManager; `None` for memory and
/// addresses without a name.
pub fn name(address: u16) -> Option<String> {
    if (register::FMMU..register::FMMU + 64 * register::FMMU_SIZE).contains(&address) && address < 0x0700 {
        let (number, offset) = split(address, register::FMMU, register::FMMU_SIZE);
        return Some(part(format!("FMMU{number}"), offset));
    }
    if (register::SM..register::SM + 0x80).contains(&address) {
        let (number, offset) = split(address, register::SM, register::SM_SIZE);
        let field = match offset {
            0 => return Some(format!("SM{number}")),
            2 | 3 => "length",
            4 => "control",
            5 => "status",
            6 => "activate",
            7 => "PDI control",
            _ => "start address",
        };
        return Some(format!("SM{number} {field}"));
    }
    let (start, _, name) =
        NAMES.iter().find(|(start, length, _)| (*start..start + length).contains(&address))?;
    Some(part((*name).to_owned(), address - start))
}

fn split(address: u16, area: u16, size: u16) -> (u16, u16) {
    ((address - area) / size, (address - area) % size)
}

fn part(name: String, offset: u16) -> String {
    if offset == 0 { name } else { format!("{name} +{offset}") }
}

/// What the registers in `data`, read from or written to `address`, say in words; `of_several` where they are those of several
/// SubDevices, ORed.
pub fn values(address: u16, data: &[u8], of_several: bool) -> Vec<String> {
    let mut words = Vec::new();
    let field = |at: u16, length: usize| {
        let start = usize::from(at.checked_sub(address)?);
        data.get(start..start + length)
    };
    if let Some(bytes) = field(register::TYPE, 12) {
        words.push(format!(
            "ESC type 0x{:02x}, {} FMMUs, {} SyncManagers, {} KiB; {}",
            bytes[0],
            bytes[4],
            bytes[5],
            bytes[6],
            features(u16_at(bytes, 8))
        ));
    } else if let Some(bytes) = field(register::FEATURES, 2) {
        words.push(features(u16_at(bytes, 0)));
    }
    if let Some(bytes) = field(register::STATION_ADDRESS, 2) {
        words.push(format!("station 0x{:04x}", u16_at(bytes, 0)));
    }
    if let Some(bytes) = field(register::DL_STATUS, 2) {
        words.push(dl_status(u16_at(bytes, 0)));
    }
    if let Some(bytes) = field(register::AL_CONTROL, 1) {
        words.push(format!("ask for {}", al_state(bytes[0], "acknowledge", false)));
    }
    if let Some(bytes) = field(register::AL_STATUS, 1) {
        words.push(format!("in {}", al_state(bytes[0], "ERROR", of_several)));
    }
    if let Some(bytes) = field(register::AL_STATUS_CODE, 2) {
        let code = AlStatusCode(u16_at(bytes, 0));
        if code != AlStatusCode::NO_ERROR {
            let cause = code.probable_cause();
            let cause = if cause.is_empty() { String::new() } else { format!(" ({cause})") };
            words.push(format!("AL status code {code}{cause}"));
        }
    }
    if let Some(bytes) = field(register::SII_CONTROL, 2) {
        words.push(sii_control(u16_at(bytes, 0)));
    }
    if let Some(bytes) = field(register::SII_ADDRESS, 2) {
        words.push(format!("word 0x{:04x}", u16_at(bytes, 0)));
    }
    words.extend(fmmus(address, data));
    words.extend(sync_managers(address, data));
    if let Some(bytes) = field(register::DC_SYSTEM_TIME, 8) {
        words.push(format!("system time {} ns", u64_at(bytes, 0)));
    } else if let Some(bytes) = field(register::DC_SYSTEM_TIME, 4) {
        words.push(format!("system time (low half) {} ns", u32_at(bytes, 0)));
    }
    if let Some(bytes) = field(register::DC_SYSTEM_TIME_OFFSET, 8) {
        words.push(format!("offset {} ns", u64_at(bytes, 0) as i64));
    }
    if let Some(bytes) = field(register::DC_SYSTEM_TIME_DELAY, 4) {
        words.push(format!("delay {} ns", u32_at(bytes, 0)));
    }
    if let Some(bytes) = field(register::DC_SYSTEM_TIME_DIFFERENCE, 4) {
        words.push(format!("difference {} ns", system_time_difference(u32_at(bytes, 0))));
    }
    if let Some(bytes) = field(register::DC_ACTIVATION, 1) {
        words.push(activation(bytes[0]));
    }
    if let Some(bytes) = field(register::DC_START_TIME, 8) {
        words.push(format!("start {} ns", u64_at(bytes, 0)));
    }
    if let Some(bytes) = field(register::DC_SYNC0_CYCLE, 4) {
        words.push(format!("SYNC0 every {} ns", u32_at(bytes, 0)));
    }
    if let Some(bytes) = field(register::DC_SYNC1_CYCLE, 4) {
        words.push(format!("SYNC1 {} ns", u32_at(bytes, 0)));
    }
    words
}

/// Register 0x092C: bit 31 is the sign, the rest the amount.
pub fn system_time_difference(value: u32) -> i64 {
    let amount = i64::from(value & 0x7FFF_FFFF);
    if value & 0x8000_0000 != 0 { -amount } else { amount }
}

/// A state byte: broadcasts OR the states of several SubDevices together, and INIT with PRE-OP looks as BOOT does.
fn al_state(bits: u8, flag: &str, of_several: bool) -> String {
    let state = match AlState::from_bits(u16::from(bits)) {
        Some(AlState::Bootstrap) if of_several => "several states (INIT | PRE-OP, or BOOT)".to_owned(),
        Some(state) => state.name().to_owned(),
        None if bits & 0x0F == 0 => "no state".to_owned(),
        None => {
            let states = [AlState::Init, AlState::PreOp, AlState::SafeOp, AlState::Op];
            let there: Vec<_> = states
                .iter()
                .filter(|state| u16::from(bits) & state.bits() != 0)
                .map(|state| state.name())
                .collect();
            format!("several states ({})", there.join(" | "))
        }
    };
    if u16::from(bits) & AlState::ERROR != 0 { format!("{state} + {flag}") } else { state }
}

fn features(bits: u16) -> String {
    let named = [
        (register::FEATURE_DC, "DC"),
        (register::FEATURE_DC_64, "64 bit"),
        (register::FEATURE_FMMU_BYTEWISE, "FMMUs byte-wise only"),
        (register::FEATURE_NO_LRW, "no LRW"),
        (register::FEATURE_NO_READ_WRITE, "no BRW/APRW/FPRW"),
        (register::FEATURE_FIXED_MAPPING, "fixed mapping"),
    ];
    let there: Vec<_> = named.iter().filter(|(bit, _)| bits & bit != 0).map(|(_, text)| *text).collect();
    format!("features: {}", if there.is_empty() { "none".to_owned() } else { there.join(", ") })
}

fn dl_status(bits: u16) -> String {
    let ports: Vec<_> = (0..4)
        .filter(|port| bits & 1 << (4 + port) != 0)
        .map(|port| {
            let open = bits & 1 << (8 + 2 * port) == 0;
            format!("{port}{}", if open { "" } else { " (loop closed)" })
        })
        .collect();
    format!("link at port {}", if ports.is_empty() { "none".to_owned() } else { ports.join(", ") })
}

fn sii_control(bits: u16) -> String {
    let command = match bits >> 8 & 7 {
        0 => "idle",
        1 => "read",
        2 => "write",
        4 => "reload",
        _ => "unknown command",
    };
    let mut text = command.to_owned();
    let flags = [
        (1 << 15, "busy"),
        (1 << 14, "error: write enable"),
        (1 << 13, "error: no acknowledge"),
        (1 << 12, "error: not loaded"),
        (1 << 11, "error: checksum"),
    ];
    for (bit, name) in flags {
        if bits & bit != 0 {
            text.push_str(", ");
            text.push_str(name);
        }
    }
    text
}

fn activation(bits: u8) -> String {
    match bits & 7 {
        0 => "SYNC off".to_owned(),
        bits => {
            let outputs: Vec<_> = [(2, "SYNC0"), (4, "SYNC1")]
                .iter()
                .filter(|(bit, _)| bits & bit != 0)
                .map(|(_, n)| *n)
                .collect();
            format!(
                "{} on",
                if outputs.is_empty() { "cyclic unit".to_owned() } else { outputs.join(" and ") }
            )
        }
    }
}

/// Every whole FMMU in the data that isn't all zero.
fn fmmus(address: u16, data: &[u8]) -> Vec<String> {
    entries(address, data, Area { start: register::FMMU, end: 0x0700, size: register::FMMU_SIZE })
        .filter(|(_, bytes)| bytes.iter().any(|byte| *byte != 0))
        .map(|(number, bytes)| {
            let way = match bytes[11] & 3 {
                1 => "inputs",
                2 => "outputs",
                3 => "inputs and outputs",
                _ => "no direction",
            };
            format!(
                "FMMU{number}: logical 0x{:08x}.{} to +{}.{} -> 0x{:04x}.{}, {way}, {}",
                u32_at(bytes, 0),
                bytes[6] & 7,
                u16_at(bytes, 4),
                bytes[7] & 7,
                u16_at(bytes, 8),
                bytes[10] & 7,
                if bytes[12] & 1 != 0 { "on" } else { "off" }
            )
        })
        .collect()
}

/// Every whole SyncManager in the data that isn't all zero.
fn sync_managers(address: u16, data: &[u8]) -> Vec<String> {
    entries(address, data, Area { start: register::SM, end: 0x0880, size: register::SM_SIZE })
        .filter(|(_, bytes)| bytes.iter().any(|byte| *byte != 0))
        .map(|(number, bytes)| {
            let mode = match bytes[4] & 3 {
                0 => "three buffers",
                2 => "mailbox",
                _ => "unknown mode",
            };
            let way = if bytes[4] >> 2 & 3 == 1 { "from the MainDevice" } else { "to the MainDevice" };
            format!(
                "SM{number}: 0x{:04x} {} bytes, {mode} {way}, {}",
                u16_at(bytes, 0),
                u16_at(bytes, 2),
                if bytes[6] & 1 != 0 { "on" } else { "off" }
            )
        })
        .collect()
}

/// Registers that repeat: from `start` to `end`, each `size` bytes.
#[derive(Clone, Copy)]
struct Area {
    start: u16,
    end: u16,
    size: u16,
}

/// The whole entries of `area` in the data.
fn entries(address: u16, data: &[u8], area: Area) -> impl Iterator<Item = (u16, &[u8])> {
    (0..(area.end - area.start) / area.size).filter_map(move |number| {
        let at = usize::from((area.start + number * area.size).checked_sub(address)?);
        Some((number, data.get(at..at + usize::from(area.size))?))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_have_names() {
        let names =
            [(0x0130, "AL status"), (0x0131, "AL status +1"), (0x0810, "SM2"), (0x080D, "SM1 status")];
        for (address, expected) in names {
            assert_eq!(name(address).as_deref(), Some(expected), "0x{address:04x}");
        }
        assert_eq!(name(0x0620).as_deref(), Some("FMMU2"));
        assert_eq!((name(0x1000), name(0x0060)), (None, None));
    }

    #[test]
    fn no_two_names_overlap() {
        for pair in NAMES.windows(2) {
            assert!(pair[0].0 + pair[0].1 <= pair[1].0, "{} and {}", pair[0].2, pair[1].2);
        }
    }

    #[test]
    fn states_and_codes_come_in_words() {
        assert_eq!(values(0x0120, &[0x11, 0], false), ["ask for INIT + acknowledge"]);
        assert_eq!(
            values(0x0130, &[0x14, 0, 0, 0, 0x1B, 0], false),
            [
                "in SAFE-OP + ERROR",
                "AL status code 0x001b SyncManager watchdog (process data stopped for longer than the watchdog time)"
            ]
        );
        assert_eq!(values(0x0130, &[0x06, 0], true), ["in several states (PRE-OP | SAFE-OP)"]);
        assert_eq!(values(0x0130, &[0x13, 0], true), ["in several states (INIT | PRE-OP, or BOOT) + ERROR"]);
        assert_eq!(values(0x0130, &[0x13, 0], false), ["in BOOT + ERROR"]);
    }

    #[test]
    fn fmmus_and_sync_managers_come_in_words() {
        let fmmu = [0, 0, 1, 0, 24, 0, 0, 7, 0, 0x11, 0, 2, 1, 0, 0, 0];
        assert_eq!(
            values(0x0600, &fmmu, false),
            ["FMMU0: logical 0x00010000.0 to +24.7 -> 0x1100.0, outputs, on"]
        );
        let sms = [0, 0x10, 0x80, 0, 0x26, 0, 1, 0, 0x80, 0x10, 0x80, 0, 0x22, 0, 1, 0];
        assert_eq!(
            values(0x0800, &sms, false),
            [
                "SM0: 0x1000 128 bytes, mailbox from the MainDevice, on",
                "SM1: 0x1080 128 bytes, mailbox to the MainDevice, on"
            ]
        );
    }

    #[test]
    fn the_sign_of_the_time_difference_is_bit_31() {
        assert_eq!(system_time_difference(5), 5);
        assert_eq!(system_time_difference(0x8000_0005), -5);
    }

    #[test]
    fn short_data_say_nothing_and_do_not_panic() {
        for address in 0..0x1100 {
            for length in 0..40 {
                let _ = (name(address), values(address, &vec![0xFF; length], false));
            }
        }
        let _ = values(0xFFFF, &[0xFF; 64], true);
    }
}
