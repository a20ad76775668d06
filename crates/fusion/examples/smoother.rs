//! The filter against a batch smoother of other people: GTSAM (F. Dellaert and others), from the Python package index.
//!
//! `cargo run --release -p omnibase-fusion --example smoother [-- <worlds> [<python>]]`: 10 worlds of 1 s by
//! default. What wheels and sensors tell in each is written to a table; `smoother/batch.py` solves for all of
//! it at once with the model written anew, and tells where the platform is at the end, and how well.
//!
//! The Python is `target/smoother/bin/python` by default, which `python3 -m venv target/smoother &&
//! target/smoother/bin/pip install gtsam numpy` makes.

use std::path::Path;

#[path = "../tests/filter/world.rs"]
#[allow(dead_code, reason = "the tests use more of it")]
mod world;

#[path = "../tests/filter/batch.rs"]
mod batch;
use batch::Ends;

/// Epochs in a world.
const EPOCHS: u64 = 200;

fn main() {
    let mut words = std::env::args().skip(1);
    let worlds: u64 = words.next().map_or(10, |text| text.parse().expect("how many worlds"));
    let python = words.next().unwrap_or_else(|| "target/smoother/bin/python".to_owned());
    if !Path::new(&python).exists() {
        eprintln!(
            "no {python}: python3 -m venv target/smoother && target/smoother/bin/pip install gtsam numpy"
        );
        std::process::exit(1);
    }
    println!(
        "filter less batch at the end, in standard deviations of the batch, and the filter's over those; true less batch\n"
    );
    println!(
        "| world | x | y | heading | σ x, y, heading of the batch | filter's σ over them | truth x | y | heading |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let mut greatest = 0.0_f64;
    for seed in 0..worlds {
        let ends = Ends::of(seed, EPOCHS, Path::new(&python));
        let [filtered, sigmas, real] =
            [&ends.filter_off, &ends.filter_sigma, &ends.truth_off].map(|all| ends.over_batch(all));
        let [sx, sy, sh] = ends.batch_sigma;
        println!(
            "| {seed} | {:.3} | {:.3} | {:.3} | {:.3}, {:.3} mm, {:.3} mrad | {:.3}, {:.3}, {:.3} | {:.2} | {:.2} | {:.2} |",
            filtered[0],
            filtered[1],
            filtered[2],
            1e3 * sx,
            1e3 * sy,
            1e3 * sh,
            sigmas[0],
            sigmas[1],
            sigmas[2],
            real[0],
            real[1],
            real[2],
        );
        greatest = filtered.iter().fold(greatest, |most, one| most.max(one.abs()));
    }
    println!("\nfilter at most {greatest:.3} standard deviations of the batch from it");
    assert!(greatest < 3.0, "within three standard deviations of the batch's own");
}
