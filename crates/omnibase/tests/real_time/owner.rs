//! A run that follows its plan, without a page: its own user sees it, changes it and stops it, by a socket of that user alone.

use super::support::{ENDLESS, PATIENT, Program, events, repository};
use omnibase_host::Namespace;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::process::Command;

/// Exit code, and all that is said.
fn said(runtime: &std::path::Path, arguments: &[&str]) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_omnibase"));
    let output = command.args(arguments).env("XDG_RUNTIME_DIR", runtime).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout) + &text(output.stderr))
}

/// The sockets in the runtime folder.
fn sockets(runtime: &std::path::Path) -> Vec<std::fs::Metadata> {
    let entries = std::fs::read_dir(runtime.join("omnibase")).unwrap();
    let all = entries.map(|entry| entry.unwrap().metadata().unwrap());
    all.filter(|found| found.file_type().is_socket()).collect()
}

#[test]
fn a_planned_run_is_seen_changed_and_stopped_by_its_own_user_and_led_by_nobody() {
    let Some(namespace) = Namespace::for_test("a_planned_run_is_seen") else { return };
    namespace.run(|| {
        let runtime = tempfile::tempdir().unwrap();
        let runtime = runtime.path();
        let robot = repository("robots/bmm.toml");
        for stop in [&["call", "stop", "category=category_1"][..], &["call", "emergency_stop"]] {
            let mut simulator = Program::simulate(&[&robot]);
            let mut command = Command::new(env!("CARGO_BIN_EXE_omnibase"));
            command.args(["run", &robot, "--circle", ENDLESS, "--json", "--interface"]);
            command.arg(Namespace::NEAR).args(PATIENT).env("XDG_RUNTIME_DIR", runtime);
            let run = Program::start(command);
            simulator.wait_for("the robot moves");
            let found = sockets(runtime);
            assert_eq!(found.iter().map(|socket| socket.mode() & 0o7777).collect::<Vec<_>>(), [0o600]);
            let (code, text) = said(runtime, &["get", "phase", "state/pose_x_m"]);
            assert!(code == Some(0) && text.contains("tracking"), "{text}");
            let (code, text) = said(runtime, &["set", "speed_factor=0.5"]);
            assert_eq!(code, Some(0), "{text}");
            let (_, text) = said(runtime, &["get", "settings/speed_factor"]);
            assert!(text.contains("0.5"), "{text}");
            let (code, text) = said(runtime, &["top", "--once"]);
            assert!(code == Some(0) && text.contains("bmm"), "{text}");
            // Who would write into its devices gets no hand on its interface.
            let file = runtime.join("none.toml");
            for write in [
                &["foe", "write", Namespace::NEAR, "1", &robot][..],
                &["eeprom", "alias", Namespace::NEAR, "1", "7"],
                &["setup", Namespace::NEAR, "--robot", &robot, "-o", file.to_str().unwrap()],
            ] {
                let (code, text) = said(runtime, write);
                assert!(code == Some(1) && text.contains("is in use by process"), "{write:?}: {text}");
            }
            // Nobody leads it but its plan.
            for call in [&["call", "enable"][..], &["call", "pause"], &["call", "go_to", "pose=[1,0,0]"]] {
                let (code, text) = said(runtime, call);
                assert!(code == Some(1) && text.contains("this run follows its plan"), "{call:?}: {text}");
            }
            let (code, text) = said(runtime, stop);
            assert_eq!(code, Some(0), "{text}");
            // Nobody could go on with it: it ends, and nothing is left of it.
            let run = run.end();
            simulator.signal("INT");
            let simulated = simulator.end().json();
            assert_eq!(run.status.code(), Some(1), "{}", run.said);
            assert!(run.said.contains("a stop was asked for"), "{}", run.said);
            let report = run.json();
            let words = events(&report);
            assert!(words.contains(&"ramping down") && words.contains(&"drives disabled"), "{words:?}");
            assert!(events(&simulated).contains(&"the robot stands"), "{simulated}");
            assert!(sockets(runtime).is_empty());
            let (code, text) = said(runtime, &["get"]);
            assert!(
                code == Some(1) && text.contains("no robot runs on this machine under this user"),
                "{text}"
            );
        }
    });
}

#[test]
fn a_planned_run_ends_by_itself_as_ever() {
    let Some(namespace) = Namespace::for_test("a_planned_run_ends_by_itself") else { return };
    namespace.run(|| {
        let robot = repository("robots/bmm.toml");
        let simulator = Program::simulate(&[&robot]);
        let run = Program::run(
            &[&[robot.as_str(), "--circle", "radius_m=0.2,duration_s=5"][..], &PATIENT].concat(),
        );
        let run = run.end();
        simulator.signal("INT");
        simulator.end();
        assert_eq!(run.status.code(), Some(0), "{}", run.said);
    });
}
