//! Stop always stops: seeded cases of what is lost in which state, and the worst of each.
//!
//! `cargo run --release -p omnibase-trials --example stops [cases] [first seed]`
//!
//! Each row of cases has one of the three policies for a lost drive, and one of the three for the time after it; every other one drives its
//! circle as fast as the limits allow.

use omnibase_trials::robots::{BMM, CIRCLE, FAST_CIRCLE};
use omnibase_trials::stops::{Blocking, Case, Comeback, LOSSES, Loss, STATES, Stops};
use omnibase_trials::{Trial, plan_of};
use std::collections::BTreeMap;

/// Cases that one robot lives through before the next one is taken.
const ROW: u64 = 2000;

/// What may come by itself, in the order in which it is counted.
const COMEBACKS: [Comeback; 3] = [Comeback::Stayed, Comeback::Held, Comeback::MovedAsWarned];

fn main() {
    let mut arguments = std::env::args().skip(1).map(|text| text.parse::<u64>().expect("a number"));
    let (cases, first) = (arguments.next().unwrap_or(10_000), arguments.next().unwrap_or(1));
    let mut worst: BTreeMap<Loss, (u64, Case)> = BTreeMap::new();
    let mut states: BTreeMap<_, u64> = BTreeMap::new();
    let (mut late, mut moved, mut on_top, mut blocked) = (0, 0, 0, 0);
    let mut comebacks = [0_u64; COMEBACKS.len()];
    let (mut torque_s, mut on_top_s) = (0.0_f64, 0.0_f64);
    for row in 0..cases.div_ceil(ROW) {
        let policy = ["quick_stop", "ramp", "remove_torque"][(row % 3) as usize];
        let after = ["stay", "hold", "move_again_unattended"][(row / 3 % 3) as usize];
        let circle = [CIRCLE, FAST_CIRCLE][(row % 2) as usize];
        let text = format!(
            "{BMM}{circle}\n[safety]\non_lost_device = \"{policy}\"\nafter_lost_device = \"{after}\"\n\
             move_again_warning_ms = 3000\n"
        );
        let mut stops = Stops::new(Trial::new(plan_of(&text)), first + row * ROW);
        for _ in 0..ROW.min(cases - row * ROW) {
            let case = stops.case();
            if !case.is_in_time() {
                late += 1;
                println!("LATE ({policy}): {case:?}");
            }
            if case.moves_without_person() {
                moved += 1;
                println!("MOVED WITHOUT A PERSON ({policy}, {after}): {case:?}");
            }
            for (count, comeback) in comebacks.iter_mut().zip(COMEBACKS) {
                *count += u64::from(case.comeback == comeback);
            }
            on_top += u64::from(case.then.is_some());
            blocked += u64::from(case.blocking == Blocking::Kept);
            torque_s = case.torque_off_s.map_or(torque_s, |(found_s, _)| torque_s.max(found_s));
            *states.entry(case.state).or_default() += 1;
            if case.then.is_some() {
                on_top_s = on_top_s.max(case.stopped_s);
                continue;
            }
            let entry = worst.entry(case.loss).or_insert((0, case));
            entry.0 += 1;
            if case.stopped_s > entry.1.stopped_s {
                entry.1 = case;
            }
        }
    }
    println!("{:12} {:>9} {:>10} {:>11}   the worst case", "lost", "cases", "longest s", "allowed s");
    for loss in LOSSES {
        let Some((count, case)) = worst.get(&loss) else { continue };
        println!(
            "{:12} {count:9} {:10.3} {:11.3}   {:?}, wheels at {:.2} rad/s, seed {}",
            format!("{loss:?}"),
            case.stopped_s,
            case.allowed_s,
            case.state,
            case.from_rad_s,
            case.seed,
        );
    }
    for state in STATES {
        print!("{state:?} {}  ", states.get(&state).unwrap_or(&0));
    }
    println!(
        "\n{on_top} had another stop on top, {on_top_s:.3} s the longest; {blocked} sources stayed blocked until a person enabled them"
    );
    println!("after the loss of a drive torque was off after {torque_s:.3} s at the latest");
    let [stayed, held, warned] = comebacks;
    println!(
        "when what was lost was back, {stayed} stayed without torque, {held} held, {warned} moved again as they had warned"
    );
    println!("{cases} cases, {late} late, {moved} moved without a person");
    assert_eq!((late, moved), (0, 0));
}
