//! Prints how accurately each control law follows circle and square, by robot.
//!
//! `cargo run --release -p omnibase-trials --example accuracy`

use omnibase_trials::{Run, Trial, plan_of, robots};

fn main() {
    println!(
        "| robot | path | law | m̂ at start | believed RMS mm | believed max mm | true RMS mm | true final mm | final heading mrad | m̂ at end | |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    for (robot, text) in [("bmm", robots::BMM), ("mecanum", robots::MECANUM)] {
        for (path, reference) in [("circle", robots::CIRCLE), ("square", robots::SQUARE)] {
            for (law, factor) in [
                ("open_loop", 1.0),
                ("closed_loop_speed", 1.0),
                ("adaptive_torque", 0.5),
                ("adaptive_torque", 1.5),
            ] {
                let text = robots::loaded(text, law, factor, reference);
                let mut trial = Trial::new(plan_of(&text));
                trial.enable();
                let run = Run::track(&mut trial, &mut |_| {});
                let at_end = trial.robot.record().estimates[0];
                println!(
                    "| {robot} | {path} | {law} | {} % | {:.3} | {:.3} | {:.3} | {:.3} | {:.3} | {at_end:.1} | {} |",
                    factor * 100.0,
                    run.believed_rms_m * 1e3,
                    run.believed_greatest_m * 1e3,
                    run.true_rms_m * 1e3,
                    run.true_final_m * 1e3,
                    run.true_final_heading_rad * 1e3,
                    if run.finished { "" } else { trial.robot.record().stop_reason.text() },
                );
            }
        }
    }
}
