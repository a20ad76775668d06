//! Prints what wheels that slip come to, on floors from slippery to rough.
//!
//! `cargo run --release -p omnibase-trials --example slip [laws]`

use omnibase_trials::laws::{ALL, asked};
use omnibase_trials::robots::{BMM, MECANUM};
use omnibase_trials::slip::{Case, HEADING};

fn main() {
    let (laws, _) = asked(&ALL);
    for (name, robot) in [("bmm", BMM), ("mecanum", MECANUM)] {
        println!("\n{name}\n\n{HEADING}");
        for &law in &laws {
            for (path, faster) in [
                ("square", 1.0),
                ("square", 1.5),
                ("square", 2.0),
                ("circle", 1.0),
                ("circle", 2.0),
                ("eight", 1.0),
                ("eight", 2.0),
                ("spiral", 1.0),
                ("spiral", 2.0),
            ] {
                for friction in [0.08, 0.15, 0.25, 0.5] {
                    for (payload_kg, off_centre_m) in [(0.0, 0.0), (100.0, 0.0), (100.0, 0.2)] {
                        for gyro in [false, true] {
                            let more = String::new();
                            let case = Case {
                                robot,
                                law,
                                path,
                                faster,
                                friction,
                                payload_kg,
                                off_centre_m,
                                gyro,
                                more,
                            };
                            println!("{}", case.row(&case.ride()));
                        }
                    }
                }
            }
        }
    }
}
