//! Robots with sensors: where they truly are, and what becomes of them when a sensor fails.

use omnibase_robot::signals::SafetyReason;
use omnibase_robot::{CycleRecord, Phase, RequestKind};
use omnibase_trials::sensed::{Case, drive};
use omnibase_trials::{Trial, plan_of, robots};

#[test]
fn with_the_wheels_alone_it_is_their_odometry_to_the_bit() {
    let life = |kind: &str| -> Vec<CycleRecord> {
        let text = format!("{}{}\n[estimator]\nkind = \"{kind}\"\n", robots::BMM, robots::CIRCLE);
        let mut trial = Trial::new(plan_of(&text));
        trial.enable();
        trial.step(Some(RequestKind::Track));
        (0..5000).map(|_| *trial.step(None)).collect()
    };
    let (fused, wheels) = (life("fused"), life("wheel_odometry"));
    assert!(fused.iter().zip(&wheels).all(|(a, b)| a == b));
    assert!(fused.iter().any(|record| record.state.odom_from_body.y_m.abs() > 0.5), "it drove");
}

#[test]
fn with_poses_it_is_where_it_should_be_on_a_slippery_floor_too() {
    let sensed = drive(&Case { set: 3, floor: 1, path: 1 }, 1);
    assert!(sensed.finished);
    assert!(sensed.driving_m < 2e-3 && sensed.resting_m < 1e-3, "{sensed:?}");
    let wheels = drive(&Case { set: 0, floor: 1, path: 1 }, 1);
    assert!(wheels.driving_m > 10.0 * sensed.driving_m, "{wheels:?}");
}

#[test]
fn with_a_gyro_its_heading_is_right_after_a_minute() {
    let sensed = drive(&Case { set: 1, floor: 0, path: 2 }, 1);
    assert!(sensed.finished && sensed.heading_rad.abs() < 2e-3, "{sensed:?}");
}

/// A robot with a tracker that is silent from a time on.
fn loses_its_tracker(keys: &str) -> (Trial, Vec<CycleRecord>) {
    let text = Case { set: 3, floor: 0, path: 1 }
        .text()
        .replace("kind = \"fused\"", &format!("kind = \"fused\"\n{keys}"));
    let mut trial = Trial::new(plan_of(&text));
    trial.run(1000);
    trial.enable();
    trial.step(Some(RequestKind::Track));
    trial.run(20_000);
    trial.silence_sensor("mocap");
    let records = (0..10_000).map(|_| *trial.step(None)).collect();
    (trial, records)
}

#[test]
fn a_tracker_that_is_lost_is_named_and_what_is_left_carries_on_as_far_as_it_is_worth() {
    let (trial, records) = loses_its_tracker("");
    let named = records
        .iter()
        .position(|record| record.fusion.sensors[3].verdict == omnibase_fusion::Verdict::Silent);
    assert!(named.is_some_and(|cycle| cycle <= 500), "{named:?}");
    assert_eq!(trial.robot.phase(), Phase::Tracking, "wheels, gyro and mice know enough yet");
    let sigma_m = |record: &CycleRecord| record.state.covariance[0].sqrt();
    assert!(sigma_m(&records[9_999]) > 2.0 * sigma_m(&records[0]), "and it is told what the pose is worth");
    // One who wants to know it better stops, at rest by its ramp, by name.
    let (trial, records) = loses_its_tracker("unknown_sigma_m = 0.001");
    assert!(records[0].state.pose_known);
    assert_eq!(trial.robot.record().stop_reason, SafetyReason::PoseUnknown);
    assert_ne!(trial.robot.phase(), Phase::Tracking);
}

#[test]
fn at_rest_nothing_moves_because_a_sensor_says_so() {
    let mut trial = Trial::new(plan_of(&Case { set: 3, floor: 0, path: 1 }.text()));
    trial.run(1000);
    trial.enable();
    let before = trial.pose();
    // Somebody moves the cameras by a centimetre.
    trial.shift_map([0.01, 0.0]);
    trial.run(5000);
    assert_eq!(trial.robot.phase(), Phase::Holding);
    assert!(trial.pose().distance_m(before) < 1e-4, "{:?}", trial.pose());
}
