//! Stop always stops; `cargo run --release -p omnibase-trials --example stops 1000000` is the long way round.

use omnibase_trials::robots::{BMM, CIRCLE, MECANUM};
use omnibase_trials::stops::Stops;
use omnibase_trials::{Trial, plan_of};

#[test]
fn every_wheel_stops_in_time_whatever_is_lost() {
    for (robot, seed) in [(BMM, 1_000_000), (MECANUM, 2_000_000)] {
        for policy in ["quick_stop", "ramp", "remove_torque"] {
            let text = format!("{robot}{CIRCLE}\n[safety]\non_lost_device = \"{policy}\"\n");
            let mut stops = Stops::new(Trial::new(plan_of(&text)), seed);
            for _ in 0..300 {
                let case = stops.case();
                assert!(case.is_in_time(), "{policy}: {case:?}");
            }
        }
    }
}
