//! A force that no model tells, while a path is driven: what each law of torque makes of it.

use omnibase_platform::Wrench2;
use omnibase_robot::{Exchange, Phase, RequestKind};

use crate::support::{BMM, Bench, plan};

/// A push along x, N, and how long it lasts, cycles of 1 ms.
const PUSH_N: f64 = 60.0;
const CYCLES: u64 = 5000;

/// What a push came to.
#[derive(Clone, Copy, Debug)]
struct Pushed {
    /// The greatest error while pushed, m, and the root of its mean square.
    most_m: f64,
    rms_m: f64,
    /// The force that the law found by the end of the push, N.
    found_n: f64,
    /// The error two seconds after it, m.
    after_m: f64,
}

/// Pushes the BMM on its way round a circle; every so many cycles an exchange is lost.
fn push(law: &str, lost_every: u64) -> Pushed {
    let circle = "\n[reference]\nkind = \"circle\"\nradius_m = 0.5\nduration_s = 30.0\n";
    let text = BMM.replace("kind = \"closed_loop_speed\"", &format!("kind = \"{law}\"")) + circle;
    let mut bench = Bench::new(plan(&text));
    bench.enable();
    bench.step(Some(RequestKind::Track));
    bench.run(10_000);
    bench.push = Wrench2::new(-PUSH_N, 0.0, 0.0);
    let (mut most_m, mut square_m2) = (0.0_f64, 0.0);
    for cycle in 0..CYCLES {
        bench.exchange = if cycle % lost_every == 0 { Exchange::Lost } else { Exchange::Complete };
        let before = bench.pose;
        let record = bench.step(None);
        assert_eq!(record.phase, Phase::Tracking, "{law}: {:?}", record.stop_reason);
        let off_m = record.wished.odom_from_body.distance_m(before);
        most_m = most_m.max(off_m);
        square_m2 += off_m * off_m;
    }
    bench.exchange = Exchange::Complete;
    let found_n = bench.robot.record().force_n;
    bench.push = Wrench2::default();
    let record = bench.run(2000);
    let after_m = record.wished.odom_from_body.distance_m(bench.pose);
    let pushed = Pushed { most_m, rms_m: (square_m2 / CYCLES as f64).sqrt(), found_n, after_m };
    println!("{law}, of {lost_every} exchanges one lost: {pushed:?}");
    pushed
}

#[test]
fn an_observer_takes_a_push_that_an_added_up_error_takes_slowly() {
    let [adaptive, observer] = ["adaptive_torque", "disturbance_observer"].map(|law| push(law, u64::MAX));
    assert!((observer.found_n - PUSH_N).abs() < 0.15 * PUSH_N, "{observer:?}");
    assert!(observer.most_m < 0.92 * adaptive.most_m, "{observer:?} {adaptive:?}");
    assert!(observer.rms_m < 0.8 * adaptive.rms_m, "{observer:?} {adaptive:?}");
    assert!(observer.after_m < 0.6 * adaptive.after_m, "{observer:?} {adaptive:?}");
}

#[test]
fn an_observer_bears_lost_exchanges() {
    let [whole, lossy] = [u64::MAX, 7].map(|every| push("disturbance_observer", every));
    assert!((lossy.found_n - PUSH_N).abs() < 0.2 * PUSH_N, "{lossy:?}");
    assert!(lossy.rms_m < 1.5 * whole.rms_m, "{lossy:?} {whole:?}");
}
