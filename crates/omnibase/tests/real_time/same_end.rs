//! The same run in virtual time and in real time.

use super::support::{PATIENT, Program, number, repository};
use omnibase_host::Namespace;
use serde_json::Value;

/// How far apart the true ends may be, m.
const SAME_END_M: f64 = 1e-3;

#[test]
fn a_run_over_a_cable_ends_where_the_one_on_virtual_time_does() {
    let Some(namespace) = Namespace::for_test("a_run_over_a_cable_ends_where_the_virtual_one_does") else {
        return;
    };
    let robot = repository("robots/bmm.toml");
    let arguments = [&[robot.as_str(), "--circle", "radius_m=0.3,duration_s=6"][..], &PATIENT].concat();
    let in_virtual = Program::omnibase(&[&["run", "--json"], &arguments[..]].concat()).end().json();
    // The circle ends where it began, in the simulator's origin.
    let expected_m = number(&in_virtual["final_error_m"]["true"]);
    let (run, simulated) = namespace.run(|| {
        let simulator = Program::simulate(&[&robot]);
        let run = Program::run(&arguments).end();
        simulator.signal("INT");
        (run, simulator.end().json())
    });
    assert!(run.status.success(), "{}", run.said);
    let run = run.json();
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
}
