//! Prints what wheels that slip come to: every path at every speed on floors from slippery to rough, and, on one floor, with every load,
//! on soft treads and stiff, and with a gyro.
//!
//! `cargo run --release -p omnibase-trials --example slip [laws] [--all]`: with `--all` each load, tread and floor with each other.

use omnibase_robot_sim::Tread;
use omnibase_trials::laws::{ALL, asked};
use omnibase_trials::robots::{BMM, MECANUM};
use omnibase_trials::rows;
use omnibase_trials::slip::{Case, HEADING};

const FLOORS: [f64; 5] = [0.08, 0.15, 0.25, 0.5, 0.7];
/// Payloads, kg, and where they stand, x, m.
const LOADS: [(f64, f64); 5] = [(0.0, 0.0), (100.0, 0.0), (100.0, 0.2), (200.0, 0.0), (200.0, 0.2)];
/// The softest and the stiffest that are known, both with the least damping.
const TREADS: [Option<f64>; 3] = [None, Some(1e5), Some(4e6)];

fn main() {
    let (laws, words) = asked(&ALL);
    let all = words.iter().any(|word| word == "--all");
    for (name, robot) in [("bmm", BMM), ("mecanum", MECANUM)] {
        println!("\n{name}\n\n{HEADING}");
        let of_law = |law: &&'static str| cases(&Case::plain(robot, law, "square"), all);
        let cases: Vec<Case> = laws.iter().flat_map(of_law).collect();
        rows::print_in_order(&cases, |case| case.row(&case.ride()));
    }
}

/// The cases like a plain one; not all of them: one that differs in its floor differs in nothing else but path and speed.
fn cases(plain: &Case, all: bool) -> Vec<Case> {
    let mut surroundings = Vec::new();
    for friction in FLOORS {
        for (payload_kg, off_centre_m) in LOADS {
            for stiffness_n_m in TREADS {
                for gyro in [false, true] {
                    let tread =
                        stiffness_n_m.map(|stiffness_n_m| Tread { stiffness_n_m, damping_ratio: 0.1 });
                    let case = Case { friction, tread, payload_kg, off_centre_m, gyro, ..plain.clone() };
                    let differs = [
                        friction != plain.friction,
                        payload_kg != plain.payload_kg,
                        tread != plain.tread,
                        gyro != plain.gyro,
                    ];
                    if all || differs.into_iter().filter(|differs| *differs).count() <= 1 {
                        surroundings.push(case);
                    }
                }
            }
        }
    }
    let ways = ["square", "circle", "eight", "spiral"].into_iter();
    let ways = ways.flat_map(|path| [1.0, 1.5, 2.0].map(|faster| (path, faster)));
    ways.flat_map(|(path, faster)| surroundings.iter().map(move |case| Case { path, faster, ..case.clone() }))
        .collect()
}
