//! The shipped robots, loaded, and what they are asked to follow.

use omnibase_run::simulated;

/// Three omni wheels on direct drives.
pub const BMM: &str = include_str!("../../../robots/bmm.toml");
/// Four mecanum wheels on geared servos.
pub const MECANUM: &str = include_str!("../../../robots/mecanum.toml");
/// A circle of half a metre in ten seconds.
pub const CIRCLE: &str = "\n[reference]\nkind = \"circle\"\nradius_m = 0.5\nduration_s = 10.0\n";
/// Two of them as fast as the limits allow: no longer than that.
pub const FAST_CIRCLE: &str =
    "\n[reference]\nkind = \"circle\"\nradius_m = 0.5\nturns = 2\ntiming = \"fastest\"\n";
/// The thesis's square of two metres in twenty seconds.
pub const SQUARE: &str = "\n[reference]\nkind = \"path\"\npoints = [[0, 0, 0, 0], [5, 2, 0, 0], [10, 2, 2, 0], \
                          [15, 0, 2, 0], [20, 0, 0, 0]]\n";
/// Payload of the trials, kg.
pub const PAYLOAD_KG: f64 = 100.0;
/// Its moment of inertia, kg·m²: a crate of 0.6 m by 0.4 m, m·(a² + b²)/12.
pub const PAYLOAD_INERTIA_KG_M2: f64 = 4.3;

/// What a robot's file says of treads that are known to be stiff: the law of torque is designed for these alone.
pub const STIFF_TREADS: &str = "tread_stiffness_n_m = [1e6, 4e6]\ntread_damping_ratio = 0.3\n";

/// The same robot, its treads known to be stiff.
pub fn on_stiff_treads(robot: &str) -> String {
    robot.replace("[controller]\n", &format!("[controller]\n{STIFF_TREADS}"))
}

/// A robot with a payload of 100 kg, a control law, and first estimates that are wrong by a factor.
pub fn loaded(robot: &str, law: &str, factor: f64, reference: &str) -> String {
    with_payload(robot, law, factor, PAYLOAD_KG) + reference
}

/// The same with another payload and without a reference; it ends within the table `simulation`.
pub fn with_payload(robot: &str, law: &str, factor: f64, payload_kg: f64) -> String {
    let body = simulated::description(&crate::plan_of(robot)).machine.body;
    let payload_inertia_kg_m2 = PAYLOAD_INERTIA_KG_M2 * payload_kg / PAYLOAD_KG;
    let mass_kg = factor * (body.mass_kg + payload_kg);
    let inertia_kg_m2 = factor * (body.yaw_inertia_kg_m2 + payload_inertia_kg_m2);
    let begin = robot.find("[controller]").unwrap_or(robot.len());
    let end = robot.find("[simulation]").unwrap_or(robot.len());
    format!(
        "{}[controller]\nkind = \"{law}\"\nmass_kg = {mass_kg:?}\ninertia_kg_m2 = {inertia_kg_m2:?}\n\n{}\
         payload_kg = {payload_kg:?}\npayload_inertia_kg_m2 = {payload_inertia_kg_m2:?}\n",
        &robot[..begin],
        &robot[end..],
    )
}

/// Figures of eight over so many seconds, `turn_s` each; 0 asks for as fast as the robot's limits allow.
pub fn eight(robot: &str, turn_s: f64, seconds: f64) -> String {
    let table = |turns: f64, duration: &str| {
        format!(
            "\n[reference]\nkind = \"eight\"\nhalf_length_m = 0.8\nheading = \"follows_tangent\"\nturns = {turns:?}\n{duration}\n"
        )
    };
    if turn_s > 0.0 {
        let turns = (seconds / turn_s).ceil();
        return table(turns, &format!("duration_s = {:?}", turns * turn_s));
    }
    // The time of many turns alone says how long one takes.
    let probe = crate::Trial::new(crate::plan_of(&format!("{robot}{}", table(100.0, ""))));
    let hundred_s = probe.robot.reference_duration_s().unwrap_or(seconds);
    table((100.0 * seconds / hundred_s).ceil(), "")
}
