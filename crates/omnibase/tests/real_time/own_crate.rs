//! A crate that `omnibase new` made, outside the workspace: its stages go wherever the program goes.

use super::support::{Ended, PATIENT, Program, number, repository};
use crate::joystick_recording::recording;
use omnibase_host::Namespace;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// Buttons of the recorded joystick: held while driving, and taken before.
const TRIGGER: u16 = 0x120;
const ENABLE: u16 = 0x12B;
const ABS_Y: u16 = 1;

/// The crate, and its program, as long as this process lives.
struct Own {
    folder: PathBuf,
    program: PathBuf,
    _lock: fs::File,
}

/// A fresh crate, its program and its tests: built against the library as the workspace built it, for `cargo build` outside
/// the workspace would compile that library anew for minutes.
fn own_crate() -> Own {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("own-robot");
    // Tests that run beside these, of another process, wait until nobody uses it any more.
    let lock = fs::File::create(folder.with_extension("lock")).unwrap();
    lock.lock().unwrap();
    let _ = fs::remove_dir_all(&folder);
    let made = Program::omnibase(&["new", folder.to_str().unwrap()]).end();
    assert!(made.status.success(), "{}", made.said);
    // The same dependencies as here.
    fs::copy(repository("Cargo.lock"), folder.join("Cargo.lock")).unwrap();
    let run = |program: &str, arguments: &[&str]| {
        let mut command = Command::new(program);
        command.args(arguments).current_dir(&folder);
        let ended = Program::start(command).end();
        assert!(ended.status.success(), "{program} {arguments:?}: {}", ended.said);
        ended.output
    };
    let compiler = run("rustc", &["-vV"]);
    let host = compiler.lines().find_map(|line| line.strip_prefix("host: ")).expect("a host");
    // Of what other systems need nothing was downloaded here.
    let here = ["--offline", "--filter-platform", host];
    let metadata = run("cargo", &[&["metadata", "--format-version", "1"][..], &here].concat());
    let metadata: serde_json::Value = serde_json::from_str(&metadata).unwrap();
    assert_eq!(metadata["workspace_members"].as_array().map(Vec::len), Some(1), "no part of this workspace");
    let built = Path::new(env!("CARGO_BIN_EXE_omnibase")).with_file_name("deps");
    let omnibase = format!("omnibase={}", newest(&built, "libomnibase-").display());
    let dependencies = format!("dependency={}", built.display());
    let flags = ["--edition=2024", "-Copt-level=1", "--extern", &omnibase, "-L", &dependencies];
    run("rustc", &[&flags[..], &["--crate-type=lib", "--crate-name=own_robot", "src/lib.rs"]].concat());
    let with_stages = [&flags[..], &["--extern", "own_robot=libown_robot.rlib"]].concat();
    run(
        "rustc",
        &[
            &with_stages[..],
            &["--crate-name=own_robot", "-Cmetadata=program", "src/main.rs", "-o", "own-robot"],
        ]
        .concat(),
    );
    run("rustc", &[&with_stages[..], &["--test", "tests/robot.rs", "-o", "its-tests"]].concat());
    let program = folder.join("own-robot");
    Own { folder, program, _lock: lock }
}

/// The library of this name that was built last.
fn newest(folder: &Path, name: &str) -> PathBuf {
    let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let is_it = |path: &PathBuf| {
        let file = path.file_name().unwrap().to_string_lossy().into_owned();
        file.starts_with(name) && file.ends_with(".rlib")
    };
    let built = |path: &PathBuf| fs::metadata(path).unwrap().modified().unwrap();
    files.filter(is_it).max_by_key(built).expect("a library beside its program")
}

/// Made once for all tests here.
fn own() -> &'static Own {
    static OWN: OnceLock<Own> = OnceLock::new();
    OWN.get_or_init(own_crate)
}

/// A command of the crate's program, in its folder.
fn command(arguments: &[&str]) -> Command {
    let Own { folder, program, .. } = own();
    let mut command = Command::new(program);
    command.args(arguments).current_dir(folder);
    command
}

fn done(arguments: &[&str]) -> Ended {
    let ended = Program::start(command(arguments)).end();
    assert!(ended.status.success(), "{arguments:?}: {}", ended.said);
    ended
}

#[test]
fn a_crate_of_ones_own_is_checked_recorded_reported_and_replayed() {
    let kinds = done(&["check", "--kinds"]).output;
    assert!(kinds.contains("pi_speed") && kinds.contains("midpoint_odometry"), "{kinds}");
    done(&["run", "robot.toml", "--record", "run.mcap", "--report", "run.html"]);
    let replayed = done(&["replay", "run.mcap"]).output;
    assert!(replayed.contains("the same to the bit"), "{replayed}");
    let page = fs::read_to_string(own().folder.join("run.html")).unwrap();
    assert!(page.contains("pi_speed"), "the report names the law");
    // A controller of one's own is one file of 40 lines and one line of registration.
    let source = |path: &str| fs::read_to_string(own().folder.join(path)).unwrap();
    assert!(source("src/controller.rs").lines().count() <= 40);
    assert_eq!(source("src/lib.rs").matches("registry.controllers.add(").count(), 1);
    // The program without these stages says what it lacks.
    let mut without = Command::new(env!("CARGO_BIN_EXE_omnibase"));
    without.args(["replay", "run.mcap"]).current_dir(&own().folder);
    let refused = Program::start(without).end();
    assert!(!refused.status.success() && refused.said.contains("pi_speed"), "{}", refused.said);
}

#[test]
fn the_tests_of_a_crate_of_ones_own_pass() {
    let folder = &own().folder;
    let mut tests = Command::new(folder.join("its-tests"));
    tests.current_dir(folder);
    let ended = Program::start(tests).end();
    assert!(ended.status.success() && ended.output.contains("1 passed"), "{}", ended.said);
}

#[test]
fn a_crate_of_ones_own_has_its_page_and_answers_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    let in_folder = |arguments: &[&str]| {
        let mut command = command(arguments);
        command.env("XDG_RUNTIME_DIR", folder.path()).env_remove("OMNIBASE_TOKEN");
        Program::start(command)
    };
    let mut robot = in_folder(&["run", "robot.toml", "--dashboard=127.0.0.1:0", "--json"]);
    robot.wait_for("dashboard: http://");
    for law in ["closed_loop_speed", "pi_speed"] {
        let switched = in_folder(&["call", "controller", &format!("name={law}")]).end();
        assert!(switched.status.success(), "{law}: {}", switched.said);
    }
    let none = in_folder(&["call", "controller", "name=nobodys"]).end();
    assert!(!none.status.success() && none.said.contains("nobodys"), "{}", none.said);
    robot.signal("INT");
    assert!(robot.end().status.success());
}

#[test]
fn a_crate_of_ones_own_is_driven_by_a_joystick() {
    let folder = tempfile::tempdir().unwrap();
    // Grasped again and again, for longer than any machine takes: drives come up when it lets them.
    let grasps = (0..300).flat_map(|n| [(1500 + 400 * n, TRIGGER, 1), (1800 + 400 * n, TRIGGER, 0)]);
    let enabled = [(100, ENABLE, 1), (200, ENABLE, 0), (1000, ABS_Y, 64)];
    let stick = recording(folder.path(), &enabled.into_iter().chain(grasps).collect::<Vec<_>>());
    let mut robot =
        Program::start(command(&["run", "robot.toml", "--json", "--joystick", stick.to_str().unwrap()]));
    robot.wait_for("hold BTN_TRIGGER to drive");
    robot.wait_for("drives by hand");
    robot.signal("INT");
    let ended = robot.end();
    let events = ended.json()["events"].to_string();
    assert!(events.contains("drives by hand"), "{events}");
}

#[test]
fn a_crate_of_ones_own_drives_over_a_cable() {
    let Some(namespace) = Namespace::for_test("a_crate_of_ones_own_drives_over_a_cable") else { return };
    let run = namespace.run(|| {
        let simulated = ["simulate", "robot.toml", "--interface", Namespace::FAR, "--realtime", "--json"];
        let mut simulator = Program::start(command(&[&simulated[..], &PATIENT].concat()));
        simulator.wait_for("SCHED_FIFO");
        let fixed = ["run", "robot.toml", "--interface", Namespace::NEAR, "--realtime", "--json"];
        let run = Program::start(command(&[&fixed[..], &PATIENT].concat())).end();
        simulator.signal("INT");
        run
    });
    assert!(run.status.success(), "{}", run.said);
    let believed_m = number(&run.json()["final_error_m"]["believed"]);
    println!("{:.2} mm beside the end of the circle", believed_m * 1e3);
    assert!(believed_m < 0.005, "{believed_m} m beside the end of the circle");
}
