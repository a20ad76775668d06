//! What a recording says about its run: for its report, and for replay.

use std::collections::BTreeMap;

use crate::robot_text::LoadedRobot;
use crate::simulated;

/// The key of a reference that was loaded while the robot ran: its table as TOML.
pub fn reference_key(number: u32) -> String {
    format!("reference/{number}")
}

/// Everything about a run that doesn't change with its cycles.
pub fn description(robot: &LoadedRobot) -> BTreeMap<String, String> {
    let plan = &robot.plan;
    let mut all = robot.description.clone();
    let mut tell = |key: &str, value: String| all.insert(key.to_owned(), value);
    tell("robot", plan.name.clone());
    tell("reference", plan.reference.kind.clone().unwrap_or_default());
    tell("mode", plan.controller.kind.clone().unwrap_or_default());
    tell("version", env!("CARGO_PKG_VERSION").to_owned());
    let wheels = plan.kinematics.wheels();
    let wheel = |wheel: &omnibase_platform::Wheel| {
        let [x_m, y_m] = wheel.position_m;
        let [u, v] = wheel.rolling_direction;
        format!("{x_m} {y_m} {} {}", v.atan2(u), wheel.radius_m)
    };
    tell("wheels_m", wheels.iter().map(wheel).collect::<Vec<_>>().join("; "));
    tell("wheel_names", plan.drives.iter().map(|drive| drive.name.as_str()).collect::<Vec<_>>().join(" "));
    tell("limit.wheel_speed_rad_s", plan.limits.wheel_speed_rad_s.to_string());
    tell("limit.wheel_torque_nm", plan.limits.wheel_torque_nm.to_string());
    if let Some(drive) = plan.drives.first() {
        let at_wheel = |torque_nm: f64| (torque_nm * drive.scale.gear_ratio).to_string();
        tell("wheel_rated_torque_nm", at_wheel(drive.scale.rated_torque_nm));
        tell("wheel_peak_torque_nm", at_wheel(drive.scale.peak_torque_nm));
    }
    let machine = simulated::description(plan).machine;
    tell("simulation.mass_kg", (machine.body.mass_kg + machine.payload.mass_kg).to_string());
    let inertia = machine.body.yaw_inertia_kg_m2 + machine.payload.yaw_inertia_kg_m2;
    tell("simulation.inertia_kg_m2", inertia.to_string());
    all
}
