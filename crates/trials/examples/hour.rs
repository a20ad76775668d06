//! Prints what an hour on figures of eight does to estimates, errors and motors.
//!
//! `cargo run --release -p omnibase-trials --example hour [seconds] [laws]`

use omnibase_trials::laws::{CLOSED, asked, is_of_torque};
use omnibase_trials::{Run, Trial, plan_of, robots};
use std::time::Instant;

fn main() {
    let (laws, words) = asked(&CLOSED);
    let seconds: f64 = words.first().map_or(3600.0, |text| text.parse().expect("seconds"));
    let starts = |law: &'static str| -> &[f64] { if is_of_torque(law) { &[0.5, 1.5] } else { &[1.0] } };
    println!(
        "| robot | law | m̂ at start | turn s | ran s | believed RMS mm | max mm | m̂ 60 s, least, most, end (truth) | Ĵ least, most | d̂ most N | hottest motor % | times real time | |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for (robot, text) in [("bmm", robots::BMM), ("mecanum", robots::MECANUM)] {
        for turn_s in [120.0, 30.0, FASTEST] {
            for (law, factor) in
                laws.iter().flat_map(|law| starts(law).iter().map(move |start| (*law, *start)))
            {
                let reference = robots::eight(text, turn_s, seconds);
                let text = robots::loaded(text, law, factor, &reference);
                let mut trial = Trial::new(plan_of(&text));
                trial.enable();
                let began = Instant::now();
                let (mut least, mut most, mut minute) = ([f64::MAX; 3], [f64::MIN; 3], None);
                let mut hottest: f64 = 0.0;
                let machine = trial.machine.clone();
                let run = Run::track(&mut trial, &mut |record| {
                    for axis in 0..3 {
                        least[axis] = least[axis].min(record.estimates()[axis]);
                        most[axis] = most[axis].max(record.estimates()[axis]);
                    }
                    if record.time.now_ns > 60_000_000_000 {
                        minute.get_or_insert(record.estimates()[0]);
                    }
                    if record.time.index % 1000 == 0 {
                        let load = machine
                            .lock()
                            .motors()
                            .iter()
                            .map(|motor| motor.thermal_load())
                            .fold(0.0, f64::max);
                        hottest = hottest.max(load);
                    }
                });
                let ran_s = run.cycles as f64 * 1e-3;
                println!(
                    "| {robot} | {law} | {} % | {turn_s:.0} | {ran_s:.0} | {:.3} | {:.3} | {:.1}, {:.1}, {:.1}, {:.1} ({:.1}) | {:.2}, {:.2} | {:.1} | {:.0} | {:.0} | {} |",
                    factor * 100.0,
                    run.believed_rms_m * 1e3,
                    run.believed_greatest_m * 1e3,
                    minute.unwrap_or(0.0),
                    least[0],
                    most[0],
                    trial.robot.record().estimates()[0],
                    trial.machine.lock().body().mass_kg(),
                    least[1],
                    most[1],
                    most[2],
                    hottest * 100.0,
                    ran_s / began.elapsed().as_secs_f64(),
                    if run.finished { "" } else { trial.robot.record().stop_reason.text() },
                );
            }
        }
    }
}

/// Shorter than any limit allows: the reference takes the time that the limits need.
const FASTEST: f64 = 0.0;
