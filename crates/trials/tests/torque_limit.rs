//! The torque limit reaches the motors under every law: what they truly gave, through frames and drives.

use omnibase_robot::Registry;
use omnibase_robot::signals::SafetyReason;
use omnibase_trials::framed::{Tracked, bring_up, track_and_look};
use omnibase_trials::robots;

/// What a motor's torque may lie above its limit by, N·m: rounding of the simulation's own sums.
const ROUNDING_NM: f64 = 1e-9;

/// A square of 1 m in eight seconds, that asks for more than 1 and 2 N·m of any wheel.
const SQUARE: &str = "\n[reference]\nkind = \"path\"\npoints = [[0, 0, 0, 0], [2, 1, 0, 0], [4, 1, 1, 0], [6, 0, 1, 0], [8, 0, 0, 0]]\n";

fn greatest_nm(tracked: &Tracked) -> f64 {
    tracked.machine.lock().greatest_torques_n_m().iter().copied().fold(0.0, f64::max)
}

fn limited(robot: &str, law: &str, limit_nm: f64) -> String {
    let line = robot.lines().find(|line| line.starts_with("wheel_torque_nm")).expect("a robot's file has it");
    robots::loaded(&robot.replace(line, &format!("wheel_torque_nm = {limit_nm:?}")), law, 1.0, SQUARE)
}

#[test]
fn no_motor_gives_more_than_the_limit_under_any_law() {
    println!("| robot | law | limit N·m | greatest N·m | what became of it | believed max mm |");
    for (name, robot) in [("bmm", robots::BMM), ("mecanum", robots::MECANUM)] {
        for law in Registry::with_built_in().controllers.names() {
            for limit_nm in [1.0, 2.0, 21.0] {
                let tracked = track_and_look(&limited(robot, law, limit_nm));
                let greatest_nm = greatest_nm(&tracked);
                let ran = &tracked.ran;
                let end = match &ran.ended {
                    Ok(()) => "followed".to_owned(),
                    Err(error) => error.to_string(),
                };
                let far_mm = 1e3 * ran.summary.max_error_m.believed.unwrap_or(f64::NAN);
                println!("| {name} | {law} | {limit_nm} | {greatest_nm:.6} | {end} | {far_mm:.1} |");
                assert!(greatest_nm <= limit_nm + ROUNDING_NM, "{name} {law} {limit_nm}: {greatest_nm}");
                // With too little the robot stops where it is; it doesn't run away.
                let follows = limit_nm == 21.0;
                let reason = if follows { SafetyReason::Requested } else { SafetyReason::TrackingError };
                assert_eq!(
                    (ran.last.stop_reason, ran.finished),
                    (reason, follows),
                    "{name} {law} {limit_nm}"
                );
                let truth = tracked.machine.truth();
                let speed_m_s = truth.twist_in_body.vx_m_s.hypot(truth.twist_in_body.vy_m_s);
                assert!(speed_m_s < 0.01, "{name} {law} {limit_nm}: {speed_m_s} m/s at the end");
                let beyond_m = truth.pose.x_m.abs().max(truth.pose.y_m.abs());
                // The path's metre, the tracking error's half, and the way to brake with so little torque.
                assert!(beyond_m < 2.0, "{name} {law} {limit_nm}: {beyond_m} m");
                if follows {
                    assert!(greatest_nm > 5.0, "{name} {law}: nothing was asked of the motors");
                }
            }
        }
    }
}

#[test]
fn a_limit_that_is_not_mapped_reaches_the_motors_at_start_up() {
    let robot = robots::MECANUM.replace(" 6072:16", "");
    let tracked = track_and_look(&limited(&robot, "closed_loop_speed", 2.0));
    let greatest_nm = greatest_nm(&tracked);
    assert!(greatest_nm <= 2.0 + ROUNDING_NM && greatest_nm > 1.9, "{greatest_nm}");
    assert_eq!(tracked.ran.last.stop_reason, SafetyReason::TrackingError);
}

#[test]
fn a_drive_that_takes_no_limit_is_refused_before_anything_moves() {
    // The simulated drive has no 0x60E0.
    let chosen = "device = \"cia402\"\ntorque_limit = \"positive_and_negative\"";
    let robot = robots::MECANUM.replace("device = \"cia402\"", chosen);
    let error = bring_up(&limited(&robot, "closed_loop_speed", 2.0)).err().expect("refused").to_string();
    for part in ["SubDevice 0", "60e0:00", "does not exist", "limits.wheel_torque_nm = 2 N·m", "front_left"]
    {
        assert!(error.contains(part), "{part} in: {error}");
    }
}
