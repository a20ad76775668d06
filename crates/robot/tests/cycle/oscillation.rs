//! A torque that swings to and fro stops by the drives' own quick stop; jerks, noise and slow swings don't.

use std::f64::consts::TAU;

use omnibase_robot::signals::{Exchange, SafetyReason};
use omnibase_robot::{Phase, RequestKind};

use crate::support::{BMM, Bench, plan};

/// Wheel 2's drive shows this torque, N·m, at these times, s, until the robot stops; how many cycles that took.
fn cycles_to_stop(more: &str, torque_nm: impl Fn(f64) -> f64) -> Option<u32> {
    let mut bench = Bench::new(plan(&format!("{BMM}{more}")));
    bench.enable();
    for cycle in 0..2000 {
        bench.lie_about_torque(1, torque_nm(f64::from(cycle) * 1e-3));
        let record = bench.step(None);
        if record.stop_reason == SafetyReason::Oscillation {
            assert_eq!((bench.robot.phase(), record.stop_where), (Phase::QuickStopping, 1));
            bench.run(3000);
            assert_eq!(bench.robot.phase(), Phase::Fault);
            return Some(cycle);
        }
        assert_eq!((bench.robot.phase(), record.stop_reason), (Phase::Holding, SafetyReason::None));
    }
    None
}

/// A swing of so many N·m to each side about 5 N·m.
fn swing(nm: f64, hz: f64) -> impl Fn(f64) -> f64 {
    move |time_s| 5.0 + nm * (TAU * hz * time_s).sin()
}

#[test]
fn five_half_swings_stop_the_robot() {
    for (hz, most_s) in [(25.0, 0.15), (66.0, 0.07), (120.0, 0.04), (220.0, 0.03)] {
        let cycles = cycles_to_stop("", swing(6.0, hz)).unwrap_or_else(|| panic!("{hz} Hz"));
        assert!(f64::from(cycles) * 1e-3 < most_s, "{hz} Hz: {cycles} cycles");
    }
}

#[test]
fn what_is_small_or_slow_or_no_swing_goes_on() {
    // 15 % of 21 N·m are 3.15 N·m.
    assert_eq!(cycles_to_stop("", swing(2.9, 66.0)), None, "small");
    assert_eq!(cycles_to_stop("", swing(6.0, 8.0)), None, "slow");
    let jerk = |time_s: f64| 10.0 * ((time_s % 0.5) / 0.01 - 0.5).clamp(-0.5, 0.5);
    assert_eq!(cycles_to_stop("", jerk), None, "jerks");
    assert_eq!(cycles_to_stop("", |time_s| if time_s % 0.1 < 0.01 { 12.0 } else { 2.0 }), None, "pulses");
    let share = "\n[safety]\noscillation_share = 0.4\n";
    assert_eq!(cycles_to_stop(share, swing(8.0, 66.0)), None, "as the file says");
    assert!(cycles_to_stop(share, swing(9.5, 66.0)).is_some(), "as the file says");
    assert_eq!(cycles_to_stop("\n[safety]\noscillation_share = 1.0\n", swing(20.0, 66.0)), None, "never");
}

#[test]
fn what_wasnt_measured_is_no_swing_and_a_stop_that_was_acknowledged_begins_anew() {
    let mut bench = Bench::new(plan(BMM));
    bench.enable();
    let ring = |bench: &mut Bench, cycle: u32| {
        bench.lie_about_torque(1, swing(9.0, 66.0)(f64::from(cycle) * 1e-3));
        // Every second exchange is lost: what is left is a swing still.
        bench.exchange = if cycle.is_multiple_of(2) { Exchange::Complete } else { Exchange::Lost };
        bench.step(None)
    };
    let stopped = (0..300).find(|cycle| ring(&mut bench, *cycle).stop_reason == SafetyReason::Oscillation);
    assert!(stopped.is_some());
    bench.exchange = Exchange::Complete;
    bench.lie_about_torque(1, None);
    bench.run(3000);
    bench.step(Some(RequestKind::Acknowledge));
    bench.enable();
    bench.run(1000);
    assert_eq!(bench.robot.phase(), Phase::Holding);
}
