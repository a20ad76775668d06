//! Prints motions as fast as physics allows, driven on floors that are as they were told, and on others.
//!
//! `cargo run --release -p omnibase-trials --example fast [random paths] [laws]`

use omnibase_trials::fast::{Case, HEADING, MOTIONS, random_path};
use omnibase_trials::laws::{CLOSED, asked};
use omnibase_trials::robots::{BMM, MECANUM};

/// What is told of floors, and what they are: three that are as they were told, and three that aren't.
const FLOORS: [(f64, [f64; 2]); 6] = [
    (0.5, [0.5, 0.45]),
    (0.225, [0.25, 0.2]),
    (0.7, [0.8, 0.72]),
    (0.5, [0.45, 0.4]),
    (0.5, [0.35, 0.3]),
    (0.5, [0.25, 0.2]),
];

fn main() {
    let (laws, words) = asked(&CLOSED);
    let paths = words.first().map_or(10, |count| count.parse().expect("a number of random paths"));
    let random = (1..=paths).map(|seed| (format!("random {seed}"), random_path(seed)));
    let motions: Vec<(String, String)> = MOTIONS
        .iter()
        .map(|(name, motion)| ((*name).to_owned(), (*motion).to_owned()))
        .chain(random)
        .collect();
    for (name, robot) in [("bmm", BMM), ("mecanum", MECANUM)] {
        println!("\n{name}\n\n{HEADING}");
        for &law in &laws {
            for (told, floor) in FLOORS {
                for (name, motion) in &motions {
                    let case = Case { robot, law, motion: motion.clone(), told, floor };
                    println!("{}", case.row(name, &case.ride()));
                }
            }
        }
    }
}
