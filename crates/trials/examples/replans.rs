//! Motions that are replaced while they are under way, at random, in virtual time: which limit is kept, and whether a stop is always left.
//!
//! `cargo run --release -p omnibase-trials --example replans [-- [<events> [<first seed>]]]`: 100,000 from seed 1 where nothing else is
//! said, 40 in each seeded world; 1000000 for a million.

use std::time::Instant;

use omnibase_robot::Registry;
use omnibase_robot::signals::SafetyReason;
use omnibase_trials::approaches::register_kinematic;
use omnibase_trials::replans::{ROUNDING, Replans, SORTS, run};
use omnibase_trials::{plan_of, robots};

const IN_A_WORLD: u64 = 40;

/// What ends motions in these worlds: obstacles, fences, lost exchanges.
fn is_expected(reason: SafetyReason) -> bool {
    !matches!(reason, SafetyReason::WheelSlip | SafetyReason::TrackingError)
}

fn main() {
    let mut numbers = std::env::args().skip(1).filter_map(|word| word.parse::<u64>().ok());
    let events = numbers.next().unwrap_or(100_000);
    let first = numbers.next().unwrap_or(1);
    let mut registry = Registry::with_built_in();
    register_kinematic(&mut registry);
    let bases = [plan_of(robots::BMM), plan_of(robots::MECANUM)];
    let begun = Instant::now();
    let mut all = Replans { fence_m: f64::INFINITY, ..Default::default() };
    let worlds = events.div_ceil(IN_A_WORLD);
    for seed in first..first + worlds {
        let result = run(&bases[(seed % 2) as usize], &registry, seed, IN_A_WORLD);
        let beyond = result.beyond + result.steps + result.outside + result.moved;
        if beyond > 0 {
            println!(
                "seed {seed}: {} beyond a limit, {} steps, {} outside, {} moved without a person, {:?}",
                result.beyond, result.steps, result.outside, result.moved, result.shares
            );
        }
        // Nothing slips and nothing is weak in these worlds.
        for (reason, _) in result.by_itself.iter().filter(|(reason, _)| !is_expected(*reason)) {
            println!("seed {seed}: stopped by itself, {reason:?}");
        }
        all.add(&result);
    }
    println!("{} requests in {worlds} worlds, {} cycles", all.asked(), all.cycles);
    println!("\n| asked | times | taken | taken while moving |\n|---|---|---|---|");
    for (sort, [asked, taken, moving]) in SORTS.iter().zip(all.counts) {
        println!("| {sort} | {asked} | {taken} | {moving} |");
    }
    println!("\npaths that were joined or gone on with while moving: {}", all.joined);
    for (answer, times) in &all.refused {
        println!("go_to or load and track refused while moving, {answer:?}: {times}");
    }
    for (reason, times) in &all.by_itself {
        println!("stopped by itself, {reason:?}: {times}");
    }
    let names = ["speed", "acceleration", "jerk", "turn speed", "turn acceleration", "turn jerk"];
    for (name, share) in names.iter().zip(all.shares) {
        println!("{name}: {share:.9} of its limit at most");
    }
    println!("\ncycles beyond a limit (by more than {ROUNDING} of it): {}", all.beyond);
    println!("steps of the place: {}", all.steps);
    println!(
        "least room to the fence: {:.3} mm; cycles without a stop left (below 0): {}",
        all.fence_m * 1e3,
        all.outside
    );
    println!(
        "stops that were driven to their end: {}; cycles that moved after a stop without a person: {}",
        all.stops, all.moved
    );
    let [replan, other] = all.longest;
    println!(
        "longest cycle that took a motion over: {replan:?}; without a request: {other:?} (beside whatever else ran)"
    );
    println!(
        "{:.0} s, {:.1} us a cycle",
        begun.elapsed().as_secs_f64(),
        begun.elapsed().as_secs_f64() * 1e6 / all.cycles as f64
    );
}
