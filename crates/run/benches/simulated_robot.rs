//! How much faster than time the whole simulated robot is. `cargo bench -p omnibase-run`
//!
//! Three SGDV, frames, chips, firmware, inner loops, wheels, floor and body, and the robot's own cycle at 1 kHz, without
//! recording: the 2 m square of the thesis in 20 s. What is printed is time of the robot over time of one core.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use omnibase_ethercat_sim::in_process;
use omnibase_robot::{Registry, Robot};
use omnibase_run::{Progress, RobotText, Setup, run, simulated};

/// What is asked.
const AIM: f64 = 200.0;
const ROUNDS: usize = 9;
const SQUARE: &str = "\n[reference]\nkind = \"path\"\npoints = [[0, 0, 0, 0], [5, 2, 0, 0], [10, 2, 2, 0], \
                      [15, 0, 2, 0], [20, 0, 0, 0]]\n";

fn main() {
    // Under `cargo test --benches` one round shows that it runs.
    let rounds = if std::env::args().any(|argument| argument == "--bench") { ROUNDS } else { 1 };
    let text = format!("{}{SQUARE}", include_str!("../../../robots/bmm.toml"));
    let mut factors: Vec<[f64; 2]> = (0..rounds).map(|_| round(&text)).collect();
    factors.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let [core, wall] = factors[rounds / 2];
    println!(
        "times real time, median of {rounds}: {core:.0} by time of the core, {wall:.0} by the wall's clock (aim {AIM})"
    );
}

/// Time of the robot over time of the core, and over the wall's.
fn round(text: &str) -> [f64; 2] {
    let registry = Registry::with_built_in();
    let robot = RobotText { text: text.to_owned(), ..RobotText::default() }.load(&registry);
    let robot = robot.unwrap_or_else(|problems| panic!("{problems:#?}"));
    let (segment, machine) = simulated::segment(&robot.plan).unwrap_or_else(|error| panic!("{error}"));
    let (link, clock) = in_process(segment);
    let setup = Setup {
        plan: &robot.plan,
        robot: Robot::build(&robot.plan, &registry).unwrap_or_else(|error| panic!("{error}")),
        machine: Some(machine),
        recording: None,
        live: None,
        stop: &AtomicBool::new(false),
        progress: &Progress::default(),
    };
    let (began, began_core_s) = (Instant::now(), core_s());
    let ran = run(link, clock, setup, &mut |_| {}).unwrap_or_else(|error| panic!("{error}"));
    let (took_s, took_core_s) = (began.elapsed().as_secs_f64(), core_s() - began_core_s);
    assert!(ran.finished, "{:?}", ran.ended);
    let robot_s = ran.summary.cycles as f64 * 1e-3;
    [robot_s / took_core_s, robot_s / took_s]
}

/// Time that this thread ran on a core, s: the kernel's own count, which others on the machine don't lengthen.
fn core_s() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux");
    let nanoseconds = text.split_whitespace().next().and_then(|word| word.parse::<f64>().ok());
    nanoseconds.expect("nanoseconds on a core") * 1e-9
}
