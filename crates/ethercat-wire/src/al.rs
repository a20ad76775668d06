//! Application layer states and status codes (ETG.1000.6, ETG.1020).

use core::fmt;

/// A SubDevice's application layer state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum AlState {
    /// No mailbox, no process data.
    Init = 1,
    /// Mailbox.
    PreOp = 2,
    /// Firmware update over FoE.
    Bootstrap = 3,
    /// Mailbox and inputs; outputs stay safe.
    SafeOp = 4,
    /// Mailbox, inputs and outputs.
    Op = 8,
}

impl AlState {
    /// AL control and status bit: acknowledge in control, error in status.
    pub const ERROR: u16 = 0x10;
    /// AL control and status bit: the SubDevice identifies itself by the status code register.
    pub const IDENTIFICATION: u16 = 0x20;

    /// The state in the low nibble of AL control or status; `None` for a value that is no state.
    pub fn from_bits(bits: u16) -> Option<Self> {
        match bits & 0x0F {
            1 => Some(AlState::Init),
            2 => Some(AlState::PreOp),
            3 => Some(AlState::Bootstrap),
            4 => Some(AlState::SafeOp),
            8 => Some(AlState::Op),
            _ => None,
        }
    }

    /// The state's bits in AL control and status.
    pub fn bits(self) -> u16 {
        u16::from(self as u8)
    }

    /// The standard's name.
    pub fn name(self) -> &'static str {
        match self {
            AlState::Init => "INIT",
            AlState::PreOp => "PRE-OP",
            AlState::Bootstrap => "BOOT",
            AlState::SafeOp => "SAFE-OP",
            AlState::Op => "OP",
        }
    }
}

impl fmt::Display for AlState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// An AL status code (register 0x0134); [`AlStatusCode::text`] says what it means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AlStatusCode(pub u16);

macro_rules! status_codes {
    ($($code:literal $name:ident $text:literal, $cause:literal;)*) => {
        impl AlStatusCode {
            $(#[doc = $text] pub const $name: AlStatusCode = AlStatusCode($code);)*

            /// Every code that the standard names.
            pub const ALL: &'static [AlStatusCode] = &[$(AlStatusCode($code)),*];

            /// What the code means, in the standard's words; `None` for a code that it doesn't name.
            pub fn text(self) -> Option<&'static str> {
                match self.0 { $($code => Some($text),)* _ => None }
            }

            /// The usual cause, in a few words; empty where the text says it all.
            pub fn probable_cause(self) -> &'static str {
                match self.0 { $($code => $cause,)* _ => "" }
            }
        }
    };
}

status_codes! {
    0x0000 NO_ERROR "no error", "";
    0x0001 UNSPECIFIED "unspecified error", "see the drive's own diagnosis";
    0x0002 NO_MEMORY "no memory", "the mapping may be too large for the device";
    0x0003 INVALID_DEVICE_SETUP "invalid device setup", "modules don't match the configuration";
    0x0004 INVALID_REVISION "invalid revision", "";
    0x0006 SII_MISMATCH "SII/EEPROM information does not match firmware", "the SII image belongs to another firmware";
    0x0007 FIRMWARE_UPDATE_FAILED "firmware update not successful", "";
    0x000E LICENSE "license error", "";
    0x0011 INVALID_STATE_CHANGE "invalid requested state change", "a state was skipped";
    0x0012 UNKNOWN_STATE "unknown requested state", "";
    0x0013 BOOTSTRAP_NOT_SUPPORTED "bootstrap not supported", "";
    0x0014 NO_VALID_FIRMWARE "no valid firmware", "its firmware was written in part only, or never: write it again (`omnibase foe write`)";
    0x0015 INVALID_MAILBOX_BOOTSTRAP "invalid mailbox configuration (bootstrap)", "SM0/SM1 don't match the SII";
    0x0016 INVALID_MAILBOX "invalid mailbox configuration", "SM0/SM1 don't match the SII";
    0x0017 INVALID_SYNC_MANAGER "invalid SyncManager configuration", "address, length or control of an SM is wrong";
    0x0018 NO_VALID_INPUTS "no valid inputs available", "";
    0x0019 NO_VALID_OUTPUTS "no valid outputs", "no process data arrived before OP was asked";
    0x001A SYNCHRONIZATION_ERROR "synchronization error", "too many cycles without data at SYNC0";
    0x001B SM_WATCHDOG "SyncManager watchdog", "process data stopped for longer than the watchdog time";
    0x001C INVALID_SM_TYPES "invalid SyncManager types", "";
    0x001D INVALID_OUTPUT_CONFIGURATION "invalid output configuration", "SM2 length differs from the mapped outputs";
    0x001E INVALID_INPUT_CONFIGURATION "invalid input configuration", "SM3 length differs from the mapped inputs";
    0x001F INVALID_WATCHDOG_CONFIGURATION "invalid watchdog configuration", "";
    0x0020 NEEDS_COLD_START "SubDevice needs cold start", "";
    0x0021 NEEDS_INIT "SubDevice needs INIT", "";
    0x0022 NEEDS_PREOP "SubDevice needs PRE-OP", "";
    0x0023 NEEDS_SAFEOP "SubDevice needs SAFE-OP", "";
    0x0024 INVALID_INPUT_MAPPING "invalid input mapping", "an object in 0x1C13 or 0x1Axx can't be mapped";
    0x0025 INVALID_OUTPUT_MAPPING "invalid output mapping", "an object in 0x1C12 or 0x16xx can't be mapped";
    0x0026 INCONSISTENT_SETTINGS "inconsistent settings", "";
    0x0027 FREERUN_NOT_SUPPORTED "free run not supported", "the device wants SYNC0 or SM events";
    0x0028 SYNCHRONIZATION_NOT_SUPPORTED "synchronization not supported", "";
    0x0029 FREERUN_NEEDS_THREE_BUFFER "free run needs three-buffer mode", "";
    0x002A BACKGROUND_WATCHDOG "background watchdog", "";
    0x002B NO_INPUTS_AND_OUTPUTS "no valid inputs and outputs", "";
    0x002C FATAL_SYNC_ERROR "fatal sync error", "SYNC0 did not arrive";
    0x002D NO_SYNC_ERROR "no sync error", "no SYNC0 was seen before OP";
    0x002E CYCLE_TIME_TOO_SMALL "cycle time too small", "";
    0x0030 INVALID_DC_SYNC_CONFIGURATION "invalid DC SYNC configuration", "SYNC0 cycle not supported, or SYNC0 off where it is needed";
    0x0031 INVALID_DC_LATCH_CONFIGURATION "invalid DC latch configuration", "";
    0x0032 PLL_ERROR "PLL error", "the device did not lock to SYNC0";
    0x0033 DC_SYNC_IO_ERROR "DC sync IO error", "";
    0x0034 DC_SYNC_TIMEOUT "DC sync timeout", "";
    0x0035 INVALID_DC_CYCLE_TIME "DC invalid sync cycle time", "the cycle isn't one the device supports";
    0x0036 DC_SYNC0_CYCLE_TIME "DC SYNC0 cycle time", "the cycle isn't one the device supports";
    0x0037 DC_SYNC1_CYCLE_TIME "DC SYNC1 cycle time", "";
    0x0041 MBX_AOE "AoE mailbox error", "";
    0x0042 MBX_EOE "EoE mailbox error", "";
    0x0043 MBX_COE "CoE mailbox error", "";
    0x0044 MBX_FOE "FoE mailbox error", "";
    0x0045 MBX_SOE "SoE mailbox error", "";
    0x004F MBX_VOE "VoE mailbox error", "";
    0x0050 EEPROM_NO_ACCESS "EEPROM no access", "";
    0x0051 EEPROM_ERROR "EEPROM error", "";
    0x0060 RESTARTED_LOCALLY "SubDevice restarted locally", "it lost power or was reset";
    0x0061 IDENTIFICATION_UPDATED "device identification value updated", "";
    0x0070 MODULE_LIST_MISMATCH "detected module list does not match", "a slot is empty, or holds another module than the list (0xF030) says";
    0x0080 SUPPLY_VOLTAGE_LOW "supply voltage too low", "";
    0x0081 SUPPLY_VOLTAGE_HIGH "supply voltage too high", "";
    0x0082 TEMPERATURE_LOW "temperature too low", "";
    0x0083 TEMPERATURE_HIGH "temperature too high", "";
    0x00F0 APPLICATION_CONTROLLER_AVAILABLE "application controller available", "";
}

impl fmt::Display for AlStatusCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.text() {
            Some(text) => write!(f, "0x{:04x} {text}", self.0),
            None if self.0 >= 0x8000 => write!(f, "0x{:04x} vendor specific", self.0),
            None => write!(f, "0x{:04x} not named by the standard", self.0),
        }
    }
}
