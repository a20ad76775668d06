//! The program is killed: the drives stop by themselves.

use super::support::{ATTEMPTS, PATIENT, Program, WITH_SYNC0, events, is_late, number, repository};
use omnibase_host::Namespace;
use serde_json::Value;

/// The chip counts steps of 40 ns.
const COUNTING_MS: f64 = 0.001;

/// Kills the program while the robot moves, and waits until it stands; what the simulator saw. `None` where this
/// machine kept one of both from its time.
fn kill(robot: &str, watchdog_us: u32, more: &[&str]) -> Option<Value> {
    let mut simulator = Program::simulate(&[robot]);
    let watchdog = format!("safety.drive_watchdog_us={watchdog_us}");
    let arguments = [robot, "--circle", "radius_m=0.5,duration_s=12", "--set", &watchdog];
    let mut run = Program::run(&[more, &arguments].concat());
    let moved = simulator.wait_for_while_runs("the robot moves", &mut run);
    let is_disturbed = !moved || simulator.said.iter().any(|line| line.contains("error"));
    run.signal("KILL");
    let run = run.end();
    if !is_disturbed {
        assert_eq!(run.status.code(), None, "killed");
        simulator.wait_for("the robot stands");
    }
    simulator.signal("INT");
    let simulated = simulator.end().json();
    assert!(!is_disturbed || is_late(&simulated) || !moved, "the drives fell out of OP: {simulated}");
    (!is_disturbed).then_some(simulated)
}

#[test]
fn killed_the_program_leaves_drives_that_stop_within_their_watchdogs_time() {
    const TEST: &str = "killed_the_program_leaves_drives_that_stop";
    let Some(namespace) = Namespace::for_test(TEST) else { return };
    // With SYNC0 the drives' own supervision of the cycle comes first; by SyncManager events there is the watchdog alone.
    let (bmm, mecanum) = ("robots/bmm.toml", "robots/mecanum.toml");
    for (file, drives, watchdog_us, more, by) in [
        (bmm, 3, 150_000, &WITH_SYNC0[..], "0x001a synchronization error"),
        (mecanum, 4, 1_500_000, &PATIENT, "0x001b SyncManager watchdog"),
    ] {
        let mut attempts =
            (0..ATTEMPTS).map(|_| namespace.run(|| kill(&repository(file), watchdog_us, more)));
        let Some(simulated) = attempts.find_map(|simulated| simulated) else {
            eprintln!("SKIPPED: {TEST}, {file}: this machine kept its time in none of {ATTEMPTS} attempts");
            continue;
        };
        let watchdogs = simulated["watchdogs"].as_array().unwrap();
        assert_eq!(watchdogs.len(), drives, "{file}: {simulated}");
        let mut last_outputs_s = f64::INFINITY;
        for one in watchdogs {
            assert_eq!(number(&one["set_ms"]), f64::from(watchdog_us) / 1000.0, "as the robot's file says");
            assert!(number(&one["after_ms"]) <= number(&one["set_ms"]) + COUNTING_MS, "{one}");
            last_outputs_s = last_outputs_s.min(number(&one["last_outputs_s"]));
        }
        let stop = &simulated["standstills"][0];
        let left_op_ms = 1e3 * (number(&stop["left_op_s"]) - last_outputs_s);
        assert!(left_op_ms <= f64::from(watchdog_us) / 1000.0 + COUNTING_MS, "{left_op_ms} ms: {simulated}");
        assert!(number(&stop["speed_m_s"]) > 0.01, "it moved: {stop}");
        let words = events(&simulated);
        let fell = words.iter().filter(|text| text.ends_with(&format!("SAFE-OP with error {by}"))).count();
        assert_eq!(fell, drives, "{words:?}");
        eprintln!(
            "{file}: the drives left OP {left_op_ms:.3} ms after the last outputs, at {:.3} m/s; \
             the robot stood {:.1} ms and {:.1} mm later",
            number(&stop["speed_m_s"]),
            number(&stop["after_ms"]),
            1e3 * number(&stop["distance_m"])
        );
    }
}
