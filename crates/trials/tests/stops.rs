//! Stop always stops; `cargo run --release -p omnibase-trials --example stops 1000000` is the long way round.

use omnibase_robot::{Phase, RequestKind};
use omnibase_trials::robots::{BMM, CIRCLE, MECANUM, SQUARE, with_payload};
use omnibase_trials::stops::{Comeback, Stops};
use omnibase_trials::{Trial, laws, plan_of};

/// What one robot with one policy did in each of 70 cases, its own, once what was lost was back.
fn comebacks(robot: &str, seed: u64, policy: &str, after: &str) -> Vec<Comeback> {
    let text = format!(
        "{robot}{CIRCLE}\n[safety]\non_lost_device = \"{policy}\"\nafter_lost_device = \"{after}\"\n\
         move_again_warning_ms = 3000\n"
    );
    let mut stops = Stops::new(Trial::new(plan_of(&text)), seed);
    let case = |_| {
        let case = stops.case();
        assert!(case.is_in_time(), "{policy}, {after}: {case:?}");
        assert!(!case.moves_without_person(), "{policy}, {after}: {case:?}");
        case.comeback
    };
    (0..70).map(case).collect()
}

#[test]
fn every_wheel_stops_in_time_whatever_is_lost() {
    for (after, seed) in [("stay", 0), ("hold", 1000), ("move_again_unattended", 2000)] {
        let seen: Vec<Comeback> = std::thread::scope(|scope| {
            let robots = [(BMM, 1_000_000), (MECANUM, 2_000_000)].map(|(robot, first)| {
                scope.spawn(move || {
                    let policies = ["quick_stop", "ramp", "remove_torque"].into_iter().zip(0_u64..);
                    let cases = |(policy, row)| comebacks(robot, first + seed + row * 100_000, policy, after);
                    policies.flat_map(cases).collect::<Vec<_>>()
                })
            });
            robots.into_iter().flat_map(|cases| cases.join().expect("every case is in time")).collect()
        });
        // What may come by itself comes, and no more.
        let expected = [true, after != "stay", after == "move_again_unattended"];
        let found = [Comeback::Stayed, Comeback::Held, Comeback::MovedAsWarned]
            .map(|comeback| seen.contains(&comeback));
        assert_eq!(found, expected, "{after}");
    }
}

#[test]
fn who_is_held_fast_and_stopped_for_it_stays_when_he_is_let_go() {
    // By up to half a metre, in the stop, where a stop drives after the setpoint that it was left behind by.
    for robot in [BMM, MECANUM] {
        for law in laws::ALL.iter() {
            let mut trial = Trial::new(plan_of(&(with_payload(robot, law, 1.0, 0.0) + SQUARE)));
            trial.enable();
            let hold = |trial: &Trial, torque_n_m: f64| {
                (0..trial.plan.drives.len()).for_each(|at| trial.machine.lock().brake(at, torque_n_m));
            };
            hold(&trial, 1000.0);
            trial.step(Some(RequestKind::Track));
            while trial.robot.phase() == Phase::Tracking {
                trial.step(None);
            }
            let reason = trial.robot.record().stop_reason;
            let held = trial.pose();
            hold(&trial, 0.0);
            trial.run(2000);
            let moved_m = held.distance_m(trial.pose());
            println!("{law}: {reason:?}, {moved_m} m");
            assert!(
                trial.robot.phase() != Phase::Stopping && moved_m < 0.02,
                "{law}: {reason:?}, {moved_m} m"
            );
        }
    }
}
