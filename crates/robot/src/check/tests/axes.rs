//! Axes, and drives with a mode of their own: what is wrong is told with its place, value and what was expected.

use super::*;
use omnibase_cia402::Mode;

const LIFT: &str = include_str!("../../../../../robots/bmm_lift.toml");

/// The value and what was expected, of the one problem of a setting.
#[track_caller]
fn told(from: &str, to: &str, setting: &str) -> (Option<String>, Option<String>) {
    let text = LIFT.replace(from, to);
    assert_ne!(text, LIFT, "{from}");
    let problems = problems(&text);
    let problem = problems.iter().find(|problem| problem.setting == setting);
    let problem = problem.unwrap_or_else(|| panic!("nothing about {setting} in {}", show(&problems)));
    (problem.value.clone(), problem.limit.clone())
}

/// The value that a drive is sent at start-up.
fn sent(plan: &DevicePlan, object: (u16, u8)) -> Option<i64> {
    let mut found = plan.parameters.iter().filter(|one| (one.index, one.subindex) == object);
    let data = &found.next()?.data;
    assert!(found.next().is_none(), "once");
    Some(data.iter().rev().fold(0, |value, byte| value << 8 | i64::from(*byte)))
}

#[test]
fn the_shipped_robot_with_a_lift_resolves_and_tells_its_drive_the_limits() {
    let plan = check(LIFT).unwrap_or_else(|problems| panic!("{}", show(&problems)));
    let lift = &plan.devices[1];
    let axis = lift.axis.as_ref().unwrap();
    // 1 m is 50 revolutions of the spindle, 200 of the motor.
    assert_eq!(axis.scale.counts_per_unit, 200.0 * 1_048_576.0);
    assert_eq!((axis.scale.counts(0.1), axis.scale.position(20_971_520)), (20_971_520, 0.1));
    assert_eq!(
        axis.needed_modes(),
        [Mode::CyclicSynchronousPosition, Mode::ProfilePosition, Mode::ProfileVelocity, Mode::Homing]
    );
    let counts = |value: f64| Some((value * 200.0 * 1_048_576.0) as i64);
    for (object, value) in [
        ((0x6007, 0), Some(3)),
        ((0x605A, 0), Some(6)),
        ((0x6065, 0), counts(0.005)),
        ((0x6081, 0), counts(0.15)),
        ((0x6083, 0), counts(0.5)),
        ((0x6085, 0), counts(1.0)),
        ((0x605D, 0), Some(2)),
        ((0x6098, 0), Some(17)),
        ((0x6099, 2), counts(0.005)),
        // The cycle writes it.
        ((0x6072, 0), None),
    ] {
        assert_eq!(sent(lift, object), value, "{object:04x?}");
    }
    let names: Vec<_> =
        plan.signals().inputs.iter().map(|one| format!("{} {}", one.name, one.unit)).collect();
    assert_eq!(names[1..4], ["lift.position m", "lift.speed m/s", "lift.torque N·m"]);
    let config = lift.subdevice_config(&plan.bus);
    assert_eq!(config.dc, plan.drives[0].subdevice_config(&plan.bus).dc, "it acts at the beat of the wheels");
    // What the file says itself goes before what follows from it.
    let own = "[device.axis]";
    let text = LIFT
        .replace(own, &format!("parameters = [{{ object = \"6085\", type = \"u32\", value = 77 }}]\n{own}"));
    assert_eq!(sent(&check(&text).unwrap().devices[1], (0x6085, 0)), Some(77));
}

#[test]
fn every_mistake_about_an_axis_is_refused_with_its_value_and_what_was_expected() {
    let some = |text: &str| Some(text.to_owned());
    let at = |key: &str| format!("device[1].axis.{key}");
    for (from, to, key, value, expected) in [
        ("[0.01, 0.60]", "[0.60, 0.01]", "position_limits", "[0.6, 0.01]", "the least, then the greatest"),
        ("[0.01, 0.60]", "[0.01, 6.0]", "position_limits", "6", "less than 5.12 from zero_position = 0"),
        (
            "stop_deceleration = 1.0",
            "stop_deceleration = 0.4",
            "stop_deceleration",
            "0.4",
            "at least acceleration_limit = 0.5",
        ),
        (
            "switch_speed = 0.05",
            "switch_speed = 0.5",
            "homing.switch_speed",
            "0.5",
            "at most speed_limit = 0.15",
        ),
        ("jerk_limit = 10.0", "jerk_limit = 0.5", "jerk_limit", "0.5", "at least 1"),
        (
            "speed_limit = 0.15",
            "speed_limit = 15",
            "speed_limit",
            "15",
            "0.00000000476837158203125 to 10.239999995231628",
        ),
        (
            "torque_limit_nm = 3.0",
            "torque_limit_nm = 50",
            "torque_limit_nm",
            "50",
            "at most 41.614090000000004",
        ),
        ("unit = \"m\"", "unit = \"rad\"", "feed_m", "0.02", "`unit = \"m\"`, or no feed"),
        ("method = 17", "method = 0", "homing.method", "0", "a method of the profile or the manufacturer"),
    ] {
        assert_eq!(told(from, to, &at(key)), (some(value), some(expected)), "{to}");
    }
    for (from, to, key) in [
        ("unit = \"m\"", "", "unit"),
        ("feed_m = 0.02", "", "feed_m"),
        ("position_limits = [0.01, 0.60]", "", "position_limits"),
        ("speed_limit = 0.15", "", "speed_limit"),
        ("following_error = 0.005", "", "following_error"),
        ("rated_torque_nm = 1.27", "", "rated_torque_nm"),
        ("homing = {", "# {", "homing"),
        ("method = 17, ", "", "homing.method"),
        ("speed_limit = 0.15", "speed_limit = -1", "speed_limit"),
    ] {
        told(from, to, &at(key));
    }
    told("kind = \"axis\"", "kind = \"io\"", "device[1].axis");
    told(
        "[device.axis]",
        "outputs = [{ pdo = \"0x1600\", map = \"6040:16 6060:8\" }]\n[device.axis]",
        "device[1]",
    );
}

#[test]
fn what_an_object_of_the_drive_cant_hold_is_refused() {
    let limits = ("0.00000000476837158203125", "20.47999999523163");
    for (from, to, key, value) in [
        ("stop_deceleration = 1.0", "stop_deceleration = 21.0", "stop_deceleration", "21"),
        ("acceleration = 0.5, ", "acceleration = 21.0, ", "homing.acceleration", "21"),
        ("following_error = 0.005", "following_error = 21.0", "following_error", "21"),
        ("following_error = 0.005", "following_error = 4e-9", "following_error", "0.000000004"),
        ("zero_speed = 0.005", "zero_speed = 4e-9", "homing.zero_speed", "0.000000004"),
        ("switch_speed = 0.05", "switch_speed = 4e-9", "homing.switch_speed", "0.000000004"),
        ("acceleration_limit = 0.5", "acceleration_limit = 4e-9", "acceleration_limit", "0.000000004"),
    ] {
        let text = LIFT.replace(from, to).replace("jerk_limit = 10.0", "");
        let problems = problems(&text);
        let [problem] = &problems[..] else { panic!("{to}: {}", show(&problems)) };
        assert_eq!(problem.setting, format!("device[1].axis.{key}"));
        assert_eq!(problem.value.as_deref(), Some(value));
        let limit = problem.limit.as_deref().unwrap();
        let most = if key == "following_error" { "20.47999999046" } else { limits.1 };
        assert!(limit.starts_with(&format!("{} to {most}", limits.0)), "{to}: {limit}");
        assert!(problem.reason.contains("0x60"), "{problem}");
    }
    // An object that the file writes itself is the file's.
    let own = "[device.axis]";
    let parameters = "parameters = [{ object = \"6085\", type = \"u32\", value = 77 }]\n[device.axis]";
    let text = LIFT.replace(own, parameters).replace("jerk_limit = 10.0", "");
    assert!(check(&text.replace("stop_deceleration = 1.0", "stop_deceleration = 21.0")).is_ok());
}

#[test]
fn a_law_that_commands_torques_commands_no_drive_that_takes_speeds() {
    let with = |law: &str, more: &str| {
        let text = BMM.replace("name = \"wheel_2\"", &format!("name = \"wheel_2\"\n{more}"));
        text.replace("kind = \"closed_loop_speed\"", &format!("kind = \"{law}\""))
    };
    let all = problems(&with("adaptive_torque", "mode = \"speed\""));
    let (problem, kind, ..) = found(&all, "drive[1].mode");
    assert_eq!(kind, ProblemKind::Contradiction);
    assert!(problem.reason.contains("adaptive_torque commands torques"), "{problem}");
    assert_eq!(problem.value.as_deref(), Some("\"speed\""));
    assert!(check(&with("adaptive_torque", "mode = \"torque\"")).is_ok());
    assert!(check(&with("closed_loop_speed", "mode = \"speed\"")).is_ok());
    // A law to which it can be switched counts too.
    let others = with("closed_loop_speed", "mode = \"speed\"")
        .replace("[controller]", "[controller]\nothers = [\"adaptive_torque\"]");
    assert!(show(&problems(&others)).contains("adaptive_torque commands torques"));
    // Without a loop nothing makes torques of speeds.
    let all = problems(&with("closed_loop_speed", "mode = \"torque\""));
    let missing = all.iter().find(|problem| problem.setting == "drive[1].speed_loop_gain_nm_s_rad");
    assert!(missing.unwrap().reason.contains("wheel_2"), "{}", show(&all));
    let gain = "mode = \"torque\"\nspeed_loop_gain_nm_s_rad = 20.0";
    let all = problems(&with("closed_loop_speed", gain));
    assert!(all.iter().any(|problem| problem.setting == "drive[1].speed_loop_integral_s"), "{}", show(&all));
    assert!(check(&with("closed_loop_speed", &format!("{gain}\nspeed_loop_integral_s = 0.05"))).is_ok());
}
