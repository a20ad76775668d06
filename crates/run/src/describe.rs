//! What a recording says about its run: for its report, and for replay.

use std::collections::BTreeMap;

use omnibase_robot::Registry;
use omnibase_robot::config::{ReferenceTable, SensorPlan};
use omnibase_robot::guard::Obstacle;

use crate::robot_text::LoadedRobot;
use crate::room::Room;
use crate::simulated;

/// Rectangles of a map that are told at most.
const MOST_RECTANGLES: usize = 2000;

/// Everything about a run that doesn't change with its cycles.
pub fn description(robot: &LoadedRobot, registry: &Registry) -> BTreeMap<String, String> {
    let plan = &robot.plan;
    let mut all = robot.description.clone();
    let mut tell = |key: &str, value: String| all.insert(key.to_owned(), value);
    tell("robot", plan.name.clone());
    tell("reference", reference_words(&plan.reference, registry));
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
    if let Some(fence) = &plan.guard.fence {
        tell("fence_m", corners(&fence.corners_m));
    }
    if !plan.guard.obstacles.is_empty() {
        let circle = |Obstacle { centre_m: [x, y], radius_m, .. }: &Obstacle| format!("{x} {y} {radius_m}");
        tell("obstacles_m", plan.guard.obstacles.iter().map(circle).collect::<Vec<_>>().join("; "));
    }
    if !plan.sensors.is_empty() {
        let gate = |sensor: &SensorPlan| format!("{} {}", sensor.name, sensor.gate());
        tell("sensor_gates", plan.sensors.iter().map(gate).collect::<Vec<_>>().join("; "));
    }
    all
}

/// What stands in a room, for the picture of a report: its map's cells as rectangles, larger ones than they are where there are many.
pub fn of_room(room: &Room) -> Option<(String, String)> {
    let cells = room.map().map(|map| map.rectangles(MOST_RECTANGLES)).unwrap_or_default();
    let walls: Vec<String> = room
        .blocked_m()
        .iter()
        .map(Vec::as_slice)
        .chain(cells.iter().map(<[_; 4]>::as_slice))
        .map(corners)
        .collect();
    (!walls.is_empty()).then(|| ("walls_m".to_owned(), walls.join(" | ")))
}

fn corners(corners_m: &[[f64; 2]]) -> String {
    // A millimetre is less than a line is wide.
    corners_m.iter().map(|[x, y]| format!("{x:.3} {y:.3}")).collect::<Vec<_>>().join("; ")
}

/// A reference in a few words, such as `circle, radius 0.5 m, duration 10 s`: its kind, and its keys that are numbers or
/// words.
fn reference_words(table: &ReferenceTable, registry: &Registry) -> String {
    let mut words = table.kind.clone().unwrap_or_default();
    let Ok(toml::Value::Table(mut keys)) = toml::Value::try_from(table) else { return words };
    let Ok((kind, _)) = registry.references.find(table.kind.as_deref()) else { return words };
    for (key, content) in kind.files() {
        let Some(toml::Value::String(file)) = keys.remove(key.name) else { continue };
        // What it stands for was read from it.
        keys.remove(content.instead_of);
        let is_needed = kind.keys.iter().any(|key| key.is_needed && key.name == content.instead_of);
        let key = if is_needed { String::new() } else { format!(", {}", key.name.replace('_', " ")) };
        // Of a file its name says enough.
        words.push_str(&format!("{key} {}", file.rsplit('/').next().unwrap_or(&file)));
    }
    for (key, value) in keys.iter().filter(|(key, _)| *key != "kind") {
        let word = match value {
            toml::Value::String(text) => text.replace('_', " "),
            toml::Value::Float(number) => number.to_string(),
            _ => continue,
        };
        let unit = [("_m", " m"), ("_s", " s")].into_iter().find(|(end, _)| key.ends_with(end));
        let (end, unit) = unit.unwrap_or_default();
        let name = key.trim_end_matches(end).replace('_', " ");
        words.push_str(&format!(", {name} {word}{unit}"));
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reference_has_few_words() {
        let registry = Registry::with_built_in();
        let circle =
            ReferenceTable { kind: Some("circle".into()), radius_m: Some(0.5), ..Default::default() };
        assert_eq!(reference_words(&circle, &registry), "circle, radius 0.5 m");
        let path = ReferenceTable {
            points_file: Some("/robots/square.dat".into()),
            ..ReferenceTable::path(vec![[0.0; 4]])
        };
        assert_eq!(reference_words(&path, &registry), "path square.dat");
        let drawing = ReferenceTable {
            kind: Some("drawing".into()),
            drawing_file: Some("way.svg".into()),
            drawing: Some("M 0 0 L 1 0".into()),
            correction_file: Some("/taught/way.dat".into()),
            unit_m: Some(0.02),
            ..Default::default()
        };
        let expected = "drawing way.svg, correction file way.dat, unit 0.02 m";
        assert_eq!(reference_words(&drawing, &registry), expected);
    }
}
