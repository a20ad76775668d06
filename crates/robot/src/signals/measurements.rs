//! What the drives said.

use omnibase_cia402::{ErrorCode, StatusWord};

use super::{MAX_WHEELS, coded};

/// What one drive said, in the wheel's units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveMeasurement {
    /// Encoder, raw: 32 bits that wrap.
    pub position_counts: i32,
    /// Angle by which the wheel turned since the last good exchange, rad; 0 at the first one.
    pub increment_rad: f64,
    /// Speed of the wheel, rad/s.
    pub speed_rad_s: f64,
    /// Torque at the wheel, N·m.
    pub torque_nm: f64,
    /// Status word.
    pub status: StatusWord,
    /// Mode that the drive shows (0x6061); 0 where it isn't mapped.
    pub mode_code: i8,
    /// Error that the drive shows (0x603F); none where it isn't mapped.
    pub error: ErrorCode,
    /// How far the drive is on its way, as of the last outputs.
    pub progress: DriveProgress,
}

/// Slower than this a wheel stands, rad/s.
const STANDING_RAD_S: f64 = 0.02;

impl DriveMeasurement {
    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.increment_rad.is_finite() && self.speed_rad_s.is_finite() && self.torque_nm.is_finite()
    }

    /// Whether a limit of the drive's own holds it back, while it runs.
    pub fn is_held_back(&self) -> bool {
        self.progress == DriveProgress::Running && self.status.contains(StatusWord::INTERNAL_LIMIT)
    }

    /// Whether the wheel stands: it turns slower than 0.02 rad/s.
    pub fn stands(&self) -> bool {
        self.speed_rad_s.abs() < STANDING_RAD_S
    }
}

/// How far a drive is on its way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriveProgress {
    /// Nothing was heard of it yet.
    #[default]
    Unknown,
    /// Under way to a state.
    UnderWay,
    /// In operation, on its way to another mode: it goes on as it was.
    SwitchingMode,
    /// In operation: it follows its commands.
    Running,
    /// Where it is wanted, without torque.
    Idle,
    /// In a quick stop.
    QuickStop,
    /// In a fault.
    Fault,
    /// It left operation by itself, or a step took too long.
    Failed,
}

coded!(DriveProgress {
    Unknown = 0,
    UnderWay = 1,
    Running = 2,
    Idle = 3,
    QuickStop = 4,
    Fault = 5,
    Failed = 6,
    SwitchingMode = 7,
});

/// What all drives said in one cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measurements {
    /// Wheels that the robot has.
    pub wheels: usize,
    /// One per wheel; those beyond `wheels` keep their default.
    pub drives: [DriveMeasurement; MAX_WHEELS],
}

impl Measurements {
    /// The drives that the robot has.
    pub fn present(&self) -> &[DriveMeasurement] {
        &self.drives[..self.wheels.min(MAX_WHEELS)]
    }

    /// Whether a limit of its own holds back one of them.
    pub fn is_held_back(&self) -> bool {
        self.present().iter().any(DriveMeasurement::is_held_back)
    }
}
