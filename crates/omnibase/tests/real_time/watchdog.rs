//! The program is killed: the drives stop by themselves.

use crate::support::{PATIENT, Program, events, number, repository};
use omnibase_host::Namespace;
use serde_json::Value;

/// The watchdog's time in these runs, us: longer than the pauses of a busy host, and not the default.
const WATCHDOG_US: u32 = 150_000;
/// The chip counts steps of 40 ns.
const COUNTING_MS: f64 = 0.001;

/// Kills the program while the robot moves, and waits until it stands; what the simulator saw.
fn kill(robot: &str, more: &[&str]) -> Value {
    let mut simulator = Program::simulate(&[robot]);
    let watchdog = format!("safety.drive_watchdog_us={WATCHDOG_US}");
    let arguments = [robot, "--circle", "radius=0.5,period=12", "--set", &watchdog];
    let run = Program::run(&[&arguments[..], &PATIENT, more].concat());
    simulator.wait_for("the robot moves");
    run.signal("KILL");
    assert_eq!(run.end().status.code(), None, "killed");
    simulator.wait_for("the robot stands");
    simulator.signal("INT");
    simulator.end().json()
}

#[test]
fn killed_the_program_leaves_drives_that_stop_within_their_watchdogs_time() {
    let Some(namespace) = Namespace::for_test("killed_the_program_leaves_drives_that_stop") else { return };
    // With SYNC0 the drives' own supervision of the cycle comes first; by SyncManager events there is the watchdog alone.
    let event = ["--set", "bus.synchronisation=sync_manager_event"];
    for (file, drives, more) in
        [("robots/bmm.toml", 3, &[][..]), ("robots/mecanum.toml", 4, &[]), ("robots/mecanum.toml", 4, &event)]
    {
        let simulated = namespace.run(|| kill(&repository(file), more));
        let watchdogs = simulated["watchdogs"].as_array().unwrap();
        assert_eq!(watchdogs.len(), drives, "{file} {more:?}: {simulated}");
        let mut last_outputs_s = f64::INFINITY;
        for one in watchdogs {
            assert_eq!(number(&one["set_ms"]), f64::from(WATCHDOG_US) / 1000.0, "as the robot's file says");
            assert!(number(&one["after_ms"]) <= number(&one["set_ms"]) + COUNTING_MS, "{one}");
            last_outputs_s = last_outputs_s.min(number(&one["last_outputs_s"]));
        }
        let stop = &simulated["standstills"][0];
        let left_op_ms = 1e3 * (number(&stop["left_op_s"]) - last_outputs_s);
        assert!(left_op_ms <= f64::from(WATCHDOG_US) / 1000.0 + COUNTING_MS, "{left_op_ms} ms: {simulated}");
        assert!(number(&stop["speed_m_s"]) > 0.01, "it moved: {stop}");
        let words = events(&simulated);
        let by = if more.is_empty() { "0x001a synchronization error" } else { "0x001b SyncManager watchdog" };
        let fell = words.iter().filter(|text| text.ends_with(&format!("SAFE-OP with error {by}"))).count();
        assert_eq!(fell, drives, "{words:?}");
        eprintln!(
            "{file} {more:?}: the drives left OP {left_op_ms:.3} ms after the last outputs, at {:.3} m/s; \
             the robot stood {:.1} ms and {:.1} mm later",
            number(&stop["speed_m_s"]),
            number(&stop["after_ms"]),
            1e3 * number(&stop["distance_m"])
        );
    }
}
