//! How far robots with sensors truly are from where they should be, floor by floor and path by path.
//!
//! `cargo run --release -p omnibase-trials --example sensed [-- <robots>]`: 5 robots by default, built with the tolerances of
//! their file. The table is that of `docs/accuracy.md`.

use omnibase_trials::sensed::{Case, FLOORS, PATHS, SETS, Sensed, drive};

fn main() {
    let robots = std::env::args().nth(1).map_or(5, |text| text.parse().expect("how many robots"));
    println!("{robots} robots; true distance from the wished place, RMS and of the worst robot\n");
    println!(
        "| sensors | floor, load | path | driving mm | at rest mm | true from believed mm | heading at the end mrad |"
    );
    println!("|---|---|---|---|---|---|---|");
    let cases: Vec<Case> = Case::all().collect();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let mut rows: Vec<Vec<Sensed>> = vec![Vec::new(); cases.len()];
    let share = cases.len().div_ceil(threads);
    std::thread::scope(|scope| {
        for (cases, rows) in cases.chunks(share).zip(rows.chunks_mut(share)) {
            scope.spawn(move || {
                for (case, row) in cases.iter().zip(rows) {
                    *row = (1..=robots).map(|seed| drive(case, seed)).collect();
                }
            });
        }
    });
    for (case, row) in cases.iter().zip(&rows) {
        let cell = |value: &dyn Fn(&Sensed) -> f64| {
            let values: Vec<f64> = row.iter().map(|one| 1e3 * value(one).abs()).collect();
            let rms = (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt();
            format!("{rms:.2} ({:.2})", values.iter().copied().fold(0.0, f64::max))
        };
        let stopped = row.iter().filter(|one| !one.finished).count();
        let note = if stopped > 0 { format!(" ({stopped} stopped)") } else { String::new() };
        println!(
            "| {} | {} | {}{note} | {} | {} | {} | {} |",
            SETS[case.set],
            FLOORS[case.floor],
            PATHS[case.path],
            cell(&|one| one.driving_m),
            cell(&|one| one.resting_m),
            cell(&|one| one.believed_m),
            cell(&|one| one.heading_rad),
        );
    }
}
