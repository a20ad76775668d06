//! Driving to a pose through the room: around walls, around what comes meanwhile, and given up where nothing leads there.

use serde_json::{Value, json};
use std::time::Duration;

use super::robot::Robot;

/// A wall from below to y = 0.4 m; the footprint stands at the origin, left of it.
const WALL: &str = "map.blocked_m=[[[1.3,-4.0],[1.5,-4.0],[1.5,0.4],[1.3,0.4]]]";

/// What is said where a busy machine gave the search too little of its time, and while it still has to do with the one before.
const NO_TIME: [&str; 3] =
    ["in the time that was given for it", "too busy to plan it in time", "ask again when they are done"];

/// The search gives way to every other program: with many beside it a way takes minutes.
const PLANNED: Duration = Duration::from_secs(600);

/// Waits for what a search is needed for.
fn wait(robot: &Robot, what: &str, holds: impl FnMut(&Robot) -> bool) {
    let came_true = robot.is_true_within(holds, PLANNED);
    assert!(came_true, "never came true: {what}: {}", robot.read("now"));
}

fn drive(robot: &Robot, pose: [f64; 3]) {
    robot.wait("it holds", |robot| robot.read("now")["phase"] == "holding");
    // Who waits for a way on a busy machine is told after some seconds that there was no time for it, and asks again.
    let mut said = Value::Null;
    wait(robot, "there is time for a way", |robot| {
        said = robot.call(&json!({ "do": "drive_to", "pose": pose })).1;
        !NO_TIME.iter().any(|words| said["text"].as_str().unwrap().contains(words))
    });
    assert_eq!(said["done"], true, "{said}");
    assert!(said["text"].as_str().unwrap().starts_with("on the way: "), "{said}");
}

fn way(robot: &Robot) -> Value {
    robot.read("now")["drive_to"].clone()
}

fn ended(robot: &Robot) -> Value {
    wait(robot, "the way ends", |robot| way(robot)["under_way"] == false);
    way(robot)
}

fn put(robot: &Robot, centre_m: [f64; 2], radius_m: f64) {
    let obstacle = json!({ "do": "set_obstacle", "index": 0, "centre_m": centre_m, "radius_m": radius_m });
    assert_eq!(robot.call(&obstacle).1["done"], true);
}

#[test]
fn a_robot_drives_around_walls_and_around_what_comes_and_says_why_it_gives_up() {
    let robot = Robot::start(&["--set", WALL, "--set", "avoidance.give_up_s=1"]);
    assert_eq!(robot.read("map")["blocked_m"][0][2], json!([1.5, 0.4]));
    assert_eq!(robot.call(&json!({ "do": "enable" })).1["done"], true);
    drive(&robot, [2.8, 0.0, 0.0]);
    assert_eq!(ended(&robot)["text"], "there");
    let far = (robot.value("state/pose_x_m") - 2.8).hypot(robot.value("state/pose_y_m"));
    assert!(far < 0.01, "{far} m from its goal");
    // Above the wall's end, never through it.
    let trace = robot.read("trace");
    let poses = || trace.as_array().unwrap().iter().map(|point| &point[2]);
    let over = poses().filter(|pose| (1.3..1.5).contains(&pose[0].as_f64().unwrap()));
    let lowest = over.map(|pose| pose[1].as_f64().unwrap()).fold(f64::INFINITY, f64::min);
    assert!((0.6..1.5).contains(&lowest), "it passed the wall at y {lowest} m");

    // Back; something comes onto the way above the wall. Again where a busy machine put it there too late, or had no time to plan.
    let again = |from: [f64; 3]| {
        assert_eq!(robot.call(&json!({ "do": "remove_obstacle", "index": 0 })).1["done"], true);
        drive(&robot, from);
        assert_eq!(ended(&robot)["text"], "there");
    };
    let has_planned = (0..20).any(|_| {
        drive(&robot, [0.0, 0.0, 0.0]);
        wait(&robot, "it moves", |robot| robot.value("state/pose_x_m") < 2.75);
        put(&robot, [1.4, 1.0], 0.2);
        let has_planned = || way(&robot)["text"].as_str().unwrap().contains("planned again once");
        wait(&robot, "it is planned again, or over", |_| has_planned() || way(&robot)["under_way"] == false);
        let has_planned = has_planned();
        let how = ended(&robot)["text"].as_str().unwrap().to_owned();
        let had_no_time = how.contains(NO_TIME[0]) || how.contains(NO_TIME[1]);
        assert!(how == "there" || had_no_time, "{how}; {}", robot.read("events"));
        let has_planned = has_planned && !had_no_time;
        if !has_planned {
            again([2.8, 0.0, 0.0]);
        }
        has_planned
    });
    assert!(has_planned, "{}", way(&robot));

    // Something comes to where it shall stand; again where it stood there before.
    let way = (0..20).find_map(|_| {
        drive(&robot, [0.0, 2.5, 0.0]);
        put(&robot, [0.0, 2.5], 0.2);
        let way = ended(&robot);
        let is_late = way["text"] == "there";
        if is_late {
            again([0.0, 0.0, 0.0]);
        }
        (!is_late).then_some(way)
    });
    let way = way.expect("it comes before the robot once in twenty times");
    let text = way["text"].as_str().unwrap();
    assert!(
        text.starts_with("drive_to was given up: goal (0.000, 2.500, 0.000)") && way["failed"] == true,
        "{text}"
    );
    let events = robot.read("events").to_string();
    assert!(events.contains("drive_to was given up"), "{events}");
    let refused = robot.call(&json!({ "do": "drive_to", "pose": [1.4, -1.0, 0.0] })).1;
    assert_eq!(refused["done"], false);
    assert!(
        refused["text"].as_str().unwrap().contains("goal (1.400, -1.000, 0.000): the footprint touches"),
        "{refused}"
    );
}

/// Robot's answers to a drive that it refuses: nothing begins later, and what was under way goes on.
#[test]
fn a_drive_that_is_refused_begins_nothing_and_ends_nothing() {
    let robot = Robot::start(&["--circle", "radius_m=0.5,duration_s=60,turns=4"]);
    assert_eq!(robot.call(&json!({ "do": "enable" })).1["done"], true);
    drive(&robot, [1.0, 0.0, 0.0]);
    assert_eq!(ended(&robot)["text"], "there");
    // Who is in no phase to drive is told once that it is refused.
    assert_eq!(robot.call(&json!({ "do": "stop", "category": "category_0" })).1["done"], true);
    robot.wait("it is disabled", |robot| robot.read("now")["phase"] == "disabled");
    let said = robot.call(&json!({ "do": "drive_to", "pose": [1.2, 0.0, 0.0] })).1;
    assert_eq!(said["text"], "refused: the robot is disabled: enable it first", "{said}");
    assert_eq!(robot.call(&json!({ "do": "enable" })).1["done"], true);
    robot.wait("it holds", |robot| robot.read("now")["phase"] == "holding");
    // Where it stands there is nothing to drive, and no drive.
    let here = robot.read("now")["values"].clone();
    let pose = ["x_m", "y_m", "heading_rad"].map(|name| here[format!("setpoint/pose_{name}")].clone());
    let said = robot.call(&json!({ "do": "drive_to", "pose": pose })).1;
    assert_eq!((&said["done"], &said["text"]), (&json!(true), &json!("it stands there already")), "{said}");
    // Slowly from rest: it goes.
    let set = |factor: f64| {
        let said = robot.call(&json!({ "do": "set", "values": { "speed_factor": factor } })).1;
        assert_eq!(said["done"], true, "{said}");
    };
    set(0.15);
    drive(&robot, [4.0, 0.0, 0.0]);
    robot.wait("it is on its way", |robot| robot.speed_m_s() > 0.01);
    // What can't be planned leaves the drive before under way.
    let refused = robot.call(&json!({ "do": "drive_to", "pose": [9000.0, 9000.0, 0.0] })).1;
    assert_eq!(refused["done"], false, "{refused}");
    assert_eq!(way(&robot)["under_way"], true, "{}", way(&robot));
    set(1.0);
    assert_eq!(ended(&robot)["text"], "there");
    let x_m = robot.value("setpoint/pose_x_m");
    assert!((x_m - 4.0).abs() < 0.01, "{x_m} m");
    // Whoever pauses it ends it at once, and what was planned then is gone on with by nobody.
    set(0.15);
    drive(&robot, [1.0, 0.0, 0.0]);
    robot.wait("it is on its way", |robot| robot.speed_m_s() > 0.01);
    assert_eq!(robot.call(&json!({ "do": "pause" })).1["done"], true);
    assert_eq!(
        (&way(&robot)["under_way"], &way(&robot)["failed"]),
        (&json!(false), &json!(true)),
        "{}",
        way(&robot)
    );
    for _ in 0..2 {
        for call in ["resume", "track"] {
            let said = robot.call(&json!({ "do": call })).1;
            assert!(said["text"].as_str().unwrap().contains("drive there again"), "{call}: {said}");
        }
        robot.wait("it holds", |robot| robot.read("now")["phase"] == "holding");
    }
    set(1.0);
    drive(&robot, [1.0, 0.0, 0.0]);
    assert_eq!(ended(&robot)["text"], "there");
}
