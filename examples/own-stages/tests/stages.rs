//! The stages of this crate by their names, on the simulated robot; no randomness in it.

use omnibase_robot::signals::{CycleTime, RequestKind};
use omnibase_robot::stages::{Device, Reference};
use omnibase_robot::{Phase, Registry, Robot, RobotPlan};
use own_stages::device::SpeedFromCounts;
use own_stages::reference::Sway;
use own_stages::simulated::SimulatedRobot;

const ROBOT: &str = include_str!("../robot.toml");

fn registry() -> Registry {
    let mut registry = Registry::with_built_in();
    own_stages::register(&mut registry);
    registry
}

fn plan(text: &str) -> RobotPlan {
    let no_files = |name: &str| Err(format!("no file {name}"));
    RobotPlan::from_toml(text, &registry(), &no_files).expect("a sound file")
}

fn refusal(from: &str, to: &str) -> String {
    let text = ROBOT.replace(from, to);
    assert_ne!(text, ROBOT, "{from} isn't in the file");
    Robot::build(&plan(&text), &registry()).err().expect("refused").to_string()
}

#[test]
fn the_robot_sways_and_comes_back_to_where_it_started() {
    let mut simulated = SimulatedRobot::bring_up(&plan(ROBOT), &registry()).expect("OP");
    simulated.until(RequestKind::Enable, 5000, |_, robot| robot.phase() == Phase::Holding).expect("enabled");
    // Three seconds in, at the end of the way to the left: 0.8 m, within a centimetre of creep and lag.
    let top = simulated.until(RequestKind::Track, 3000, |record, _| record.state.odom_from_body.y_m > 0.799);
    let top = top.expect("0.8 m to the left");
    assert!((simulated.truth().pose.y_m - 0.8).abs() < 0.01, "{:?}", simulated.truth());
    assert!(top.state.odom_from_body.x_m.abs() < 0.002, "{top:?}");
    for _ in 0..16_000 {
        simulated.cycle(None).expect("the link holds");
    }
    assert_eq!(simulated.robot.phase(), Phase::Holding, "{}", simulated.robot.record().stop_reason.text());
    let truth = simulated.truth().pose;
    // The thesis's bound is 3 mm.
    assert!(truth.x_m.hypot(truth.y_m) < 1e-3, "{truth:?}");
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
    let mut sway = Sway::new(&plan(ROBOT)).expect("a reference");
    sway.start(&Default::default());
    let (end_s, h) = (sway.duration_s().expect("it ends"), 1e-4);
    for step in 1..1000 {
        let t = end_s * f64::from(step) / 1000.0;
        let [before, now, after] = [t - h, t, t + h].map(|t| sway.sample(t));
        let y = |setpoint: &omnibase_robot::signals::Setpoint| setpoint.odom_from_body.y_m;
        let speed = (y(&after) - y(&before)) / (2.0 * h);
        let acceleration = (y(&after) - 2.0 * y(&now) + y(&before)) / (h * h);
        // Differences of step h are wrong by h² times the third derivative, and by rounding: 1e-6 each.
        assert!((speed - now.twist_in_odom.vy_m_s).abs() < 1e-6, "at {t} s");
        assert!((acceleration - now.acceleration_in_odom.vy_m_s).abs() < 1e-6, "at {t} s");
    }
}

#[test]
fn settings_that_make_no_sense_are_refused_with_value_limit_and_reason() {
    let unknown = refusal("ki_1_s2 = 4.0", "ki_1_s2 = 4.0, ki = 1.0");
    assert_eq!(unknown, "controller.custom.ki: unknown key; known are kp_1_s, ki_1_s2");
    let missing = refusal("filter_1_s = 800.0", "");
    assert_eq!(missing, "drive rear: custom.filter_1_s: must be given: a number");
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
    let mut simulated = SimulatedRobot::bring_up(&plan(text), &registry()).expect("OP");
    simulated.until(RequestKind::Enable, 5000, |_, robot| robot.phase() == Phase::Holding).expect("enabled");
    // A circle of 20 s, and a second more.
    let ended = simulated.until(RequestKind::Track, 21_100, |_, robot| robot.phase() != Phase::Tracking);
    ended.expect("the circle ends");
    assert_eq!(simulated.robot.phase(), Phase::Holding, "{}", simulated.robot.record().stop_reason.text());
    let truth = simulated.truth().pose;
    assert!(truth.x_m.hypot(truth.y_m) < 1e-3, "{truth:?}");
}
