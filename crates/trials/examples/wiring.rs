//! Prints which robots that aren't as their file says are named, and how many that are: `-- 400` for so many of the latter; with laws' names for those laws
//! alone; `gyro` gives all of them a gyro.
//!
//! `cargo run --release -p omnibase-trials --example wiring`

use omnibase_trials::laws::{ALL, asked};
use omnibase_trials::wiring::{Case, Fault, PATHS};

fn main() {
    let (laws, mut words) = asked(&ALL);
    let gyro = words.iter().any(|word| word == "gyro").then_some(1.002);
    words.retain(|word| word != "gyro");
    let robots: u64 = words.first().map_or(100, |number| number.parse().expect("a number of robots"));
    println!(
        "| robot | law | what is wrong | runs | named within 0.5 m | within 1 m | stopped otherwise | neither, and a centimetre or more astray |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for (robot, wheels) in [("bmm", 3), ("mecanum", 4)] {
        for &law in &laws {
            let mut rows: Vec<(&str, [u32; 5])> = Vec::new();
            for fault in Fault::all(wheels) {
                for path in PATHS {
                    let named = Case { gyro, ..Case::plain(robot, law, path, fault) }.ride(1.0);
                    let is_near = named.is_named() && named.way_m <= 0.5;
                    let is_other = !named.is_named() && named.reason != Default::default();
                    let is_astray = named.reason == Default::default() && named.astray_m >= 0.01;
                    let new = [true, is_near, named.is_named(), is_other, is_astray].map(u32::from);
                    match rows.iter_mut().find(|(kind, _)| *kind == fault.kind()) {
                        Some((_, counts)) => {
                            counts.iter_mut().zip(new).for_each(|(count, new)| *count += new)
                        }
                        None => rows.push((fault.kind(), new)),
                    }
                }
            }
            for (kind, [runs, near, far, other, astray]) in rows {
                println!("| {robot} | `{law}` | {kind} | {runs} | {near} | {far} | {other} | {astray} |");
            }
        }
    }
    let seeded = |seed: u64| match (Case::seeded(seed), &laws[..]) {
        (case, &[law]) => Case { law, gyro, ..case },
        (case, _) => Case { gyro, ..case },
    };
    let mut wrong = 0;
    for seed in 1..=robots {
        let case = seeded(seed);
        let named = case.ride(f64::INFINITY);
        if named.is_named() {
            wrong += 1;
            println!("\n{seed}: {named:?} {case:?}");
        }
    }
    println!("\nOf {robots} robots that are as their file says {wrong} are named.");
}
