//! How each drive is held to the torque limit of its wheel: in every cycle, or once at start-up.

use super::drive_plan::DriveScale;
use super::drive_tables::TorqueLimitName;

/// Max torque, and the torque limits of either direction.
pub(crate) const TORQUE_LIMIT_OBJECTS: [u16; 3] = [0x6072, 0x60E0, 0x60E1];

/// The torque limit of a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueLimit {
    /// The most that the wheel may get, N·m: the least of `limits.wheel_torque_nm` and the motor's peak torque through
    /// its gear.
    pub wheel_nm: f64,
    /// The objects that hold it.
    pub objects: TorqueLimitName,
    /// When the drive is told.
    pub told: TorqueLimitTold,
}

/// When a drive is told its torque limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TorqueLimitTold {
    /// With its process data.
    EveryCycle,
    /// By SDO in PRE-OP, read back: it can't be changed while the robot runs.
    AtStartUp,
}

impl TorqueLimitName {
    /// Its objects, all of 16 bits.
    pub fn objects(self) -> &'static [u16] {
        match self {
            TorqueLimitName::MaxTorque => &TORQUE_LIMIT_OBJECTS[..1],
            TorqueLimitName::PositiveAndNegative => &TORQUE_LIMIT_OBJECTS[1..],
        }
    }
}

impl DriveScale {
    /// The torque limit in the drive's unit, 0.1 % of the rated torque: never above what it stands for, 0 for NaN.
    pub fn torque_limit_per_mille(&self, wheel_nm: f64) -> u16 {
        let per_mille = 1000.0 * wheel_nm / (self.rated_torque_nm * self.gear_ratio);
        // A whole number that lies a rounding below itself stays what it is.
        (per_mille * (1.0 + 1e-12)).floor() as u16
    }

    /// What the drive's unit of torque is at the wheel, N·m.
    pub fn wheel_nm_per_mille(&self) -> f64 {
        self.rated_torque_nm * self.gear_ratio / 1000.0
    }
}
