//! A drive of the simulator's process loses its supply while the robot runs in another, and comes back.

use crate::support::{PATIENT, Program, events, number, repository};
use omnibase_host::Namespace;
use serde_json::Value;

/// The promise: in OP with SYNC0 so long after it answers again, s.
const BACK_WITHIN_S: f64 = 3.0;
/// The others' SYNC0 and its own have their places when the clocks agree to so many ns.
const LOCKED_NS: f64 = 1000.0;
/// Runs until one is seen that the machine didn't disturb.
const ATTEMPTS: u32 = 5;

/// What the run and the simulator saw of one power cycle of the last drive in the line; the run's exit code first.
fn power_cycled(after_lost_device: &str) -> (Option<i32>, Value, Value) {
    let robot = repository("robots/bmm.toml");
    let policy = format!("safety.after_lost_device=\"{after_lost_device}\"");
    let mut simulator = Program::simulate(&[&robot, "--fault", "power-cycle@2:6:0.5"]);
    let more = [
        // Drives that run in another process answer when this machine gets round to it.
        &["--set", "bus.receive_timeout_us=3800", "--set", &policy, "--circle", "radius=0.3,period=12"][..],
        &PATIENT,
    ];
    let run = Program::run(&[&[robot.as_str()][..], &more.concat()].concat());
    simulator.wait_for("fault: power-cycle@2");
    let run = run.end();
    let report = run.json();
    simulator.signal("INT");
    (run.status.code(), report, simulator.end().json())
}

/// Whether this machine kept the cycle: what it disturbed shows nothing of the bus.
fn is_undisturbed(report: &Value) -> bool {
    number(&report["lost_frames"]) == 0.0 && number(&report["overruns"]) == 0.0
}

/// The way back as the simulator saw it: in how many s, for a drive that lost its supply once.
fn way_back(simulated: &Value) -> Option<f64> {
    let arrivals = simulated["arrivals"].as_array().unwrap();
    let own: Vec<&Value> = arrivals.iter().filter(|one| one["subdevice"] == 2).collect();
    let [_, back] = own[..] else { return None };
    assert_eq!(number(&back["sync0_us"]), 4000.0, "{back}");
    assert!(number(&back["clock_ns"]) < LOCKED_NS, "{back}");
    Some(number(&back["after_power_s"]))
}

#[test]
fn a_power_cycled_drive_comes_back_into_the_run_while_the_others_stay_in_op() {
    const TEST: &str = "a_power_cycled_drive_comes_back_into_the_run";
    let Some(namespace) = Namespace::for_test(TEST) else { return };
    for (policy, code, tracking) in [("resume", 0, 2), ("stay", 1, 1)] {
        let seen = (1..=ATTEMPTS).find_map(|attempt| {
            let (ended, report, simulated) = namespace.run(|| power_cycled(policy));
            let back_s = way_back(&simulated);
            let (lost, left_out) = (&report["lost_frames"], &report["overruns"]);
            eprintln!(
                "{policy}, attempt {attempt}: back in OP {back_s:?} s after it has power again; the host lost \
                 {lost} frames and left out {left_out} cycles"
            );
            is_undisturbed(&report).then_some((ended, report, simulated, back_s))
        });
        let Some((ended, report, simulated, back_s)) = seen else {
            eprintln!("SKIPPED: {TEST}: this machine kept the cycle in none of {ATTEMPTS} attempts");
            return;
        };
        let words = events(&report);
        let told = |text: &str| words.iter().filter(|event| event.contains(text)).count();
        assert_eq!(told("`wheel_3` (SubDevice 2): lost: it does not answer"), 1, "{words:?}");
        let others = events(&simulated);
        for position in ["SubDevice 0: ", "SubDevice 1: "] {
            let states: Vec<&str> = others.iter().filter_map(|text| text.strip_prefix(position)).collect();
            assert_eq!(
                states,
                ["PRE-OP", "SAFE-OP", "OP", "PRE-OP", "INIT"],
                "from start to end: {others:?}"
            );
        }
        assert_eq!(report["bus"]["losses"], 1, "{report}");
        if policy == "resume" {
            let back_s = back_s.unwrap_or_else(|| panic!("not back: {simulated}"));
            assert!(back_s < BACK_WITHIN_S, "{back_s} s");
            assert_eq!(told("`wheel_3` (SubDevice 2): back in OP"), 1, "{words:?}");
        }
        // Where it stays nobody is there to enable it, and the run ends with safe outputs.
        assert_eq!((ended, told("tracking the reference")), (Some(code), tracking), "{words:?}");
    }
}
