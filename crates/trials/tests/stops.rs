//! Stop always stops; `cargo run --release -p omnibase-trials --example stops 1000000` is the long way round.

use omnibase_trials::robots::{BMM, CIRCLE, MECANUM};
use omnibase_trials::stops::{Comeback, Stops};
use omnibase_trials::{Trial, plan_of};

#[test]
fn every_wheel_stops_in_time_whatever_is_lost() {
    for (robot, seed) in [(BMM, 1_000_000), (MECANUM, 2_000_000)] {
        for policy in ["quick_stop", "ramp", "remove_torque"] {
            for after in ["stay", "hold", "move_again_unattended"] {
                let text = format!(
                    "{robot}{CIRCLE}\n[safety]\non_lost_device = \"{policy}\"\nafter_lost_device = \"{after}\"\n\
                     move_again_warning_ms = 3000\n"
                );
                let mut stops = Stops::new(Trial::new(plan_of(&text)), seed);
                let mut seen = Vec::new();
                for _ in 0..200 {
                    let case = stops.case();
                    assert!(case.is_in_time(), "{policy}, {after}: {case:?}");
                    assert!(!case.moves_without_person(), "{policy}, {after}: {case:?}");
                    seen.push(case.comeback);
                }
                // What may come by itself comes, and no more.
                let has = |comeback| seen.contains(&comeback);
                let expected = [true, after != "stay", after == "move_again_unattended"];
                let found = [Comeback::Stayed, Comeback::Held, Comeback::MovedAsWarned].map(has);
                assert_eq!(found, expected, "{policy}, {after}");
            }
        }
    }
}
