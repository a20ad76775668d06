//! A robot's file describes one machine: the same with frames and without, whichever way its drives are mounted.

use omnibase_platform::Pose2;
use omnibase_trials::{Run, Trial, framed, plan_of, robots};

/// What start-up and clocks of the bus change, m.
const ALIKE_M: f64 = 5e-6;

const ROBOTS: [(&str, &str); 2] = [("bmm", robots::BMM), ("mecanum", robots::MECANUM)];

/// A run, and where the body truly stands after it.
fn tracked(text: &str) -> (Run, Pose2) {
    let mut trial = Trial::new(plan_of(text));
    trial.enable();
    let run = Run::track(&mut trial, &mut |_| {});
    assert!(run.finished, "{run:?}");
    (run, trial.pose())
}

#[test]
fn with_frames_and_without_it_moves_alike() {
    for (name, robot) in ROBOTS {
        for (path, reference) in [("circle", robots::CIRCLE), ("square", robots::SQUARE)] {
            for (law, factor) in [("closed_loop_speed", 1.0), ("adaptive_torque", 0.5)] {
                let text = robots::loaded(robot, law, factor, reference);
                let (without, _) = tracked(&text);
                let with = framed::track(&text).summary;
                let pairs =
                    [(with.rms_error_m, without.true_rms_m), (with.final_error_m, without.true_final_m)];
                for (with, without_m) in pairs {
                    let with_m = with.truth.expect("simulated");
                    assert!(
                        (with_m - without_m).abs() <= ALIKE_M,
                        "{name} {path} {law}: {with_m} m with frames, {without_m} m without"
                    );
                }
            }
        }
    }
}

#[test]
fn a_drive_mounted_the_other_way_round_changes_nothing() {
    for (name, robot) in ROBOTS {
        for law in ["closed_loop_speed", "adaptive_torque"] {
            let text = robots::loaded(robot, law, 1.0, robots::CIRCLE);
            let turned = text.replacen("position = 0", "position = 0\ndirection = \"backward\"", 1);
            assert_ne!(text, turned);
            let ((_, forward), (_, backward)) = (tracked(&text), tracked(&turned));
            assert!(forward.distance_m(backward) <= ALIKE_M, "{name} {law}: {forward:?} {backward:?}");
            assert!((forward.heading_rad - backward.heading_rad).abs() <= 1e-4, "{name} {law}");
        }
    }
}
