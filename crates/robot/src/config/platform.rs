//! The wheels, and the path points that a file holds.

use omnibase_platform::{Kinematics, Wheel, layout};

use super::check::Check;
use super::file::{LayoutName, PlatformTable};
use super::problem::ProblemKind;

pub(super) fn resolve(check: &mut Check, table: &PlatformTable, drives: usize) -> Option<Kinematics> {
    let name = check.need(table.layout, "platform.layout", "wheels stand somewhere")?;
    let radius_m = check.need(table.wheel_radius_m, "platform.wheel_radius_m", "speeds are scaled by it");
    let mut length =
        |value: Option<f64>, key: &str| check.need(value, &format!("platform.{key}"), "this layout has it");
    let wheels = match name {
        LayoutName::Bmm => {
            let (p1_m, p_m) = (length(table.p1_m, "p1_m"), length(table.p_m, "p_m"));
            layout::bmm(p1_m?, p_m?, radius_m?)
        }
        LayoutName::Omni3 | LayoutName::Omni4 => {
            let distance_m = length(table.centre_distance_m, "centre_distance_m");
            let count = if name == LayoutName::Omni3 { 3 } else { 4 };
            layout::omni(count, distance_m?, radius_m?, table.first_wheel_angle_rad.unwrap_or(0.0))
        }
        LayoutName::Mecanum => {
            let along = length(table.half_length_m, "half_length_m");
            let across = length(table.half_width_m, "half_width_m");
            layout::mecanum4(along?, across?, radius_m?)
        }
        LayoutName::Wheels => wheels(check, table, radius_m)?,
    };
    if wheels.len() != drives {
        let problem =
            check.report(ProblemKind::Contradiction, "platform.layout", "each wheel has one `[[drive]]`");
        problem.value = Some(format!("{} wheels", wheels.len()));
        problem.limit = Some(format!("{drives} drives"));
    }
    for reason in layout::problems(&wheels) {
        check.report(ProblemKind::Contradiction, "platform", reason);
    }
    Kinematics::new(wheels).ok()
}

fn wheels(check: &mut Check, table: &PlatformTable, radius_m: Option<f64>) -> Option<Vec<Wheel>> {
    let mut wheels = Some(Vec::new());
    for (index, wheel) in table.wheel.iter().enumerate() {
        let setting = |key: &str| format!("platform.wheel[{index}].{key}");
        let position = check.need(wheel.position_m, &setting("position_m"), "a wheel stands somewhere");
        let rolling =
            check.need(wheel.rolling_angle_rad, &setting("rolling_angle_rad"), "a wheel rolls somewhere");
        match (position, rolling, radius_m, &mut wheels) {
            (Some(position_m), Some(rolling), Some(radius_m), Some(wheels)) => {
                let force = wheel.force_angle_rad.unwrap_or(rolling);
                wheels.push(Wheel {
                    name: format!("wheel_{}", index + 1),
                    position_m,
                    rolling_direction: [rolling.cos(), rolling.sin()],
                    force_direction: [force.cos(), force.sin()],
                    radius_m,
                });
            }
            _ => wheels = None,
        }
    }
    wheels
}
