//! Drives robots of every kind on every floor, and prints what must happen to none of them.
//!
//! `cargo run --release -p omnibase-trials --example seeded [robots [first seed]] [law of torque] [--coarse]`: 1000 robots by default, on all
//! cores; those by torque by `adaptive_torque`, where no other is named; with `--coarse` on encoders that count coarsely.
//! What went wrong is told by its seed as it happens; `seeded 1 SEED` drives it again, `seeded seeds SEED SEED ...` many.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use omnibase_trials::laws::{OF_TORQUE, asked};
use omnibase_trials::seeded::{Outcome, Seeded, Wrong};

#[derive(Default)]
struct Tally {
    robots: u64,
    wrong: BTreeMap<&'static str, u64>,
    ends: BTreeMap<(&'static str, &'static str, &'static str), u64>,
    gains_db: Vec<f64>,
    phases_deg: Vec<f64>,
}

fn main() {
    let (laws, words) = asked(&OF_TORQUE);
    let law = if let [law] = laws[..] { law } else { OF_TORQUE[0] };
    let are_coarse = words.iter().any(|word| word == "--coarse");
    let mut words = words.into_iter().filter(|word| word != "--coarse").peekable();
    let are_listed = words.next_if(|first| first == "seeds").is_some();
    let numbers: Vec<u64> = words.map(|text| text.parse().expect("a number")).collect();
    let (robots, first) = (numbers.first().copied().unwrap_or(1000), numbers.get(1).copied().unwrap_or(1));
    let seeds = if are_listed { numbers } else { (first..first + robots).collect() };
    let tally = Mutex::new(Tally::default());
    let next = AtomicUsize::new(0);
    let began = Instant::now();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let Some(seed) = seeds.get(next.fetch_add(1, Ordering::Relaxed)).copied() else { return };
                    let seeded = Seeded::by(seed, law);
                    let seeded = if are_coarse { seeded.with_coarse_encoders() } else { seeded };
                    let outcome = catch_unwind(AssertUnwindSafe(|| seeded.ride())).ok();
                    tally.lock().expect("no thread panics with it").see(&seeded, outcome, seeds.len() == 1);
                }
            });
        }
    });
    tally.into_inner().expect("all threads ended").print(began.elapsed().as_secs_f64());
}

impl Tally {
    fn see(&mut self, seeded: &Seeded, outcome: Option<Outcome>, is_all_shown: bool) {
        self.robots += 1;
        let Some(outcome) = outcome else {
            *self.wrong.entry("panicked").or_default() += 1;
            return println!("panicked: {}", seeded.row());
        };
        if is_all_shown {
            println!("{}\n{}\n{outcome:?}", seeded.text(), seeded.row());
        }
        for wrong in Wrong::ALL.into_iter().filter(|wrong| outcome.is(*wrong)) {
            *self.wrong.entry(wrong.text()).or_default() += 1;
            println!("{}: {}: {}", wrong.text(), seeded.row(), outcome.row());
        }
        let floor = if seeded.friction < 0.35 { "below 0.35" } else { "0.35 to 0.7" };
        *self.ends.entry((seeded.law, floor, outcome.end())).or_default() += 1;
        if let Some(margins) = outcome.margins {
            self.gains_db.push(if margins.is_stable { margins.gain_db } else { 0.0 });
            self.phases_deg.push(if margins.is_stable { margins.phase_deg } else { 0.0 });
        }
    }

    fn print(mut self, seconds: f64) {
        println!(
            "\n{} robots in {seconds:.0} s, {:.1} a second\n",
            self.robots,
            self.robots as f64 / seconds
        );
        println!("| what must not be | robots |\n|---|---|");
        for text in Wrong::ALL.map(Wrong::text).into_iter().chain(["panicked"]) {
            println!("| {text} | {} |", self.wrong.get(text).copied().unwrap_or(0));
        }
        println!("\n| law | floor | end | robots |\n|---|---|---|---|");
        for ((law, floor, end), robots) in &self.ends {
            println!("| {law} | {floor} | {end} | {robots} |");
        }
        println!("\n| margins by torque | least | 1 % | 10 % | half | 90 % |\n|---|---|---|---|---|---|");
        for (name, values) in [("gain, dB", &mut self.gains_db), ("phase, degrees", &mut self.phases_deg)] {
            values.sort_by(f64::total_cmp);
            let at =
                |share: f64| values.get((share * values.len() as f64) as usize).copied().unwrap_or(f64::NAN);
            let shares = [0.0, 0.01, 0.1, 0.5, 0.9].map(|share| format!("{:.1}", at(share)));
            println!("| {name} | {} |", shares.join(" | "));
        }
    }
}
