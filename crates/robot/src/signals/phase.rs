//! Where a robot is in its life.

use super::coded;

/// Where a robot is in its life.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Phase {
    /// No torque; waits for [`RequestKind::Enable`](super::RequestKind::Enable).
    #[default]
    Disabled,
    /// The drives are on their way to operation.
    Enabling,
    /// In operation, at rest in its place.
    Holding,
    /// Follows its reference.
    Tracking,
    /// Ramps down.
    Stopping,
    /// The drives brake by their own quick stop.
    QuickStopping,
    /// Stopped by a fault; waits for [`RequestKind::Acknowledge`](super::RequestKind::Acknowledge).
    Fault,
}

impl Phase {
    /// Its name, as programs are told it.
    pub fn name(self) -> &'static str {
        match self {
            Phase::Disabled => "disabled",
            Phase::Enabling => "enabling",
            Phase::Holding => "holding",
            Phase::Tracking => "tracking",
            Phase::Stopping => "stopping",
            Phase::QuickStopping => "quick stopping",
            Phase::Fault => "fault",
        }
    }
}

coded!(Phase {
    Disabled = 0,
    Enabling = 1,
    Holding = 2,
    Tracking = 3,
    Stopping = 4,
    QuickStopping = 5,
    Fault = 6,
});
