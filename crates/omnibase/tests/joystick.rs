//! The joystick as a user meets it, by recorded events: no device is needed.

use crate::joystick_recording::recording;
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::process::{Command, Output, Stdio};

const ROBOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm.toml");
const ABS_Y: u16 = 1;
const TRIGGER: u16 = 0x120;
const ENABLE: u16 = 0x12B;

fn omnibase(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_omnibase")).args(arguments).stdin(Stdio::null()).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn recorded_events_are_shown_with_their_map_and_as_speeds() {
    let folder = tempfile::tempdir().unwrap();
    let path =
        recording(folder.path(), &[(100, ABS_Y, 0), (200, TRIGGER, 1), (300, ENABLE, 1), (400, TRIGGER, 0)]);
    let path = path.to_str().unwrap();
    let shown = omnibase(&["joystick", ROBOT, "--events", path, "--json"]);
    assert_eq!(shown.status.code(), Some(0), "{}", text(&shown.stderr));
    let lines: Vec<Value> =
        text(&shown.stdout).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines[0]["map"]["ready"], "t_flight_stick_x");
    assert_eq!(lines[0]["map"]["buttons"]["dead_man"], "BTN_TRIGGER");
    assert_eq!(lines[0]["axes"]["ABS_Y"]["max"], 255);
    // Pushed without the dead-man button: seen, but no wish.
    let pushed = lines.iter().find(|line| line["raw"]["ABS_Y"] == 0).unwrap();
    assert_eq!((&pushed["hold"], pushed["twist"][0].as_f64()), (&Value::from("released"), Some(0.0)));
    assert_eq!(pushed["shaped"]["twist"][0], 1.0);
    let held = lines.iter().find(|line| line["hold"] == "held").unwrap();
    assert_eq!((held["twist"][0].as_f64(), held["speeds"]["vx_m_s"].as_f64()), (Some(1.0), Some(1.0)));
    assert!(lines.iter().any(|line| line["asked"] == "enable"));
    // The end of the recording is that of the device.
    let last = lines.last().unwrap();
    assert_eq!((&last["presence"], &last["block"]), (&Value::from("absent"), &Value::from("lost")));
    // The same, for people; and the same again, to the letter.
    let [words, again] = [(); 2].map(|()| text(&omnibase(&["joystick", ROBOT, "--events", path]).stdout));
    assert!(words.contains("  dead_man        BTN_TRIGGER      held while driving"), "{words}");
    assert!(words.contains("x   1.000 m/s"), "{words}");
    assert!(
        words.contains("absent, released, platform frame, blocked (lost): press the enable button"),
        "{words}"
    );
    assert_eq!(words, again);
}

#[test]
fn what_is_no_device_and_no_recording_is_refused_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("no.events");
    std::fs::write(&path, [0; 48]).unwrap();
    let refused = omnibase(&["joystick", "--events", path.to_str().unwrap()]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(text(&refused.stderr).contains("not a recording of events"), "{}", text(&refused.stderr));
    let missing = omnibase(&["joystick", "--device", "/dev/input/event9999"]);
    assert_eq!(missing.status.code(), Some(1));
    assert!(
        text(&missing.stderr).contains("/dev/input/event9999: No such file"),
        "{}",
        text(&missing.stderr)
    );
    // A map that doesn't fit the device, from the robot's file.
    let path = recording(folder.path(), &[]);
    let unfit =
        omnibase(&["joystick", ROBOT, "--set", "joystick.map=\"xbox\"", "--events", path.to_str().unwrap()]);
    assert_eq!(unfit.status.code(), Some(1));
    assert!(text(&unfit.stderr).contains("ABS_RX: the device has no such axis"), "{}", text(&unfit.stderr));
}

#[test]
fn a_recorded_joystick_drives_the_simulated_robot_and_its_end_stops_it() {
    let folder = tempfile::tempdir().unwrap();
    // Grasped again and again: drives come up when the machine lets them.
    let grasps = (0..20).flat_map(|n| [(1500 + 400 * n, TRIGGER, 1), (1800 + 400 * n, TRIGGER, 0)]);
    let changes: Vec<_> = [(100, ENABLE, 1), (200, ENABLE, 0), (1000, ABS_Y, 64)]
        .into_iter()
        .chain(grasps)
        .chain([(10_000, TRIGGER, 1), (11_000, ABS_Y, 0)])
        .collect();
    let path = recording(folder.path(), &changes);
    let mut robot = Command::new(env!("CARGO_BIN_EXE_omnibase"))
        .args(["run", ROBOT, "--json", "--joystick"])
        .arg(&path)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = Vec::new();
    for line in BufReader::new(robot.stderr.take().unwrap()).lines().map_while(Result::ok) {
        let is_end = line.contains("blocked until it is enabled");
        said.push(line);
        if is_end {
            break;
        }
    }
    let robot_id = rustix::process::Pid::from_child(&robot);
    rustix::process::kill_process(robot_id, rustix::process::Signal::INT).unwrap();
    let output = robot.wait_with_output().unwrap();
    let said = said.join("\n");
    assert!(said.contains("joystick: Thrustmaster T.Flight Stick X: hold BTN_TRIGGER to drive"), "{said}");
    assert!(said.contains("drives by hand") && said.contains("let go of the stick"), "{said}");
    assert!(said.contains("blocked until it is enabled"), "{said}");
    assert_eq!(output.status.code(), Some(0), "{said}");
    let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(summary["cycles"].as_u64().unwrap() > 5000, "{summary}");
}
