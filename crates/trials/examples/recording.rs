//! What recording costs: a circle of the simulated robot with and without it, by turns.
//!
//! `cargo run --release -p omnibase-trials --example recording -- FILE [SECONDS [ROUNDS]]`: CPU of the whole process for each cycle, user
//! and system time, medians of the rounds (7 of 120 s where nothing is said); and bytes of the file for each cycle.

use std::path::PathBuf;

use omnibase_trials::{framed, robots};

/// Time that all threads of the process ran so far, those that ended among them, s; in steps of the kernel's hundredth.
fn process_s() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").expect("Linux");
    // Behind the name, which may hold anything: user time is the 12th word, system time the 13th.
    let words = text.rsplit_once(')').expect("a name").1.split_whitespace();
    words.skip(11).take(2).map(|ticks| ticks.parse::<f64>().expect("ticks")).sum::<f64>() * 1e-2
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let Some(file) = arguments.next().map(PathBuf::from) else { panic!("expected: FILE [SECONDS [ROUNDS]]") };
    let seconds: f64 = arguments.next().map_or(120.0, |text| text.parse().expect("seconds, a number"));
    let rounds: usize = arguments.next().map_or(7, |text| text.parse().expect("rounds, a number"));
    let turns = 0.1 * seconds;
    let circle = format!(
        "\n[reference]\nkind = \"circle\"\nradius_m = 0.5\nduration_s = {seconds:?}\nturns = {turns:?}\n"
    );
    let text = format!("{}{circle}", robots::BMM);
    let (mut alone, mut recorded, mut bytes) = (Vec::new(), Vec::new(), 0.0);
    for _ in 0..rounds.max(1) {
        let began_s = process_s();
        let ran = framed::track(&text);
        let between_s = process_s();
        let (_, recording) = framed::record(&text, &file);
        let ended_s = process_s();
        let cycles = ran.summary.cycles as f64;
        assert!(recording.failure.is_none() && recording.dropped == 0, "{recording:?}");
        alone.push(1e6 * (between_s - began_s) / cycles);
        recorded.push(1e6 * (ended_s - between_s) / cycles);
        bytes = std::fs::metadata(&file).expect("the recording").len() as f64 / recording.written as f64;
    }
    let [alone, recorded] = [alone, recorded].map(|mut all| {
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    });
    println!(
        "us of CPU a cycle: {alone:.2} alone, {recorded:.2} with a recording, {:.2} more; {bytes:.0} bytes a cycle",
        recorded - alone
    );
}
