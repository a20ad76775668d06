//! What the adaptive law learns on the simulated machine: true within a minute, and never carried away.

use omnibase_trials::{Run, Trial, plan_of, robots};

const EXCITING: &str = "\n[reference]\nkind = \"eight\"\nhalf_length_m = 0.8\nturns = 4\nduration_s = 60\n";

fn trial(robot: &str, factor: f64, reference: &str) -> Trial {
    let mut trial = Trial::new(plan_of(&robots::loaded(robot, "adaptive_torque", factor, reference)));
    trial.enable();
    trial
}

#[test]
fn the_mass_is_known_within_a_minute() {
    for (robot, text) in [("bmm", robots::BMM), ("mecanum", robots::MECANUM)] {
        for factor in [0.5, 1.5] {
            let mut trial = trial(text, factor, EXCITING);
            let run = Run::track(&mut trial, &mut |_| {});
            let truth = trial.machine.lock().body().mass_kg();
            let learnt = trial.robot.record().estimates()[0];
            println!("{robot} from {factor}: {learnt:.1} kg of {truth:.1}, {run:?}");
            assert!(run.finished && run.cycles <= 60_500);
            assert!((learnt - truth).abs() < 0.1 * truth, "{robot} from {factor}: {learnt} kg of {truth}");
        }
    }
}
