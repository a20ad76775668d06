//! The same run in virtual time and in real time.

use crate::support::{PATIENT, Program, number, repository};
use omnibase_host::Namespace;
use serde_json::Value;

/// How far apart the true ends may be, m.
const SAME_END_M: f64 = 1e-3;
/// A host that pauses the MainDevice for more than five cycles faults the drives, as real ones would be.
const ATTEMPTS: usize = 3;

#[test]
fn a_run_over_a_cable_ends_where_the_one_on_virtual_time_does() {
    let Some(namespace) = Namespace::for_test("a_run_over_a_cable_ends_where_the_virtual_one_does") else {
        return;
    };
    let (robot, path) = (repository("robots/bmm.toml"), repository("robots/square.dat"));
    let arguments = [&[robot.as_str(), "--path", &path][..], &PATIENT].concat();
    let in_virtual = Program::omnibase(&[&["run", "--json"], &arguments[..]].concat()).end().json();
    // The square ends where it began, in the simulator's origin.
    let expected_m = number(&in_virtual["final_error_m"]["true"]);
    for attempt in 1..=ATTEMPTS {
        let (run, simulated) = namespace.run(|| over_cable(&robot, &arguments));
        if run["error"].is_null() {
            assert_eq!(run["final_error_m"]["true"], Value::Null, "nobody tells the program the truth");
            let believed_m = number(&run["final_error_m"]["believed"]);
            let pose = &simulated["true_pose"];
            let true_m = number(&pose["x_m"]).hypot(number(&pose["y_m"]));
            eprintln!(
                "final error: virtual {:.4} mm, over the cable {:.4} mm true, {:.4} mm believed; {} of {} exchanges lost",
                1e3 * expected_m,
                1e3 * true_m,
                1e3 * believed_m,
                run["lost_frames"],
                run["cycles"]
            );
            assert!((true_m - expected_m).abs() < SAME_END_M, "{true_m} m, in virtual time {expected_m} m");
            assert!(believed_m < SAME_END_M, "{believed_m} m believed");
            assert_eq!(simulated["standstills"].as_array().map(Vec::len), Some(0), "{simulated}");
            return;
        }
        eprintln!(
            "attempt {attempt}: this host paused a program for longer than the drives bear: {}",
            run["error"]
        );
    }
    panic!("no run of {ATTEMPTS} came to its end");
}

/// The reports of the run and of the simulator.
fn over_cable(robot: &str, arguments: &[&str]) -> (Value, Value) {
    let simulator = Program::simulate(&[robot]);
    let run = Program::run(arguments).end();
    let mut report = run.json();
    if !run.status.success() {
        report["error"] = run.said.clone().into();
    }
    simulator.signal("INT");
    (report, simulator.end().json())
}
