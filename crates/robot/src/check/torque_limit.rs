//! How each drive is held to the torque limit of its wheel, checked against its process data.

use super::Check;
use crate::config::*;
use crate::config::{TORQUE_LIMIT_OBJECTS, find_object as find, is_mapped};

/// Whether the objects of the limit lie in the process data; every problem with where they lie is told.
pub(super) fn told(
    check: &mut Check,
    setting: &str,
    outputs: &[PdoPlan],
    objects: TorqueLimitName,
) -> TorqueLimitTold {
    let is_there = |object: &u16| find(outputs, *object, 0).is_some();
    for object in
        TORQUE_LIMIT_OBJECTS.iter().filter(|object| is_there(object) && !is_mapped(outputs, **object, 16))
    {
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
    setting: &str,
    parameters: &[ParameterPlan],
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
            let parameter = |object: &u16| {
                ParameterPlan::entry((*object, 0), per_mille.to_le_bytes().to_vec(), origin.clone())
            };
            drive.parameters.extend(drive.torque_limit.objects.objects().iter().map(parameter));
        }
    }
}
