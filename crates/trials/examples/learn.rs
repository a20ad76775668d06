//! How true repeats become, and whether they are ever worse than without what was learnt.
//!
//! `cargo run --release -p omnibase-trials --example learn [-- <robots>]`: 10 robots by default, built with the tolerances of
//! their file. Without and with what was learnt each robot drives with noise on its sensors that no repeat had.

use omnibase_robot::Registry;
use omnibase_trials::learning::{FRAMES, LAWS, PATHS, learn};

fn main() {
    let robots = std::env::args().nth(1).map_or(10, |text| text.parse().expect("how many robots"));
    let registry = Registry::with_built_in();
    println!(
        "{robots} robots, 6 repeats each; true distance from the wished motion, mm: RMS of all robots (worst)\n"
    );
    println!(
        "| path | law | task in | without | learnt | at the end without | learnt | worse than without |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for (path_name, path) in PATHS {
        for law in LAWS {
            for frame in FRAMES {
                let threads = std::thread::available_parallelism().map_or(1, usize::from) as u64;
                let rows: Vec<_> = std::thread::scope(|scope| {
                    let share = |thread| {
                        let registry = &registry;
                        scope.spawn(move || {
                            let seeds = (1 + thread..=robots).step_by(threads as usize);
                            seeds.map(|seed| learn(path, law, frame, seed, registry)).collect::<Vec<_>>()
                        })
                    };
                    let all: Vec<_> = (0..threads).map(share).collect();
                    all.into_iter().flat_map(|one| one.join().expect("a thread of robots")).collect()
                });
                let cell = |of: &dyn Fn(&omnibase_trials::learning::Learned) -> f64| {
                    let values: Vec<f64> = rows.iter().map(|row| 1e3 * of(row)).collect();
                    let squares: f64 = values.iter().map(|value| value * value).sum();
                    let worst = values.iter().copied().fold(0.0, f64::max);
                    format!("{:.2} ({worst:.2})", (squares / values.len() as f64).sqrt())
                };
                println!(
                    "| {path_name} | {law} | {frame} | {} | {} | {} | {} | {} |",
                    cell(&|row| row.without.rms_m),
                    cell(&|row| row.with.rms_m),
                    cell(&|row| row.without.end_m),
                    cell(&|row| row.with.end_m),
                    rows.iter().filter(|row| row.with.rms_m > row.without.rms_m).count(),
                );
            }
        }
    }
}
