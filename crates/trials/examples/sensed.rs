//! How far robots with sensors truly are from where they should be, floor by floor and path by path.
//!
//! `cargo run --release -p omnibase-trials --example sensed [-- <robots> [<sensors>]]`: 5 robots by default, built with the tolerances
//! of their file, with each set of sensors or with that one alone. The table is that of `docs/accuracy.md`; a row stands as soon as
//! those before it do.

use omnibase_trials::rows;
use omnibase_trials::sensed::{Case, FLOORS, PATHS, SETS, Sensed, drive};

fn main() {
    let mut words = std::env::args().skip(1);
    let robots = words.next().map_or(5, |text| text.parse().expect("how many robots"));
    let asked = words.next();
    println!("{robots} robots; true distance from the wished place, RMS and of the worst robot\n");
    println!(
        "| sensors | floor, load | path | driving mm | at rest mm | true from believed mm | heading at the end mrad |"
    );
    println!("|---|---|---|---|---|---|---|");
    let is_asked = |case: &Case| asked.as_ref().is_none_or(|asked| *asked == SETS[case.set]);
    let cases: Vec<Case> = Case::all().filter(is_asked).collect();
    rows::print_in_order(&cases, |case| {
        let driven: Vec<Sensed> = (1..=robots).map(|seed| drive(case, seed)).collect();
        row(case, &driven)
    });
}

fn row(case: &Case, driven: &[Sensed]) -> String {
    let cell = |value: &dyn Fn(&Sensed) -> f64| {
        let values: Vec<f64> = driven.iter().map(|one| 1e3 * value(one).abs()).collect();
        let rms = (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt();
        format!("{rms:.2} ({:.2})", values.iter().copied().fold(0.0, f64::max))
    };
    let stopped = driven.iter().filter(|one| !one.finished).count();
    let note = if stopped > 0 { format!(" ({stopped} stopped)") } else { String::new() };
    format!(
        "| {} | {} | {}{note} | {} | {} | {} | {} |",
        SETS[case.set],
        FLOORS[case.floor],
        PATHS[case.path],
        cell(&|one| one.driving_m),
        cell(&|one| one.resting_m),
        cell(&|one| one.believed_m),
        cell(&|one| one.heading_rad),
    )
}
