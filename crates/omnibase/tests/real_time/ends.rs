//! Ctrl-C, SIGTERM, a second signal, and a disk that is full.

use super::support::{ENDLESS, PATIENT, Program, Scratch, events, left_op_in_order, number, repository};
use omnibase_host::Namespace;
use std::process::Command;

/// How many cycles of a recording are computed again to the same bits.
fn replayed(recording: &Scratch) -> u64 {
    let replay = Program::omnibase(&["replay", recording.path(), "--partial", "--json"]).end();
    let found = replay.json();
    assert_eq!(found["same"], true, "{found}");
    found["cycles"].as_u64().unwrap()
}

/// Whether SIGHUP, the first of the signals, is ignored here and so in every program that is started from here.
fn hangups_are_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).unwrap().trim();
    u64::from_str_radix(ignored, 16).unwrap() & 1 == 1
}

#[test]
fn a_signal_ramps_down_disables_the_drives_and_closes_the_files() {
    let Some(namespace) = Namespace::for_test("a_signal_ramps_down") else { return };
    namespace.run(|| {
        let robot = repository("robots/bmm.toml");
        for signal in ["INT", "QUIT", "TERM", "HUP"] {
            if signal == "HUP" && hangups_are_ignored() {
                println!(
                    "SKIPPED: HUP, which whoever started the tests ignores (nohup), and so does the robot"
                );
                continue;
            }
            let recording = Scratch::new(&format!("{signal}.mcap"));
            let mut simulator = Program::simulate(&[&robot]);
            let arguments =
                [&[robot.as_str(), "--circle", ENDLESS, "--record", recording.path()][..], &PATIENT];
            let run = Program::run(&arguments.concat());
            simulator.wait_for("the robot moves");
            run.signal(signal);
            let run = run.end();
            simulator.signal("INT");
            let (report, simulated) = (run.json(), simulator.end().json());
            assert_eq!(run.status.code(), Some(1), "the reference was not followed to its end");
            assert!(run.said.contains("stopping: the robot ramps down"), "{}", run.said);
            let words = events(&report);
            let at = |text: &str| {
                words.iter().position(|event| *event == text).unwrap_or_else(|| panic!("{text}: {words:?}"))
            };
            let order = [at("a stop was asked for"), at("ramping down"), at("drives disabled")];
            assert!(order.is_sorted(), "{words:?}");
            assert!(left_op_in_order(&simulated), "{signal}: {simulated}");
            assert!(events(&simulated).contains(&"the robot stands"), "{simulated}");
            assert_eq!(simulated["standstills"].as_array().unwrap().len(), 0, "{simulated}");
            // Every cycle is in the recording, to the last.
            assert_eq!(report["records_dropped"], 0);
            assert_eq!(report["records_written"], report["cycles"]);
            assert_eq!(replayed(&recording), report["cycles"].as_u64().unwrap());
        }
    });
}

#[test]
fn a_second_signal_ends_at_once_and_the_drives_stop_by_themselves() {
    let Some(namespace) = Namespace::for_test("a_second_signal_ends_at_once") else { return };
    namespace.run(|| {
        let robot = repository("robots/bmm.toml");
        let mut simulator = Program::simulate(&[&robot]);
        // A ramp of a second and more: the second signal comes in the midst of it.
        let slow = ["--set", "limits.acceleration_m_s2=0.04", "--circle", "radius_m=0.5"];
        let mut run = Program::run(&[&[robot.as_str()][..], &slow, &PATIENT].concat());
        simulator.wait_for("the robot moves");
        run.signal("INT");
        run.wait_for("another Ctrl-C ends at once");
        run.signal("TERM");
        let run = run.end();
        assert_eq!(run.status.code(), Some(128 + 15), "{run:?}");
        assert_eq!(run.output, "", "no summary");
        simulator.wait_for("the robot stands");
        simulator.signal("INT");
        let simulated = simulator.end().json();
        assert_eq!(simulated["watchdogs"].as_array().unwrap().len(), 3, "{simulated}");
        assert_eq!(simulated["standstills"].as_array().unwrap().len(), 1, "{simulated}");
    });
}

#[test]
fn a_full_disk_ends_the_recording_and_nothing_else() {
    let (robot, recording) = (repository("robots/bmm.toml"), Scratch::new("full.mcap"));
    // Files of 2 MiB at most (4096 blocks of 512 bytes): some seconds of the run.
    let mut command = Command::new("sh");
    command.args(["-c", "ulimit -f 4096; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_omnibase"), "run", &robot]);
    command.args(["--path", &repository("robots/square.dat"), "--json", "--record", recording.path()]);
    let run = Program::start(command).end();
    let report = run.json();
    assert_eq!(run.status.code(), Some(1), "{}", run.said);
    assert!(run.said.contains("error: the recording ended early: "), "{}", run.said);
    assert!(run.said.contains("File too large"), "{}", run.said);
    // The run itself went to its end.
    assert!(number(&report["final_error_m"]["true"]) < 1e-3, "{report}");
    let (cycles, written) = (report["cycles"].as_u64().unwrap(), report["records_written"].as_u64().unwrap());
    let dropped = report["records_dropped"].as_u64().unwrap();
    assert!(written > 0 && dropped > 0, "{written} written, {dropped} dropped");
    let words = events(&report);
    assert!(words.iter().any(|text| text.starts_with("the recording ended early")), "{words:?}");
    assert!(written + dropped >= cycles, "{written} written and {dropped} dropped of {cycles} cycles");
    assert_eq!(replayed(&recording), written);
}

#[test]
fn a_recording_that_cannot_begin_is_refused_before_any_drive_is_touched() {
    let robot = repository("robots/bmm.toml");
    let run =
        Program::omnibase(&["run", &robot, "--circle", "radius_m=0.3,duration_s=6", "--record", "/dev/full"])
            .end();
    assert_eq!(run.status.code(), Some(1));
    assert!(run.said.contains("error: starting the recording: /dev/full: "), "{}", run.said);
    assert_eq!(run.output, "");
}
