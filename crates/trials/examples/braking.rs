//! Stops robots of every kind on every floor under way, and prints how many of their ramps were broken off, and why.
//!
//! `cargo run --release -p omnibase-trials --example braking [robots [first seed]]`: 1000 by default, on all cores.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use omnibase_trials::braking::Braking;

fn main() {
    let mut numbers = std::env::args().skip(1).map(|text| text.parse::<u64>().expect("a number"));
    let (robots, first) = (numbers.next().unwrap_or(1000), numbers.next().unwrap_or(1));
    let next = AtomicU64::new(first);
    let tally = Mutex::new(BTreeMap::new());
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed >= first + robots {
                        return;
                    }
                    let braking = Braking::new(seed);
                    // A path that its file's check refuses isn't driven.
                    let Ok(ended) = std::panic::catch_unwind(|| braking.ride()) else { continue };
                    if let Some(reason) = ended.broken_off {
                        println!("{}: {ended:?}: {}", reason.text(), braking.row());
                    }
                    let broken_off = ended.broken_off.map_or("nothing", |reason| reason.text());
                    let key = (braking.seeded.law, ended.first.text(), broken_off);
                    *tally.lock().expect("no thread panics with it").entry(key).or_insert(0) += 1;
                }
            });
        }
    });
    println!("\n| law | stopped for | ramp broken off for | robots |\n|---|---|---|---|");
    for ((law, reason, broken_off), robots) in tally.into_inner().expect("all threads ended") {
        println!("| {law} | {reason} | {broken_off} | {robots} |");
    }
}
