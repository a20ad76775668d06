//! Prints which robots that aren't as their file says are named, and how many that are: `-- 400` for so many of the latter; with laws' names for those laws
//! alone.
//!
//! `cargo run --release -p omnibase-trials --example wiring`

use omnibase_trials::laws::asked;
use omnibase_trials::wiring::{Case, Fault, LAWS, PATHS};

fn main() {
    let (laws, words) = asked(&LAWS);
    let robots: u64 = words.first().map_or(100, |number| number.parse().expect("a number of robots"));
    println!("| robot | law | what is wrong | runs | named within 0.5 m | within 1 m | stopped otherwise |");
    println!("|---|---|---|---|---|---|---|");
    for (robot, wheels) in [("bmm", 3), ("mecanum", 4)] {
        for &law in &laws {
            let mut rows: Vec<(&str, [u32; 4])> = Vec::new();
            for fault in Fault::all(wheels) {
                for path in PATHS {
                    let named = Case::plain(robot, law, path, fault).ride(1.0);
                    let is_near = named.is_named() && named.way_m <= 0.5;
                    let is_other = !named.is_named() && named.reason != Default::default();
                    let new = [true, is_near, named.is_named(), is_other].map(u32::from);
                    match rows.iter_mut().find(|(kind, _)| *kind == fault.kind()) {
                        Some((_, counts)) => {
                            counts.iter_mut().zip(new).for_each(|(count, new)| *count += new)
                        }
                        None => rows.push((fault.kind(), new)),
                    }
                }
            }
            for (kind, [runs, near, far, other]) in rows {
                println!("| {robot} | `{law}` | {kind} | {runs} | {near} | {far} | {other} |");
            }
        }
    }
    let seeded = |seed: u64| match (Case::seeded(seed), &laws[..]) {
        (case, &[law]) => Case { law, ..case },
        (case, _) => case,
    };
    let wrong = (1..=robots).filter(|seed| seeded(*seed).ride(f64::INFINITY).is_named()).count();
    println!("\nOf {robots} robots that are as their file says {wrong} are named.");
}
