//! Parts of the bus that aren't in every frame or at every start: slow devices and hot-connect groups, over a cable.

use super::support::{ATTEMPTS, Ended, PATIENT, Program, Scratch, events, repository, was_paused};
use omnibase_host::Namespace;
use std::fs;

/// A panel of inputs and outputs behind the three wheels.
const PANEL: &str = "kind = \"io\"\n\
    inputs = [{ pdo = \"0x1A00\", map = \"6000.1:1 6000.2:1\" }]\n\
    outputs = [{ pdo = \"0x1600\", map = \"7000.1:16\" }]\n\
    input = [{ name = \"closed\", object = \"6000.1\", simulated = 1 }, { name = \"full\", object = \"6000.2\" }]\n\
    output = [{ name = \"force\", object = \"7000.1\", type = \"u16\" }]\n";

/// The shipped robot and a device with these keys.
fn with(name: &str, keys: &str) -> Scratch {
    let file = Scratch::new(&format!("{name}.toml"));
    let text = fs::read_to_string(repository("robots/bmm.toml")).unwrap();
    let (wheels, rest) = text.split_once("[platform]").unwrap();
    let device = format!("[[device]]\nname = \"{name}\"\n{keys}{PANEL}\n[platform]");
    fs::write(&file.0, format!("{wheels}{device}{rest}")).unwrap();
    file
}

/// `simulated` behind the cable, `robot` driven along a short circle; again where this machine paused for longer than it bears.
fn driven(simulated: &str, robot: &str, more: &[&str]) -> (Ended, Ended) {
    for attempt in 1.. {
        let simulator = Program::simulate(&[simulated]);
        let circle = ["--circle", "radius_m=0.2,duration_s=6"];
        let run = Program::run(&[&[robot][..], &circle, &PATIENT, more].concat()).end();
        simulator.signal("INT");
        let simulated = simulator.end();
        if attempt == ATTEMPTS || !was_paused(&run, &simulated) {
            return (run, simulated);
        }
        eprintln!("attempt {attempt}: this machine paused, and the robot stopped: {}", run.output);
    }
    unreachable!("the last attempt is returned")
}

#[track_caller]
fn drove(run: &Ended, simulated: &Ended) {
    assert!(run.status.success(), "{}\n{}", run.output, run.said);
    assert!(events(&simulated.json()).contains(&"the robot moves"), "{}", simulated.output);
}

/// A panel of every tenth cycle: its age grows from turn to turn and falls at each, whatever cycles a busy machine leaves out.
#[test]
fn a_slow_device_has_its_turns_and_the_robot_drives() {
    let Some(namespace) = Namespace::for_test("a_slow_device_has_its_turns") else { return };
    let robot = with("panel", "position = 3\nevery = 10\n");
    let (recording, table) = (Scratch::new("slow.mcap"), Scratch::new("slow.csv"));
    let robot = robot.0.to_str().unwrap();
    let (run, simulated) =
        namespace.run(|| driven(robot, robot, &["--record", recording.path(), "--signals", "panel.*"]));
    drove(&run, &simulated);
    let export = Program::omnibase(&["export", recording.path(), "--output", table.path()]).end();
    assert!(export.status.success(), "{}", export.said);
    let table = fs::read_to_string(&table.0).unwrap();
    let (names, rows) = table.split_once("\r\n").unwrap();
    let column = |name: &str| {
        let at = names.split(',').position(|column| column == name);
        let at = at.unwrap_or_else(|| panic!("{name}: {names}"));
        let numbers = rows.lines().map(|row| row.split(',').nth(at).unwrap().parse().unwrap_or(f64::NAN));
        numbers.collect::<Vec<f64>>()
    };
    let (ages_s, closed) = (column("panel.age_s"), column("panel.closed"));
    assert!(ages_s.len() > 500, "{} rows", ages_s.len());
    // From the first turn on its contact is believed.
    let heard = closed.iter().filter(|value| **value == 1.0).count();
    assert!(10 * heard > 9 * closed.len(), "{heard} of {}", closed.len());
    let turns = ages_s.windows(2).filter(|pair| pair[1] < pair[0]).count();
    let cycles = run.json()["cycles"].as_u64().unwrap() as usize;
    println!("{} rows, {cycles} cycles, {turns} turns", ages_s.len());
    assert!(turns * 20 > ages_s.len() && turns * 5 < ages_s.len(), "{turns} of {}", ages_s.len());
}

/// A robot with a gripper.
fn with_gripper(name: &str) -> Scratch {
    with(name, "alias = 77\ngroup = \"arm\"\n")
}

#[test]
fn a_hot_connect_group_that_is_not_plugged_in_is_told_and_missed_by_nobody() {
    let Some(namespace) = Namespace::for_test("a_hot_connect_group_that_is_not_there") else { return };
    let (bare, robot) = (repository("robots/bmm.toml"), with_gripper("no_gripper"));
    let (run, simulated) = namespace.run(|| driven(&bare, robot.0.to_str().unwrap(), &[]));
    drove(&run, &simulated);
    assert!(run.said.contains("hot-connect group `arm` isn't plugged in"), "{}", run.said);
}

#[test]
fn a_hot_connect_group_that_is_plugged_in_goes_to_op_with_the_others() {
    let Some(namespace) = Namespace::for_test("a_hot_connect_group_that_is_there") else { return };
    let robot = with_gripper("gripper");
    let robot = robot.0.to_str().unwrap();
    let (run, simulated) = namespace.run(|| driven(robot, robot, &[]));
    drove(&run, &simulated);
    assert!(!run.said.contains("isn't plugged in"), "{}", run.said);
    assert!(events(&simulated.json()).contains(&"SubDevice 3: OP"), "{}", simulated.output);
}
