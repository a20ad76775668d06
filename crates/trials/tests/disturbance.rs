//! A force that no model tells, while a path is driven: what each law of torque makes of it.

use omnibase_robot::{Phase, RequestKind};
use omnibase_robot_sim::Wrench;
use omnibase_trials::{Trial, plan_of, robots};

/// A push along x, N, and how long it lasts, s.
const PUSH_N: f64 = 60.0;
const PUSH_S: f64 = 5.0;

/// What a push came to.
#[derive(Clone, Copy, Debug, Default)]
struct Pushed {
    /// The greatest error that is believed, m, and the root of its mean square while pushed.
    most_m: f64,
    rms_m: f64,
    /// The force that the law found by the end of the push, N.
    found_n: f64,
    /// The believed error five seconds after it, m.
    after_m: f64,
}

/// Pushes a loaded BMM that goes slowly round a circle, its mass known.
fn push(law: &str) -> Pushed {
    let circle = "\n[reference]\nkind = \"circle\"\nradius_m = 0.5\nduration_s = 30.0\n";
    let mut trial = Trial::new(plan_of(&robots::loaded(robots::BMM, law, 1.0, circle)));
    trial.enable();
    trial.step(Some(RequestKind::Track));
    let mut pushed = Pushed::default();
    let mut square_m2 = 0.0;
    let cycles = (PUSH_S * 1e3) as u64;
    trial.run(10_000);
    trial.machine.lock().set_push(Wrench { fx_n: -PUSH_N, ..Wrench::default() });
    for _ in 0..cycles {
        let record = trial.step(None);
        assert_eq!(record.phase, Phase::Tracking, "{law}: {:?}", record.stop_reason);
        let off_m = record.wished.odom_from_body.distance_m(record.state.odom_from_body);
        pushed.most_m = pushed.most_m.max(off_m);
        square_m2 += off_m * off_m;
    }
    pushed.rms_m = (square_m2 / cycles as f64).sqrt();
    pushed.found_n = trial.robot.record().force_n;
    trial.machine.lock().set_push(Wrench::default());
    let record = trial.run(5000);
    pushed.after_m = record.wished.odom_from_body.distance_m(record.state.odom_from_body);
    println!("{law}: {pushed:?}");
    pushed
}

#[test]
fn an_observer_takes_a_push_that_the_added_up_error_takes_slowly() {
    let [adaptive, observer] = ["adaptive_torque", "disturbance_observer"].map(push);
    assert!((observer.found_n - PUSH_N).abs() < 0.15 * PUSH_N, "{observer:?}");
    assert!(observer.most_m < 0.8 * adaptive.most_m, "{observer:?} {adaptive:?}");
    assert!(observer.rms_m < 0.5 * adaptive.rms_m, "{observer:?} {adaptive:?}");
    assert!(observer.after_m < 0.5 * adaptive.after_m, "{observer:?} {adaptive:?}");
}
