//! How accurately the control laws follow, with default friction and slip, 100 kg of payload, first estimates half wrong.

use omnibase_trials::{Run, Trial, plan_of, robots};

#[test]
fn circle_and_square_are_followed_to_half_a_millimetre_where_treads_are_known_to_be_stiff() {
    for (robot, text) in [("bmm", robots::BMM), ("mecanum", robots::MECANUM)] {
        for (path, reference) in [("circle", robots::CIRCLE), ("square", robots::SQUARE)] {
            // The believed RMS that each law must keep, m: a tenth of what is asked where the drives hold the speed.
            for (law, factor, rms_m) in [
                ("closed_loop_speed", 1.0, 5e-5),
                ("adaptive_torque", 0.5, 3e-4),
                ("adaptive_torque", 1.5, 3e-4),
            ] {
                let text = robots::on_stiff_treads(&robots::loaded(text, law, factor, reference));
                let mut trial = Trial::new(plan_of(&text));
                trial.enable();
                let run = Run::track(&mut trial, &mut |_| {});
                let figures = format!("{robot} {path} {law} from {factor}: {run:?}");
                assert!(run.finished, "{figures}");
                assert!(run.believed_rms_m <= rms_m, "{figures}");
                assert!(run.true_final_m <= 3e-3 && run.true_final_heading_rad <= 2e-3, "{figures}");
                // The floor takes its part: a simulation without slip would show none.
                assert!(run.true_rms_m > 5e-4, "{figures}");
            }
        }
    }
}
