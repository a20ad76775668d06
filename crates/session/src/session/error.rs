//! Why a robot's bus isn't in OP.

use std::fmt;

use omnibase_ethercat::SetUpError;
use omnibase_ethercat::image::PlanError;
use omnibase_ethercat::paced::ReachError;
use omnibase_ethercat::wire::LinkError;

/// Why a robot's bus couldn't be brought to OP, or kept.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// Set-up failed: nobody there, somebody else there, a parameter refused.
    #[error(transparent)]
    SetUp(#[from] SetUpError),
    /// The process data don't fit.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// A drive refused a state.
    #[error(transparent)]
    Reach(ReachError),
    /// The port is broken.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// A drive's watchdog isn't what was written: it would stop late, or never.
    #[error(
        "drive `{drive}` (SubDevice {position}): its watchdog is {found} (registers 0x0400, 0x0420), expected {expected}"
    )]
    Watchdog {
        /// The drive.
        drive: String,
        /// Its position.
        position: u16,
        /// As the robot's file wants it.
        expected: WatchdogRegisters,
        /// As it was read back.
        found: WatchdogRegisters,
    },
    /// A drive's process data have another length than the plan says.
    #[error("drive `{drive}` has {found} bytes of {direction}, its file says {expected}")]
    Length {
        /// The drive.
        drive: String,
        /// Which of its data.
        direction: &'static str,
        /// Bytes by the plan.
        expected: usize,
        /// Bytes on the bus.
        found: usize,
    },
}

impl From<ReachError> for SessionError {
    fn from(error: ReachError) -> Self {
        match error {
            ReachError::Link(error) => SessionError::Link(error),
            ReachError::Transition { .. } => SessionError::Reach(error),
        }
    }
}

/// The registers of a drive's process-data watchdog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WatchdogRegisters {
    /// Register 0x0400: units of 40 ns, less 2.
    pub divider: u16,
    /// Register 0x0420: multiples of the divided clock; 0 is off.
    pub process_data: u16,
}

impl fmt::Display for WatchdogRegisters {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match u64::from(self.process_data) * 40 * (u64::from(self.divider) + 2) {
            0 => f.write_str("off"),
            ns => write!(f, "{} us", ns as f64 * 1e-3),
        }
    }
}
