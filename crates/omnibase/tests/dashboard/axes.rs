//! An axis, as people and programs see and move it.

use serde_json::json;

use crate::robot::Robot;

const WITH_LIFT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm_lift.toml");

#[test]
fn an_axis_is_homed_moved_and_seen_by_command_and_call() {
    let robot = Robot::start_file(WITH_LIFT, &[]);
    let (code, text, _) = robot.command(&["get", "lift/"]);
    assert_eq!(code, Some(0));
    for name in ["lift/position_m", "lift/speed_m_s", "lift/set_point_m", "lift/state", "lift/homed"] {
        assert!(text.contains(name), "{name}: {text}");
    }
    assert_eq!(robot.call(&json!({ "do": "enable" })).1["done"], true);
    robot.wait("it holds", |robot| robot.read("now")["phase"] == "holding");
    let told = |call: serde_json::Value, words: &str| {
        let (_, said) = robot.call(&call);
        assert!(said["text"].as_str().unwrap_or_default().contains(words), "{said}");
        assert_eq!(said["done"], false);
    };
    told(json!({ "do": "move_axis", "name": "lift", "position": 0.3 }), "home it first (home_axis)");
    let (code, text, said) = robot.command(&["call", "home_axis", "name=lift"]);
    assert_eq!(code, Some(0), "{text}{said}");
    robot.wait("it is homed", |robot| robot.value("lift/homed") == 1.0 && robot.value("lift/state") == 1.0);
    let (code, text, said) = robot.command(&["call", "move_axis", "name=lift", "position=0.1", "mode=pp"]);
    assert_eq!(code, Some(0), "{text}{said}");
    robot.wait("it is there", |robot| (robot.value("lift/position_m") - 0.1).abs() < 1e-3);
    told(json!({ "do": "move_axis", "name": "left", "position": 0.3 }), "the robot's are lift, found `left`");
    told(json!({ "do": "move_axis", "name": "lift", "position": 3.0 }), "expected 0.01 to 0.6 m, found 3");
    let (_, said) = robot.call(&json!({ "do": "move_axis", "name": "lift", "position": 0.6 }));
    assert_eq!(said["done"], true, "{said}");
    let (code, ..) = robot.command(&["call", "stop_axis", "name=lift"]);
    assert_eq!(code, Some(0));
    robot.wait("it rests", |robot| robot.value("lift/state") == 1.0);
    assert!(robot.value("lift/position_m") < 0.59);
}
