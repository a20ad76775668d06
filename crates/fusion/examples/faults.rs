//! What becomes of sensors that fail, kind by kind and fault by fault, in companies of others.
//!
//! `cargo run --release -p omnibase-fusion --example faults [-- <worlds> [<fault>]]`: 20 by default, with each
//! fault or with that one alone (`none`, `early`).
//!
//! Told are: after how long the sensor was named at the latest, as what; the share of the time from the fault on
//! for which the truth was outside of the ellipsoid of the covariance that holds it as often as three standard
//! deviations hold one axis (0.27 % where all is right); the mean NEES.
//!
//! And how far away it was at most, in standard deviations of x, y and heading: without a fault it is what
//! stands first.
//!
//! The motion is even: to how much half a second of it shows the first sensor's clock at best stands behind, as
//! a standard deviation in the mean of all worlds. Whoever is to be named within that time has to be off by
//! five of them. Where the motion changes more, `--test filter clocks` tells it.
//!
//! A second table is that of robots whose control law follows a way of an eight by what is believed, so that a sensor that lies leads them
//! off: how far the truth was from where it was to be at most, and how many stood because they didn't know where they are.

#[allow(dead_code, reason = "the tests use more of it")]
#[path = "../tests/filter/faulty.rs"]
mod faulty;
#[allow(dead_code, reason = "the tests use more of it")]
#[path = "../tests/filter/followed.rs"]
mod followed;
#[allow(dead_code, reason = "the tests use more of it")]
#[path = "../tests/filter/world.rs"]
mod world;

use faulty::{DriveProfile, FAULTS, Fault, Outcome, companies, drive_for};

/// How long worlds last that nobody steers, and those of robots that follow a way, s.
const WAYS: [(f64, DriveProfile); 2] = [(8.0, DriveProfile::Wanders), (20.0, DriveProfile::Followed)];

fn main() {
    let worlds: u64 = std::env::args().nth(1).map_or(20, |text| text.parse().expect("how many worlds"));
    let asked = std::env::args().nth(2);
    let is_asked = |fault: &Option<Fault>| {
        asked.as_ref().is_none_or(|asked| name_of(*fault).eq_ignore_ascii_case(asked))
    };
    for (time_s, way) in WAYS {
        println!(
            "{worlds} worlds of {time_s} s, {way:?}; the first sensor of each company fails after 5 s\n"
        );
        let last = match way {
            DriveProfile::Wanders => "its clock shown to ms |\n|---|",
            DriveProfile::Followed => "led off mm | stood |\n|---|---|",
        };
        println!(
            "| sensor, company | fault | named after s | as | unnamed | others named | outside % | NEES | truth within σ | {last}---|---|---|---|---|---|---|---|---|"
        );
        for (name, sensors) in companies() {
            for fault in std::iter::once(None).chain(FAULTS.map(Some)).filter(is_asked) {
                let all: Vec<Outcome> = std::thread::scope(|scope| {
                    let sensors = &sensors;
                    let share = |thread: u64| {
                        let drive = move |seed| drive_for((time_s, way), sensors, fault, seed);
                        scope.spawn(move || (thread..worlds).step_by(2).map(drive).collect::<Vec<_>>())
                    };
                    let workers = [share(0), share(1)];
                    workers.into_iter().flat_map(|worker| worker.join().expect("a thread")).collect()
                });
                println!("| {name} | {} | {} |", name_of(fault), row(way, &all));
            }
        }
        println!();
    }
}

fn name_of(fault: Option<Fault>) -> String {
    fault.map_or("none".to_owned(), |fault| format!("{fault:?}"))
}

fn row(way: DriveProfile, all: &[Outcome]) -> String {
    let named = all.iter().filter_map(|one| one.named);
    let latest_s = named.clone().map(|(after_s, _)| after_s).fold(0.0, f64::max);
    let mut verdicts: Vec<String> = named.map(|(_, verdict)| format!("{verdict:?}")).collect();
    verdicts.sort();
    verdicts.dedup();
    let count = |is: fn(&Outcome) -> bool| all.iter().filter(|one| is(one)).count();
    let most = |of: fn(&Outcome) -> f64| all.iter().map(of).fold(0.0, f64::max);
    let mean = |of: fn(&Outcome) -> f64| all.iter().map(of).sum::<f64>() / all.len() as f64;
    let last = match way {
        DriveProfile::Wanders => {
            let shown: Vec<f64> = all.iter().filter_map(|one| one.shown_s).collect();
            match shown.iter().sum::<f64>() / shown.len() as f64 {
                mean_s if mean_s.is_finite() => format!("{:.0}", 1e3 * mean_s),
                _ => String::new(),
            }
        }
        DriveProfile::Followed => format!("{:.0} | {}", 1e3 * most(|one| one.led_m), count(|one| one.stood)),
    };
    format!(
        "{latest_s:.3} | {} | {} | {} | {:.2} | {:.2} | {:.2} | {last}",
        verdicts.join(", "),
        count(|one| one.named.is_none()),
        count(|one| one.other.is_some()),
        100.0 * mean(|one| one.outside),
        mean(|one| one.nees),
        most(|one| one.sigmas),
    )
}
