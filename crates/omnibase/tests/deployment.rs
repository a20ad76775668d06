//! A robot's file alone brings up what it says, and options have the last word.

use std::io::{BufRead, BufReader, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const TOKEN: &str = "a-secret-of-this-test";

/// The file of the shipped robot with more in it, in a folder of the test's own.
fn robot(folder: &Path, more: &str) -> PathBuf {
    let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm.toml");
    let path = folder.join("robot.toml");
    std::fs::write(&path, format!("{}\n{more}\n", std::fs::read_to_string(shipped).unwrap())).unwrap();
    path
}

fn omnibase(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_omnibase"));
    let elsewhere = folder.join("elsewhere");
    std::fs::create_dir_all(&elsewhere).unwrap();
    command
        .args(arguments)
        .current_dir(elsewhere)
        .env("XDG_RUNTIME_DIR", folder)
        .env_remove("OMNIBASE_TOKEN");
    command.stdin(Stdio::null());
    command
}

/// Exit code, and all that is said.
fn said(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let output = omnibase(folder, arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout) + &text(output.stderr))
}

#[test]
fn the_file_alone_brings_up_page_token_paths_and_recording_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let table = "[run]\ndashboard = \"127.0.0.1:0\"\ntoken_file = \"secret\"\npaths = \"taught\"\njoystick = false\n\
                 [recording]\nfile = \"runs/{time}.mcap\"\nevery_ms = 10\nsignals = [\"state.*\"]";
    let robot = robot(folder, table);
    let robot = robot.to_str().unwrap();
    let mut secret = std::fs::OpenOptions::new();
    let mut secret =
        secret.write(true).create(true).truncate(true).mode(0o600).open(folder.join("secret")).unwrap();
    secret.write_all(TOKEN.as_bytes()).unwrap();
    let mut process = omnibase(folder, &["run", robot, "--json"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(process.stderr.take().unwrap()).lines().map_while(Result::ok);
    let page =
        lines.by_ref().find(|line| line.starts_with("dashboard: ")).expect("it says where its page is");
    assert!(page.ends_with(&format!("?token={TOKEN}")), "{page}");
    let (code, phase) = said(folder, &["get", "phase"]);
    assert!(code == Some(0) && phase.contains("disabled"), "{phase}");
    for call in [&["call", "teach"][..], &["call", "emergency_stop"]] {
        said(folder, call);
    }
    let number = rustix::process::Pid::from_child(&process);
    rustix::process::kill_process(number, rustix::process::Signal::INT).unwrap();
    assert!(process.wait().unwrap().success());
    let runs: Vec<_> = std::fs::read_dir(folder.join("runs")).unwrap().collect();
    assert_eq!(runs.len(), 1);
    // Options have the last word: nobody leads it, so it follows the circle and ends.
    let circle = ["--circle", "radius_m=0.2,duration_s=5"];
    let (code, text) =
        said(folder, &[&["run", robot, "--no-dashboard", "--no-recording"], &circle[..]].concat());
    assert!(code == Some(0) && !text.contains("dashboard: "), "{text}");
    let (code, text) = said(folder, &["run", robot, "--no-dashboard"]);
    assert!(code == Some(1) && text.contains("nothing to follow"), "{text}");
}

#[test]
fn an_interface_in_the_file_is_said_aloud_and_left_alone_where_somebody_simulates() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let robot = robot(folder, "[run]\ninterface = \"no-such-nic\"\nrealtime = true\ncpu = 0");
    let robot = robot.to_str().unwrap();
    let run = ["run", robot, "--circle", "radius_m=0.2,duration_s=5"];
    let (code, text) = said(folder, &run);
    assert!(code == Some(1) && text.contains("the real robot, at no-such-nic as [run]"), "{text}");
    assert!(text.contains("error: ") && text.contains("--simulated leaves it alone"), "{text}");
    let (code, text) = said(folder, &[&run[..], &["--simulated"]].concat());
    assert!(code == Some(0) && !text.contains("real robot"), "{text}");
    // Whoever gives a payload to the simulated robot means that one.
    let payload = ["--payload-kg", "10"];
    let (code, text) = said(folder, &[&run[..], &payload].concat());
    assert!(
        code == Some(2) && text.contains("--payload-kg, --events-file and `simulation` are of the simulated"),
        "{text}"
    );
    let floor = ["--set", "simulation.static_friction=0.3"];
    let (code, text) = said(folder, &[&run[..], &floor].concat());
    assert!(
        code == Some(2) && text.contains("--payload-kg, --events-file and `simulation` are of the simulated"),
        "{text}"
    );
    let (code, text) = said(folder, &[&run[..], &payload, &["--simulated"]].concat());
    assert_eq!(code, Some(0), "{text}");
    let (code, text) = said(folder, &[&run[..], &["--simulated", "--realtime"]].concat());
    assert!(code == Some(2) && text.contains("--realtime and --cpu are for --interface"), "{text}");
    let (_, text) = said(folder, &["check", robot]);
    assert!(text.contains("THE REAL ONES, at no-such-nic") && text.contains("asked for, on CPU 0"), "{text}");
}

#[test]
fn what_is_wrong_in_the_table_is_said_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    for (table, expected) in [
        ("interfaces = \"eth0\"", "run.interfaces: no setting has this name; did you mean `interface`?"),
        ("interface = \"\"", "run.interface = \"\": there is nothing of this name"),
        ("redundant = \"eth1\"", "run.redundant: it is for drives at an interface, and none is given"),
        ("interface = \"eth1\"\nredundant = \"eth1\"", "run.redundant = \"eth1\": a ring has two ends"),
        ("cpu = 3", "run.cpu: it is for drives at an interface"),
        (
            "dashboard = \"8400\"",
            "run.dashboard = \"8400\": this is no address (allowed: true, false, or an address",
        ),
        ("dashboard = 8400", "run.dashboard = 8400: the value has another type than boolean or string"),
        ("token_file = \"secret\"", "run.token_file: nobody asks for a token where no page is served"),
        ("joystick = \"\"", "run.joystick = \"\": there is nothing of this name"),
    ] {
        let robot = robot(folder.path(), &format!("[run]\n{table}"));
        let (code, text) = said(folder.path(), &["check", robot.to_str().unwrap()]);
        assert!(code == Some(1) && text.contains(expected), "{table}: {text}");
        assert!(text.contains("robot.toml:5"), "without a place: {text}");
    }
}
