//! What may be set while the robot runs.

use super::support::{BMM, Bench, plan};
use omnibase_platform::Twist2;
use omnibase_robot::RequestKind;
use omnibase_robot::signals::{Batch, Frame, RequestAnswer};

fn index_of(bench: &Bench, name: &str) -> u32 {
    bench.robot.settings().find(|(_, setting)| setting.name == name).unwrap().0
}

fn value_of(bench: &Bench, name: &str) -> f64 {
    bench.robot.settings().find(|(_, setting)| setting.name == name).unwrap().1.value
}

fn set(bench: &mut Bench, index: u32, value: f64, batch: Batch) -> RequestAnswer {
    bench.step(Some(RequestKind::Set { index, value, batch })).answer
}

#[test]
fn settings_change_while_it_runs_within_their_bounds() {
    let mut bench = Bench::new(plan(BMM));
    bench.enable();
    let kp = index_of(&bench, "kp_x_1_s");
    assert_eq!(set(&mut bench, kp, 3.0, Batch::ALONE), RequestAnswer::Taken);
    assert_eq!(value_of(&bench, "kp_x_1_s"), 3.0);
    for (index, wrong) in [(kp, f64::NAN), (kp, -1.0), (99, 1.0), (u32::MAX, 1.0), (0, 0.0), (1, 1.001)] {
        assert_eq!(set(&mut bench, index, wrong, Batch::ALONE), RequestAnswer::Refused, "{index} {wrong}");
    }
    assert_eq!(value_of(&bench, "kp_x_1_s"), 3.0);
}

/// The changes of a batch: which place gets which number.
fn batch(number: u16, size: u8) -> Vec<Batch> {
    std::iter::successors(Batch::new(number, size), |batch| batch.next()).collect()
}

#[test]
fn several_settings_act_together_or_not_at_all() {
    let mut bench = Bench::new(plan(BMM));
    bench.enable();
    let (x, y) = (index_of(&bench, "kp_x_1_s"), index_of(&bench, "kp_y_1_s"));
    let [first, last] = batch(1, 2)[..] else { panic!("two") };
    assert_eq!(set(&mut bench, x, 3.0, first), RequestAnswer::Taken);
    assert_eq!(value_of(&bench, "kp_x_1_s"), 8.0, "it waits");
    assert_eq!(set(&mut bench, y, 4.0, last), RequestAnswer::Taken);
    assert_eq!([value_of(&bench, "kp_x_1_s"), value_of(&bench, "kp_y_1_s")], [3.0, 4.0]);
    // One of them is wrong: none acts, whichever it is.
    for values in [[-1.0, 6.0], [6.0, -1.0]] {
        set(&mut bench, x, values[0], first);
        assert_eq!(set(&mut bench, y, values[1], last), RequestAnswer::Refused);
        assert_eq!([value_of(&bench, "kp_x_1_s"), value_of(&bench, "kp_y_1_s")], [3.0, 4.0]);
    }
    // More than can wait are refused together, and the next one starts afresh.
    for part in batch(2, 49) {
        assert_eq!(set(&mut bench, x, 7.0, part), RequestAnswer::Refused);
    }
    assert_eq!(set(&mut bench, y, 7.0, Batch::ALONE), RequestAnswer::Taken);
    assert_eq!([value_of(&bench, "kp_x_1_s"), value_of(&bench, "kp_y_1_s")], [3.0, 7.0]);
    // As many as can be set.
    for part in batch(3, 48) {
        assert_eq!(set(&mut bench, x, f64::from(part.place()), part), RequestAnswer::Taken);
    }
    assert_eq!(value_of(&bench, "kp_x_1_s"), 47.0);
}

#[test]
fn what_is_left_of_a_batch_never_acts_with_another() {
    let mut bench = Bench::new(plan(BMM));
    bench.enable();
    let (x, y) = (index_of(&bench, "kp_x_1_s"), index_of(&bench, "kp_y_1_s"));
    let values = |bench: &Bench| [value_of(bench, "kp_x_1_s"), value_of(bench, "kp_y_1_s")];
    let before = values(&bench);
    // Its end never comes: another's change acts alone.
    assert_eq!(set(&mut bench, x, 3.0, batch(1, 2)[0]), RequestAnswer::Taken);
    assert_eq!(set(&mut bench, y, 4.0, Batch::ALONE), RequestAnswer::Taken);
    assert_eq!(values(&bench), [before[0], 4.0]);
    // Its end comes after that, or one of its middle is missing, or its beginning: nothing of it acts.
    assert_eq!(set(&mut bench, y, 5.0, batch(1, 2)[1]), RequestAnswer::Refused);
    for missing in 0..3 {
        for part in batch(2, 3).into_iter().filter(|part| part.place() != missing) {
            set(&mut bench, if part.place() == 0 { x } else { y }, 6.0, part);
        }
        assert_eq!(values(&bench), [before[0], 4.0], "{missing}");
    }
    // Two of the same size: the end of one doesn't complete the other.
    assert_eq!(set(&mut bench, x, 6.0, batch(3, 2)[0]), RequestAnswer::Taken);
    assert_eq!(set(&mut bench, y, 6.0, batch(4, 2)[1]), RequestAnswer::Refused);
    assert_eq!(values(&bench), [before[0], 4.0]);
}

#[test]
fn a_lower_speed_slows_every_wish() {
    for (name, value, expected) in [("speed_factor", 0.5, 0.3), ("speed_m_s", 0.2, 0.2)] {
        let mut bench = Bench::new(plan(BMM));
        bench.enable();
        let index = index_of(&bench, name);
        assert_eq!(set(&mut bench, index, value, Batch::ALONE), RequestAnswer::Taken);
        let wish = RequestKind::Velocity { twist: Twist2::new(0.6, 0.0, 0.0), frame: Frame::Body };
        for _ in 0..2000 {
            bench.step(Some(wish));
        }
        let speed = bench.robot.record().setpoint.twist_in_odom.speed_m_s();
        assert!((speed - expected).abs() < 1e-9, "{name}: {speed}");
    }
}
