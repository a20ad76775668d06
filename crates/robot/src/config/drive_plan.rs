//! A drive, resolved, and what it can be commanded by.

use omnibase_ethercat::config::Timeouts;

use super::bus_plan::{BusPlace, Identity, ParameterPlan};
use super::custom::Parameters;
use super::drive_mode::DriveMode;
use super::drive_tables::{EncoderName, SpeedUnit, TurnDirection};
use super::mapping::{PdoPlan, is_mapped};
use super::start_plan::DcPlan;
use super::torque_limit::TorqueLimit;
use crate::signals::Quantity;

/// One drive.
#[derive(Clone, Debug)]
pub struct DrivePlan {
    /// The wheel's name.
    pub name: String,
    /// Where it is on the bus.
    pub place: BusPlace,
    /// Device by name.
    pub device: String,
    /// Who must be there.
    pub identity: Identity,
    /// PDOs from the cycle to the drive.
    pub outputs: Vec<PdoPlan>,
    /// PDOs from the drive to the cycle.
    pub inputs: Vec<PdoPlan>,
    /// Between the drive's units and the wheel's.
    pub scale: DriveScale,
    /// What it is commanded by; `None`: what the control law commands.
    pub mode: Option<DriveMode>,
    /// The loop by which the cycle makes torques out of speeds.
    pub speed_loop: Option<SpeedLoopPlan>,
    /// How it is held to the torque limit of its wheel.
    pub torque_limit: TorqueLimit,
    /// What its encoder knows after a loss of supply.
    pub encoder: EncoderName,
    /// Events of its clock; `None` where it has none.
    pub dc: Option<DcPlan>,
    /// The longest waits for it.
    pub timeouts: Timeouts,
    /// SDOs: those of each state in the order in which they are sent.
    pub parameters: Vec<ParameterPlan>,
    /// The device's own keys.
    pub custom: Parameters,
}

/// Between a drive's units and the wheel's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveScale {
    /// Encoder counts per revolution of the motor.
    pub counts_per_revolution: u32,
    /// Revolutions of the motor per revolution of the wheel.
    pub gear_ratio: f64,
    /// Which way the wheel turns when the counts rise.
    pub direction: TurnDirection,
    /// Unit of the speed objects.
    pub speed_unit: SpeedUnit,
    /// The motor's rated torque, N·m.
    pub rated_torque_nm: f64,
    /// The motor's peak torque, N·m.
    pub peak_torque_nm: f64,
}

/// A loop in the cycle that makes a wheel's torque out of its speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedLoopPlan {
    /// Torque per speed error, N·m·s/rad.
    pub gain_nm_s_rad: f64,
    /// Time in which the integral gives as much again, s.
    pub integral_s: f64,
}

/// Why a drive can't be commanded in a mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Misfit {
    /// The law commands torques, and no speed follows from a torque.
    NoSpeedOfATorque,
    /// The law commands speeds, and nothing makes torques of them.
    NoSpeedLoop,
    /// The object that is told isn't in the drive's process data, whole and at a byte.
    NotMapped {
        /// Its index.
        object: u16,
        /// Its length.
        bits: u8,
    },
}

impl DrivePlan {
    /// Why the drive can't follow a law that commands so, in a mode; `None` is the mode in which it takes what the law
    /// commands. Nothing where it can.
    pub fn misfits(&self, mode: Option<DriveMode>, commanded: Quantity) -> Vec<Misfit> {
        let (object, bits) = match (commanded, mode) {
            (Quantity::Nothing, _) => return Vec::new(),
            (Quantity::Torque, Some(DriveMode::Speed)) => return vec![Misfit::NoSpeedOfATorque],
            (Quantity::Speed, None | Some(DriveMode::Speed)) => (0x60FF, 32),
            (_, Some(DriveMode::Torque)) | (Quantity::Torque, None) => (0x6071, 16),
        };
        let needs_loop = (commanded, mode) == (Quantity::Speed, Some(DriveMode::Torque));
        let no_loop = (needs_loop && self.speed_loop.is_none()).then_some(Misfit::NoSpeedLoop);
        let not_mapped =
            (!is_mapped(&self.outputs, object, bits)).then_some(Misfit::NotMapped { object, bits });
        no_loop.into_iter().chain(not_mapped).collect()
    }
}
