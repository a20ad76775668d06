//! A program in a process of its own sends a thousand times a second what the robot needs to be enabled.

use std::process::{Child, Command, Stdio};

use serde_json::json;

use super::robot::Robot;

const ROBOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm.toml");
/// Of a patience that a busy machine needs.
const GATE: &str = "
[safety]
enable_input = \"gate.open\"
[[source]]
name = \"gate\"
max_age_ms = 2000
input = [{ name = \"open\" }]
";

/// `omnibase send`, until it is killed with the value.
struct Sender(Child);

impl Sender {
    fn start(robot: &Robot) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_omnibase"));
        command.args(["send", "gate", "open=1", "--every", "1ms"]);
        command.env("XDG_RUNTIME_DIR", robot.folder.path()).env_remove("OMNIBASE_TOKEN");
        Sender(command.stdin(Stdio::null()).stderr(Stdio::null()).spawn().unwrap())
    }
}

impl Drop for Sender {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn heard(robot: &Robot) -> u64 {
    robot.read("now")["sources"][0]["heard"].as_u64().unwrap()
}

fn is(robot: &Robot, phase: &str) -> bool {
    robot.read("now")["phase"] == phase
}

#[test]
fn another_process_enables_the_robot_a_thousand_times_a_second_and_stops_it_by_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (file, recorded) = (path("robot.toml"), path("run.mcap"));
    std::fs::write(&file, std::fs::read_to_string(ROBOT).unwrap() + GATE).unwrap();
    let robot = Robot::start_file(&file, &["--record", &recorded]);
    let (_, refused) = robot.call(&json!({ "do": "enable" }));
    assert_eq!(refused["done"], false, "{refused}");
    // What is no number, and what nobody knows of, isn't believed.
    let (code, _, said) = robot.command(&["send", "gate", "open=nan"]);
    assert_eq!(code, Some(0), "{said}");
    let (code, _, said) = robot.command(&["send", "gate", "shut=1"]);
    assert!(code == Some(1) && said.contains("there is only `open`"), "{said}");
    assert_eq!(robot.call(&json!({ "do": "enable" })).1["done"], false);
    let sender = Sender::start(&robot);
    robot.wait("many are heard", |robot| heard(robot) > 1000);
    assert_eq!(robot.call(&json!({ "do": "enable" })).1["done"], true);
    robot.wait("it holds", |robot| is(robot, "holding"));
    drop(sender);
    robot.wait("it stops", |robot| is(robot, "fault"));
    // Its return moves nothing.
    let (before, _sender) = (heard(&robot), Sender::start(&robot));
    robot.wait("many more are heard", |robot| heard(robot) > before + 1000);
    assert!(is(&robot, "fault"));
    assert_eq!(robot.call(&json!({ "do": "acknowledge" })).1["done"], true);
    robot.wait("it was acknowledged", |robot| is(robot, "disabled"));
    let report = robot.end();
    println!("{} messages heard in {} cycles", before, report["cycles"]);
    let mut replay = Command::new(env!("CARGO_BIN_EXE_omnibase"));
    let replayed = replay.args(["replay", &recorded]).output().unwrap();
    assert!(String::from_utf8_lossy(&replayed.stdout).contains("the same to the bit"), "{replayed:?}");
}
