//! Why a drive was stopped, in words.

use crate::error_code::ErrorCode;
use crate::mode::{Mode, SupportedModes};
use crate::state::{DriveState, StatusWord, Wanted};

/// Why a drive was stopped.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum EnablingError {
    /// The drive reports a fault.
    #[error("the drive is in fault: {}", FaultWords(.0))]
    Fault(Option<ErrorCode>),
    /// The fault remained after its reset.
    #[error("the fault stayed after its reset: {}", FaultWords(.0))]
    FaultPersists(Option<ErrorCode>),
    /// A quick stop was asked for.
    #[error("quick stop was asked for")]
    QuickStop,
    /// The drive stopped quickly by itself.
    #[error("the drive started a quick stop by itself")]
    QuickStopByDrive,
    /// The drive left operation, though nobody asked.
    #[error("the drive left Operation enabled by itself, to {found}{}", Hint(.status))]
    LeftOperation {
        /// The state it went to.
        found: DriveState,
        /// Its status word.
        status: StatusWord,
    },
    /// A change of state took too long.
    #[error("from {from} to {to}: no step within {} ms, status word {:#06x}{}", .waited_ns / 1_000_000, .status.0, Causes(*.to, .status))]
    StateTimeout {
        /// The state in which the drive stayed.
        from: DriveState,
        /// The wanted state.
        to: Wanted,
        /// Its status word.
        status: StatusWord,
        /// How long it was given.
        waited_ns: u64,
    },
    /// A change of mode took too long.
    #[error("mode {to} (code {}) was asked for, 0x6061 still shows {found} after {} ms", .to.code(), .waited_ns / 1_000_000)]
    ModeTimeout {
        /// The mode asked for.
        to: Mode,
        /// The code in 0x6061.
        found: i8,
        /// How long it was given.
        waited_ns: u64,
    },
    /// 0x6502 lacks the mode.
    #[error("mode {wanted} is not among the drive's supported modes (0x6502 = {:#010x})", .supported.0)]
    UnsupportedMode {
        /// The mode asked for.
        wanted: Mode,
        /// What the drive supports.
        supported: SupportedModes,
    },
}

struct FaultWords<'a>(&'a Option<ErrorCode>);

impl core::fmt::Display for FaultWords<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self.0 {
            Some(code) => write!(f, "error {code}"),
            None => f.write_str("its error code (0x603F) is not mapped"),
        }
    }
}

/// Why drives usually aren't enabled, as far as the status word tells; with voltage it doesn't tell an open STO (CiA 402 has no bit for it).
struct Causes<'a>(Wanted, &'a StatusWord);

impl core::fmt::Display for Causes<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Causes(to, status) = self;
        write!(f, "{}", Hint(status))?;
        if *to != Wanted::OperationEnabled || !status.contains(StatusWord::REMOTE) {
            return Ok(());
        }
        f.write_str(
            ". Usual causes: the emergency stop is still pressed or not reset (STO is open), main power is missing, \
             or the drive's enable input is off",
        )
    }
}

/// What the status word says about the usual causes.
struct Hint<'a>(&'a StatusWord);

impl core::fmt::Display for Hint<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        if !self.0.contains(StatusWord::VOLTAGE_ENABLED) {
            f.write_str("; bit 4 (voltage enabled) is clear: no main power, or torque is safely off (STO, emergency stop)")
        } else if !self.0.contains(StatusWord::REMOTE) {
            f.write_str("; bit 9 is clear: the drive does not obey the control word")
        } else {
            Ok(())
        }
    }
}
