//! How each drive is held to the torque limit of its wheel: in every cycle, or once at start-up.

use omnibase_ethercat::start_up::ReadBack;

use super::check::Check;
use super::drive_tables::TorqueLimitName;
use super::drives::is_mapped;
use super::mapping::{PdoPlan, find};
use super::plan::{DrivePlan, DriveScale, Limits, ParameterPlan};
use super::problem::ProblemKind;

/// Max torque, and the torque limits of either direction.
const OBJECTS: [u16; 3] = [0x6072, 0x60E0, 0x60E1];

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
            TorqueLimitName::MaxTorque => &OBJECTS[..1],
            TorqueLimitName::PositiveAndNegative => &OBJECTS[1..],
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

/// Whether the objects of the limit lie in the process data; every problem with where they lie is told.
pub(super) fn told(
    check: &mut Check,
    (setting, outputs): (&str, &[PdoPlan]),
    objects: TorqueLimitName,
) -> TorqueLimitTold {
    let is_there = |object: &u16| find(outputs, *object, 0).is_some();
    for object in OBJECTS.iter().filter(|object| is_there(object) && !is_mapped(outputs, **object, 16)) {
        let problem = check.report(
            ProblemKind::OutOfRange,
            setting,
            "a torque limit that isn't whole and at a byte would stay 0",
        );
        problem.limit = Some(format!("{object:04X}:16"));
    }
    let chosen = objects.objects();
    let mapped = chosen.iter().filter(|object| is_there(object)).count();
    if mapped == chosen.len() {
        return TorqueLimitTold::EveryCycle;
    }
    if mapped > 0 {
        let names: Vec<String> = chosen.iter().map(|object| format!("{object:04X}:16")).collect();
        let reason = "both torque limits must be mapped, or none of them";
        check.report(ProblemKind::Missing, setting, reason).limit = Some(names.join(" "));
    }
    TorqueLimitTold::AtStartUp
}

/// What a file's parameters say about the limit's objects would be overwritten, or overwrite it.
pub(super) fn no_parameter_contradicts(
    check: &mut Check,
    (setting, parameters): (&str, &[ParameterPlan]),
    objects: TorqueLimitName,
) {
    for parameter in parameters.iter().filter(|parameter| objects.objects().contains(&parameter.index)) {
        let reason = "the torque limit is written from limits.wheel_torque_nm";
        let problem = check.report(ProblemKind::Contradiction, setting, reason);
        problem.value = Some(format!("{:04X} ({})", parameter.index, parameter.origin));
    }
}

/// Gives each drive the limit of its wheel; one that isn't told in every cycle gets it as a parameter, behind all others.
pub(super) fn resolve(check: &mut Check, drives: &mut [DrivePlan], limits: &Limits) {
    for drive in drives {
        let scale = drive.scale;
        let wheel_nm = limits.wheel_torque_nm.min(scale.peak_torque_nm * scale.gear_ratio);
        drive.torque_limit.wheel_nm = wheel_nm;
        let per_mille = scale.torque_limit_per_mille(wheel_nm);
        if per_mille == 0 {
            let reason =
                format!("{} can't be told so little: its unit is 0.1 % of the rated torque", drive.name);
            let problem = check.report(ProblemKind::OutOfRange, "limits.wheel_torque_nm", reason);
            problem.value = Some(limits.wheel_torque_nm.to_string());
            problem.limit = Some(format!("at least {}", scale.wheel_nm_per_mille()));
            return;
        }
        if drive.torque_limit.told == TorqueLimitTold::AtStartUp {
            let origin = format!(
                "limits.wheel_torque_nm = {} N·m, to which nothing else would hold {}",
                limits.wheel_torque_nm, drive.name
            );
            let parameter = |object: &u16| ParameterPlan {
                index: *object,
                subindex: 0,
                data: per_mille.to_le_bytes().to_vec(),
                read_back: ReadBack::Compare,
                origin: origin.clone(),
            };
            drive.parameters.extend(drive.torque_limit.objects.objects().iter().map(parameter));
        }
    }
}
