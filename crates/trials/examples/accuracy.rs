//! Prints the table of `docs/accuracy.md`: how accurately each control law follows circle, square and eight, by robot.
//!
//! `cargo run --release -p omnibase-trials --example accuracy`

use omnibase_trials::framed::cases;

fn main() {
    println!(
        "| robot | path | law | treads | creep | m̂ at start | m̂ at end | believed RMS mm | true RMS mm | true final mm | keeps |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    for case in cases() {
        println!("{}", case.row(&case.run()));
    }
}
