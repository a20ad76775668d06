//! How much faster than time the whole simulated robot is. `cargo bench -p omnibase-trials --bench simulated_robot`
//!
//! Three SGDV, frames, chips, firmware, inner loops, wheels, floor and body, and the robot's own cycle at 1 kHz, without
//! recording: the 2 m square of the thesis in 20 s. What is printed is time of the robot over time of one core.

use std::time::Instant;

use omnibase_trials::{core_s, framed, robots};

/// What is asked.
const AIM: f64 = 200.0;
const ROUNDS: usize = 9;

fn main() {
    // Under `cargo test --benches` one round shows that it runs.
    let rounds = if std::env::args().any(|argument| argument == "--bench") { ROUNDS } else { 1 };
    let text = format!("{}{}", robots::BMM, robots::SQUARE);
    let mut factors: Vec<[f64; 2]> = (0..rounds).map(|_| round(&text)).collect();
    factors.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let [core, wall] = factors[rounds / 2];
    println!(
        "times real time, median of {rounds}: {core:.0} by time of the core, {wall:.0} by the wall's clock (aim {AIM})"
    );
}

/// Time of the robot over time of the core, and over the wall's; reading its file is in them.
fn round(text: &str) -> [f64; 2] {
    let (began, began_core_s) = (Instant::now(), core_s());
    let ran = framed::track(text);
    let (took_s, took_core_s) = (began.elapsed().as_secs_f64(), core_s() - began_core_s);
    assert!(ran.finished, "{:?}", ran.ended);
    let robot_s = ran.summary.cycles as f64 * 1e-3;
    [robot_s / took_core_s, robot_s / took_s]
}
