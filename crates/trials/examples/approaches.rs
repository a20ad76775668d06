//! Approaches to fences and obstacles at all speeds, directions, frames and sources, in virtual time.
//!
//! `cargo run --release -p omnibase-trials --example approaches [-- [<cases> [<first seed>]] [guarded|circulate]]`:
//! 100,000 cases from seed 1, first `guarded`, then `circulate` on the same ones, where nothing else is said.

use omnibase_robot::Registry;
use omnibase_robot::config::AvoidanceKind;
use omnibase_trials::approaches::{Approach, register_kinematic, run};
use omnibase_trials::{plan_of, robots};

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let mut numbers = words.iter().filter_map(|word| word.parse::<u64>().ok());
    let cases = numbers.next().unwrap_or(100_000);
    let first = numbers.next().unwrap_or(1);
    let kinds: &[AvoidanceKind] = match words.last().map(String::as_str) {
        Some("guarded") => &[AvoidanceKind::Guarded],
        Some("circulate") => &[AvoidanceKind::Circulate],
        _ => &[AvoidanceKind::Guarded, AvoidanceKind::Circulate],
    };
    let mut registry = Registry::with_built_in();
    register_kinematic(&mut registry);
    let bases = [plan_of(robots::BMM), plan_of(robots::MECANUM)];
    for &kind in kinds {
        let run_one = |seed: u64| (seed, run(&bases[(seed % 2) as usize], &registry, seed, kind));
        let results: Vec<(u64, Approach)> = (first..first + cases).map(run_one).collect();
        println!("\n## {kind:?}: {cases} approaches, seeds {first} to {}", first + cases - 1);
        let cycles: u64 = results.iter().map(|(_, result)| result.cycles).sum();
        let limited = results.iter().filter(|(_, result)| result.limited > 0).count();
        println!("{cycles} cycles; fence or obstacle limited {limited} approaches");
        distribution("room to the fence, of the believed footprint", &results, |result| result.fence_m);
        distribution("room to the fence, of the true footprint within 3 sigma", &results, |result| {
            result.true_fence_m
        });
        let count = |of: &dyn Fn(&Approach) -> bool| results.iter().filter(|(_, result)| of(result)).count();
        let outside = count(&|result| result.true_fence_m < 0.0);
        println!("\ntrue footprint outside, within 3 sigma: {outside}");
        println!("true footprint outside, beyond 3 sigma: {}", count(&|result| result.beyond > 0));
        let greatest =
            |of: &dyn Fn(&Approach) -> f64| results.iter().map(|(_, result)| of(result)).fold(0.0, f64::max);
        println!(
            "the believed pose was off by {:.1} mm and {:.2} sigma at most",
            greatest(&|result| result.error_m) * 1e3,
            greatest(&|result| result.error_sigmas)
        );
        let larger = count(&|result| result.error_m > 0.02);
        println!("by more than 20 mm in {larger} approaches");
        println!(
            "way blocked: given up {}, refused beforehand {}",
            count(&|result| result.given_up),
            count(&|result| result.refused)
        );
        distribution("distance to standing obstacles", &results, |result| result.standing_m);
        distribution("distance to moving obstacles", &results, |result| result.moving_m);
        distribution(
            "distance to all obstacles where its own motion brought it nearer",
            &results,
            |result| result.own_m,
        );
        let kept = results.iter().map(|(_, result)| result.own_share).fold(f64::INFINITY, f64::min);
        println!(
            "\nwhere its own motion brought it nearer it kept {:.3} of the distance to be kept, at least",
            kept
        );
        let step_m = results.iter().map(|(_, result)| result.own_step_m).fold(0.0, f64::max);
        println!("where it was touched already a cycle brought it nearer by {:.1} um at most", step_m * 1e6);
        let names = ["speed", "acceleration", "jerk", "turn speed", "turn acceleration", "turn jerk"];
        for (number, name) in names.iter().enumerate() {
            let greatest = results.iter().map(|(_, result)| result.shares[number]).fold(0.0, f64::max);
            println!("{name}: {greatest:.9} of its limit at most");
        }
    }
}

fn distribution(name: &str, results: &[(u64, Approach)], of: impl Fn(&Approach) -> f64) {
    let mut sorted: Vec<(f64, u64)> = results
        .iter()
        .map(|(seed, result)| (of(result), *seed))
        .filter(|(value, _)| value.is_finite())
        .collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let Some((least, seed)) = sorted.first() else { return };
    let at = |part: f64| sorted[((sorted.len() - 1) as f64 * part) as usize].0 * 1e3;
    let crossed = sorted.iter().filter(|(value, _)| *value < 0.0).count();
    println!(
        "\n{name}: {} approaches, {crossed} below 0; min {:.3} mm (seed {seed}), p1 {:.2}, p50 {:.1}, p99 {:.0} mm",
        sorted.len(),
        least * 1e3,
        at(0.01),
        at(0.5),
        at(0.99),
    );
    if crossed > 0 {
        let seeds: Vec<String> = sorted[..crossed.min(8)].iter().map(|(_, seed)| seed.to_string()).collect();
        println!("  below 0, the deepest first: seeds {}", seeds.join(", "));
    }
    let edges = [f64::NEG_INFINITY, 0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, f64::INFINITY];
    for pair in edges.windows(2) {
        let count = sorted.iter().filter(|(value, _)| (pair[0]..pair[1]).contains(value)).count();
        println!(
            "  {:>6.2} to {:>5.2} m: {count:>7} {}",
            pair[0],
            pair[1],
            "#".repeat(60 * count / sorted.len())
        );
    }
}
