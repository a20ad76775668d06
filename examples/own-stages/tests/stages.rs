//! The stages of this crate by their names, on the simulated robot; no randomness in it.

use omnibase::prelude::*;
use own_stages::device::SpeedFromCounts;
use own_stages::reference::Sway;

const ROBOT: &str = include_str!("../robot.toml");

fn registry() -> Registry {
    let mut registry = Registry::with_built_in();
    own_stages::register(&mut registry);
    registry
}

fn check(text: &str) -> Result<RobotPlan, Vec<Problem>> {
    RobotPlan::from_toml(text, &registry(), &|name| Err(format!("no file {name}")))
}

fn plan(text: &str) -> RobotPlan {
    check(text).expect("a sound file")
}

fn refusal(from: &str, to: &str) -> String {
    let text = ROBOT.replace(from, to);
    assert_ne!(text, ROBOT, "{from} isn't in the file");
    let problems = check(&text).expect_err("refused");
    assert_eq!(problems.len(), 1, "{problems:?}");
    let Problem { place, .. } = &problems[0];
    assert!(place.is_some(), "{problems:?}");
    Problem { place: None, ..problems[0].clone() }.to_string()
}

#[test]
fn the_robot_sways_and_comes_back_to_where_it_started() {
    let robot = concat!(env!("CARGO_MANIFEST_DIR"), "/robot.toml");
    let ran = omnibase::simulate(robot.as_ref(), own_stages::register).expect("a run");
    assert!(ran.finished, "{:?}", ran.ended);
    let summary = &ran.summary;
    // Three times six seconds and the second of the hold.
    assert!((19_000..19_100).contains(&summary.cycles), "{}", summary.cycles);
    // 0.8 m to the left and back: it did move, and its wheels crept while it accelerated.
    let [rms_m, greatest_m] = [summary.rms_error_m.truth, summary.max_error_m.truth].map(Option::unwrap);
    assert!(rms_m > 1e-5 && greatest_m < 0.01, "{summary:?}");
    assert!(summary.max_error_m.believed.unwrap() < 5e-3, "{summary:?}");
    // The thesis's bound is 3 mm.
    assert!(summary.final_error_m.truth.unwrap() < 1e-3, "{summary:?}");
    assert_eq!(ran.last.measurements.present().len(), 3);
}

#[test]
fn the_speed_from_the_encoder_is_that_of_the_wheel() {
    let mut device = SpeedFromCounts::new(&plan(ROBOT).drives[0]).expect("a device");
    let mut inputs = [0; 12];
    let mut speed_rad_s = 0.0;
    // 1 rad/s; after 0.1 s the filter of 800 1/s has forgotten the start. Cycle 50 is lost.
    for index in (0..100).filter(|index| *index != 50) {
        let counts = (1_048_576.0 / std::f64::consts::TAU * 1e-3 * f64::from(index)).round() as i32;
        inputs[4..8].copy_from_slice(&counts.to_le_bytes());
        speed_rad_s = device.read(&CycleTime::on_grid(index as u64, 1_000_000), &inputs).speed_rad_s;
        assert!(speed_rad_s < 1.01, "cycle {index}: {speed_rad_s}");
    }
    // One count in a millisecond is 0.006 rad/s.
    assert!((speed_rad_s - 1.0).abs() < 0.006, "{speed_rad_s}");
}

#[test]
fn speed_and_acceleration_of_the_reference_are_its_derivatives() {
    let plan = plan(ROBOT);
    let mut sway = Sway::new(&plan.reference, &Ability::of(&plan)).expect("a reference");
    sway.start(&Default::default());
    let (end_s, h) = (sway.duration_s().expect("it ends"), 1e-4);
    for step in 1..1000 {
        let t = end_s * f64::from(step) / 1000.0;
        let [before, now, after] = [t - h, t, t + h].map(|t| sway.sample(t));
        let y = |setpoint: &Setpoint| setpoint.odom_from_body.y_m;
        let speed = (y(&after) - y(&before)) / (2.0 * h);
        let acceleration = (y(&after) - 2.0 * y(&now) + y(&before)) / (h * h);
        // Differences of step h are wrong by h² times the third derivative, and by rounding: 1e-6 each.
        assert!((speed - now.twist_in_odom.vy_m_s).abs() < 1e-6, "at {t} s");
        assert!((acceleration - now.acceleration_in_odom.vy_m_s).abs() < 1e-6, "at {t} s");
    }
}

#[test]
fn settings_that_make_no_sense_are_refused_with_value_limit_and_reason() {
    let unknown = refusal("ki_1_s2 = 4.0", "ki_1_s2 = 4.0, ki_1_s = 1.0");
    let hint = "controller.custom.ki_1_s = 1.0: no controller reads it; did you mean `custom.ki_1_s2`?";
    assert!(unknown.starts_with(hint), "{unknown}");
    let missing = refusal("filter_1_s = 800.0", "");
    assert_eq!(missing, "drive_defaults.custom.filter_1_s: must be given: `speed_from_counts` needs it");
    let wild = refusal("kp_1_s = 6.0", "kp_1_s = 600.0");
    assert_eq!(
        wild,
        "controller.custom.kp_1_s = 600.0: expected a number within its bounds (allowed: 0 to 100)"
    );
    let fast = refusal("period_s = 6.0", "period_s = 2.0");
    assert_eq!(
        fast,
        "reference.custom.period_s: 2 s need a speed of 1.63 m/s, allowed is 1 m/s; the limits allow 4.59 s and more"
    );
}

#[test]
fn the_robot_file_of_the_guide_runs() {
    let guide = include_str!("../../../docs/guides/add-a-drive-by-configuration.md");
    let text = guide.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a file");
    let folder = tempfile::tempdir().expect("a folder");
    let robot = folder.path().join("robot.toml");
    std::fs::write(&robot, text).expect("a file");
    let ran = omnibase::simulate(&robot, own_stages::register).expect("a run");
    // A circle of 20 s, and a second more.
    assert!(ran.finished && ran.summary.cycles > 21_000, "{:?}", ran.ended);
    assert!(ran.summary.final_error_m.truth.unwrap() < 1e-3, "{:?}", ran.summary);
}
