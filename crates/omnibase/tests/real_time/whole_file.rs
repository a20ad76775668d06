//! A robot's file alone: interface, page, joystick and recording come up as it says, with no option given.

use super::support::{Program, events, repository};
use crate::joystick_recording::recording;
use omnibase_host::Namespace;
use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

/// Buttons of the recorded joystick: held while driving, and taken before.
const TRIGGER: u16 = 0x120;
const ENABLE: u16 = 0x12B;
const ABS_Y: u16 = 1;
/// Time from row to row, s.
const EVERY_S: f64 = 0.02;
const TOKEN: &str = "the-secret-of-the-file";

/// The shipped robot with its whole deployment, and with patience for a busy machine.
fn robot(folder: &Path) -> String {
    let mut text = fs::read_to_string(repository("robots/bmm.toml")).unwrap();
    for (shipped, patient) in [
        ("cycle_us = 1000", "cycle_us = 4000\nreceive_timeout_us = 3800"),
        ("synchronisation = \"sync0\"", "synchronisation = \"sync_manager_event\""),
    ] {
        assert!(text.contains(shipped));
        text = text.replace(shipped, patient);
    }
    text += "[safety]\nlost_exchanges_tolerated = 250\ndrive_watchdog_us = 1_500_000\n";
    let near = Namespace::NEAR;
    text += &format!(
        "[run]\ninterface = \"{near}\"\nrealtime = true\ncpu = 0\ndashboard = \"127.0.0.1:0\"\n\
         token_file = \"secret\"\npaths = \"taught\"\njoystick = \"joystick.events\"\n\
         [recording]\nfile = \"runs/{{time}}.mcap\"\nsignals = [\"state.pose_x_m\", \"wheel_*.speed_rad_s\"]\n\
         every_ms = 20\nlimit_mb = 1\nfiles = 3\n"
    );
    let path = folder.join("robot.toml");
    fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

/// What the page answers to whoever shows the file's token.
fn page(address: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    write!(stream, "GET / HTTP/1.0\r\nHost: {address}\r\nAuthorization: Bearer {TOKEN}\r\n\r\n").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}

#[test]
fn the_file_alone_brings_up_interface_page_joystick_and_recording() {
    let Some(namespace) = Namespace::for_test("the_file_alone") else { return };
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let robot = robot(folder);
    fs::write(folder.join("secret"), TOKEN).unwrap();
    fs::set_permissions(folder.join("secret"), fs::Permissions::from_mode(0o600)).unwrap();
    // Grasped again and again: drives come up when the machine lets them.
    let grasps = (0..100).flat_map(|n| [(1500 + 400 * n, TRIGGER, 1), (1800 + 400 * n, TRIGGER, 0)]);
    let enabled = [(100, ENABLE, 1), (200, ENABLE, 0), (1000, ABS_Y, 64)];
    recording(folder, &enabled.into_iter().chain(grasps).collect::<Vec<_>>());
    let (ran, simulated) = namespace.run(|| {
        let simulator = Program::simulate(&[&robot]);
        let mut command = Command::new(env!("CARGO_BIN_EXE_omnibase"));
        command.args(["run", &robot, "--json"]).env("XDG_RUNTIME_DIR", folder).env_remove("OMNIBASE_TOKEN");
        let mut run = Program::start(command);
        run.wait_for("dashboard: http://");
        let said = run.said.last().unwrap().clone();
        assert!(said.ends_with(&format!("?token={TOKEN}")), "{said}");
        let address = said.trim_start_matches("dashboard: http://").split('/').next().unwrap();
        let answer = page(address);
        assert!(answer.starts_with("HTTP/1.0 200") && answer.contains("<!DOCTYPE html>"), "{answer}");
        run.wait_for("drives by hand");
        std::thread::sleep(Duration::from_secs(3));
        run.signal("INT");
        let ran = run.end();
        simulator.signal("INT");
        (ran, simulator.end())
    });
    assert!(ran.status.success(), "{}", ran.said);
    for told in [
        format!("the real robot, at {} as [run] in", Namespace::NEAR),
        "hold BTN_TRIGGER to drive".to_owned(),
        "SCHED_FIFO".to_owned(),
    ] {
        assert!(ran.said.contains(&told), "{told}: {}", ran.said);
    }
    let report = ran.json();
    assert!(events(&report).iter().any(|text| text.contains("drives by hand")), "{:?}", events(&report));
    assert!(events(&simulated.json()).contains(&"the robot moves"), "{}", simulated.said);
    let runs: Vec<_> =
        fs::read_dir(folder.join("runs")).unwrap().map(|entry| entry.unwrap().path()).collect();
    let [recorded] = &runs[..] else { panic!("{runs:?}") };
    assert!(recorded.to_str().unwrap().ends_with("Z-00001.mcap"), "{recorded:?}");
    let table = folder.join("run.csv");
    let mut export = Command::new(env!("CARGO_BIN_EXE_omnibase"));
    export.arg("export").arg(recorded).arg("--output").arg(&table);
    let exported = Program::start(export).end();
    assert!(exported.status.success(), "{}", exported.said);
    let table = fs::read_to_string(table).unwrap();
    let (names, rows) = table.split_once("\r\n").unwrap();
    assert_eq!(names, "time_s,state.pose_x_m,wheel_1.speed_rad_s,wheel_2.speed_rad_s,wheel_3.speed_rad_s");
    let steps: Vec<f64> = rows.lines().map(|row| (time_s(row) / EVERY_S + 1e-6).floor()).collect();
    println!("{} rows, {:.2} s; {}", steps.len(), steps.len() as f64 * EVERY_S, ran.said);
    // One row a step, whatever cycles the machine left out.
    assert!(steps.len() > 100 && steps.is_sorted_by(|one, next| one < next), "{} rows", steps.len());
}

/// The time of a row.
fn time_s(row: &str) -> f64 {
    row.split(',').next().unwrap().parse().unwrap()
}
