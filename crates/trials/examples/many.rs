//! Many robots side by side, each on its simulated machine without a bus, on all cores; prints their rate.
//!
//! `cargo run --release -p omnibase-trials --example many [robots] [seconds]`

use std::time::Instant;

use omnibase_robot::RequestKind;
use omnibase_trials::{Trial, plan_of, robots};

fn main() {
    let argument =
        |place, usual| std::env::args().nth(place).and_then(|text| text.parse().ok()).unwrap_or(usual);
    let (count, seconds): (u64, u64) = (argument(1, 1000), argument(2, 10));
    let threads =
        std::thread::available_parallelism().map_or(1, |cores| cores.get() as u64).min(count.max(1));
    let began = Instant::now();
    let cycles: u64 = std::thread::scope(|scope| {
        let mut started = Vec::new();
        for thread in 0..threads {
            let share = count / threads + u64::from(thread < count % threads);
            started.push(scope.spawn(move || side_by_side(share, seconds)));
        }
        started.into_iter().map(|thread| thread.join().expect("a thread that computes")).sum()
    });
    let took_s = began.elapsed().as_secs_f64();
    println!(
        "{count} robots, {seconds} s each at 1 kHz, on {threads} cores: {:.0} cycles a second, {:.0} times real time in all",
        cycles as f64 / took_s,
        cycles as f64 * 1e-3 / took_s
    );
}

/// So many robots in lockstep; the cycles that they did under way.
fn side_by_side(count: u64, seconds: u64) -> u64 {
    let plan = plan_of(&format!("{}{}", robots::BMM, robots::CIRCLE));
    let mut trials: Vec<Trial> = (0..count).map(|_| Trial::new(plan.clone())).collect();
    for trial in &mut trials {
        trial.enable();
        trial.step(Some(RequestKind::Track));
    }
    for _ in 1..1000 * seconds {
        for trial in &mut trials {
            trial.step(None);
        }
    }
    count * 1000 * seconds
}
