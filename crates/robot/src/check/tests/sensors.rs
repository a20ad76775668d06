//! Sensors: what is wrong is told with its place, value and what was expected.

use super::*;
use crate::config::{InputOwner, SensorName};

const TRACKED: &str = include_str!("../../../../../robots/bmm_tracked.toml");

/// What is said of the one setting, after a change of the shipped file.
#[track_caller]
fn told(from: &str, to: &str, setting: &str) -> String {
    let text = TRACKED.replacen(from, to, 1);
    assert_ne!(text, TRACKED, "{from}");
    let problems = problems(&text);
    let problem = problems.iter().find(|problem| problem.setting == setting);
    problem.unwrap_or_else(|| panic!("nothing about {setting} in {}", show(&problems))).to_string()
}

#[test]
fn the_shipped_robot_with_a_tracker_resolves() {
    let plan = check(TRACKED).unwrap_or_else(|problems| panic!("{}", show(&problems)));
    let [gyro, mocap] = &plan.sensors[..] else { panic!("two sensors") };
    assert_eq!((gyro.kind, gyro.from, &gyro.inputs[..]), (SensorName::Gyro, InputOwner::Source(0), &[0][..]));
    assert_eq!((mocap.kind, mocap.from), (SensorName::Pose, InputOwner::Source(1)));
    assert_eq!(mocap.inputs, (1..10).collect::<Vec<_>>(), "with the covariance that its source carries");
    assert_eq!((mocap.delay_ns, mocap.sensor.body_from_sensor.x_m), (20_000_000, 0.1));
    assert_eq!(plan.signals().sensors, ["gyro", "mocap"]);
    assert!(plan.sources[1].any_order && !plan.sources[0].any_order, "poses find their place");
}

#[test]
fn mistakes_are_told_with_what_was_expected() {
    for (from, to, setting, words) in [
        ("\"fused\"", "\"wheel_odometry\"", "sensor", "allowed: estimator.kind = \"fused\""),
        ("\"imu.turn\"", "\"imi.turn\"", "sensor[0].from", "did you mean `imu`?"),
        ("\"imu.turn\"", "\"imu.rate\"", "sensor[0].from", "allowed: imu.turn"),
        ("kind = \"pose\"\nfrom = \"tracker\"", "kind = \"pose\"\nfrom = \"imu\"", "sensor[1].from", "imu.x"),
        ("name = \"mocap\"", "name = \"gyro\"", "sensor[1].name", "another sensor has the same name"),
        ("sigma_rad_s = 0.002", "sigma_m = 0.002", "sensor[0].sigma_m", "a key of pose"),
        ("kind = \"gyro\"\n", "", "sensor[0].kind", "what it tells"),
        (
            "name = \"mocap\"\njitter",
            "name = \"mocup\"\njitter",
            "simulation.sensor[1].name",
            "allowed: gyro, mocap",
        ),
    ] {
        let told = told(from, to, setting);
        assert!(told.contains(words), "{setting}: {told}");
    }
}

#[test]
fn no_more_than_the_filter_holds_are_taken() {
    let mut text = TRACKED.to_owned();
    for n in 0..4 {
        text += &format!("\n[[sensor]]\nname = \"more_{n}\"\nkind = \"gyro\"\nfrom = \"imu.turn\"\n");
    }
    let told = show(&problems(&text));
    assert!(told.contains("too many sensors that tell speeds") && told.contains("at most 4"), "{told}");
}

#[test]
fn a_sensor_on_the_bus_is_simulated_where_it_is_known_how_its_values_stand_there() {
    let imu = "\n[[device]]\nname = \"bus_imu\"\nposition = 3\nkind = \"io\"\n\
               inputs = [{ pdo = \"0x1A00\", map = \"6000.1:16\" }]\n\
               input = [{ name = \"turn\", object = \"6000.1\", type = \"i16\", scale = 1e-4, unit = \"rad/s\" }]\n";
    let gyro = |from: &str, more: &str| {
        format!(
            "\n[[sensor]]\nname = \"own\"\nkind = \"gyro\"\nfrom = \"{from}\"\n\n[[simulation.sensor]]\nname = \"own\"\n{more}"
        )
    };
    let of = |file: &str, more: &str| check(&format!("{file}{more}"));
    let fits = of(TRACKED, &(imu.to_owned() + &gyro("bus_imu.turn", "bias_rad_s = 0.01\n")));
    let plan = fits.unwrap_or_else(|problems| panic!("{}", show(&problems)));
    assert_eq!(plan.sensors[2].from, InputOwner::Device(0));
    let told = |file: &str, more: &str| show(&of(file, more).expect_err("it isn't as it should be"));
    let drift = told(TRACKED, &(imu.to_owned() + &gyro("bus_imu.turn", "clock_drift_ppm = 20.0\n")));
    assert!(drift.contains("simulation.sensor[2].clock_drift_ppm") && drift.contains("clock"), "{drift}");
    // An array that goes on in padding, of which a simulated SubDevice says 0.
    let beyond = imu
        .replace("6000.1:16\"", "6000.1:16 pad:16\"")
        .replace("object = \"6000.1\",", "object = \"6000.1\", byte = 2,");
    let padding = told(TRACKED, &(beyond + &gyro("bus_imu.turn", "")));
    assert!(padding.contains("it stands in padding"), "{padding}");
    let lift = include_str!("../../../../../robots/bmm_lift.toml");
    let axis = told(lift, &format!("\n[estimator]\nkind = \"fused\"\n{}", gyro("lift.speed", "")));
    assert!(axis.contains("in a way of its own"), "{axis}");
}
