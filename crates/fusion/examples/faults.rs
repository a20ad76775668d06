//! What becomes of sensors that fail, kind by kind and fault by fault, in companies of others.
//!
//! `cargo run --release -p omnibase-fusion --example faults [-- <worlds> [<fault>]]`: 20 by default, with each fault or with that one alone (`none`, `early`). After how long the sensor was named at the
//! latest, as what; for which share of the time from the fault on the truth was outside of the ellipsoid of the covariance that holds
//! it as often as three standard deviations hold one axis (0.27 % of the time where all is right), the mean NEES, and how far
//! away it was at most, in standard deviations of x, y and heading: without a fault it is what stands first. The motion is even: to how
//! much half a second of it shows the first sensor's clock at best stands behind, as a standard deviation in the mean of all worlds. Whoever
//! is to be named within that time has to be off by five of them. Where the motion changes more, `--test filter clocks` tells it.

#[allow(dead_code, reason = "the tests use more of it")]
#[path = "../tests/filter/faulty.rs"]
mod faulty;
#[allow(dead_code, reason = "the tests use more of it")]
#[path = "../tests/filter/world.rs"]
mod world;

use faulty::{FAULTS, Fault, Outcome, companies, drive};

fn main() {
    let worlds: u64 = std::env::args().nth(1).map_or(20, |text| text.parse().expect("how many worlds"));
    let asked = std::env::args().nth(2);
    let name_of = |fault: Option<Fault>| fault.map_or("none".to_owned(), |fault| format!("{fault:?}"));
    let is_asked = |fault: &Option<Fault>| {
        asked.as_ref().is_none_or(|asked| name_of(*fault).eq_ignore_ascii_case(asked))
    };
    println!("{worlds} worlds of 8 s; the first sensor of each company fails after 5 s\n");
    println!(
        "| sensor, company | fault | named after s | as | unnamed | others named | outside % | NEES | truth within σ | its clock shown to ms |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for (name, sensors) in companies() {
        for fault in std::iter::once(None).chain(FAULTS.map(Some)).filter(is_asked) {
            let all: Vec<Outcome> = std::thread::scope(|scope| {
                let sensors = &sensors;
                let share = |thread: u64| {
                    let drive = move |seed| drive(sensors, fault, seed);
                    scope.spawn(move || (thread..worlds).step_by(2).map(drive).collect::<Vec<_>>())
                };
                let workers = [share(0), share(1)];
                workers.into_iter().flat_map(|worker| worker.join().expect("a thread")).collect()
            });
            let named = all.iter().filter_map(|one| one.named);
            let latest_s = named.clone().map(|(after_s, _)| after_s).fold(0.0, f64::max);
            let mut verdicts: Vec<String> = named.map(|(_, verdict)| format!("{verdict:?}")).collect();
            verdicts.sort();
            verdicts.dedup();
            let unnamed = all.iter().filter(|one| one.named.is_none()).count();
            let others = all.iter().filter(|one| one.other.is_some()).count();
            let sigmas = all.iter().map(|one| one.sigmas).fold(0.0, f64::max);
            let mean = |of: fn(&Outcome) -> f64| all.iter().map(of).sum::<f64>() / worlds as f64;
            let (outside, nees) = (100.0 * mean(|one| one.outside), mean(|one| one.nees));
            let shown: Vec<f64> = all.iter().filter_map(|one| one.shown_s).collect();
            let shown = match shown.iter().sum::<f64>() / shown.len() as f64 {
                mean_s if mean_s.is_finite() => format!("{:.0}", 1e3 * mean_s),
                _ => String::new(),
            };
            let fault = name_of(fault);
            println!(
                "| {name} | {fault} | {latest_s:.3} | {} | {unnamed} | {others} | {outside:.2} | {nees:.2} | {sigmas:.2} | {shown} |",
                verdicts.join(", ")
            );
        }
    }
}
