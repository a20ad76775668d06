//! Two sensors of poses that contradict each other.

use omnibase_fusion::{Filter, Reading, Sensor, Verdict};
use omnibase_platform::Pose2;

use crate::faulty::THREE_SIGMA;
use crate::world::{World, error, nees, settings, tracker};

/// What was seen of it.
#[derive(Debug)]
struct Watched {
    named: [bool; 2],
    off_m: f64,
    outside: f64,
}

/// Two trackers with so many milliseconds between readings, the wrong one of which says a place so far off.
fn watched(every: [u64; 2], wrong: usize, off_m: f64, seed: u64) -> Watched {
    let sensors = [tracker(), tracker()];
    let mut world = World::new(seed, &sensors);
    let mut filter = Filter::new(settings(), &sensors);
    let mut seen = Watched { named: [false; 2], off_m: 0.0, outside: 0.0 };
    for cycle in 1..=15_000_u64 {
        let mut motion = world.step();
        motion.is_free = cycle < 2000;
        filter.advance(world.now_ns, &motion);
        for (place, every) in every.into_iter().enumerate() {
            let Reading::Pose { map_from_sensor, covariance } = world.read(place) else { unreachable!() };
            if cycle.is_multiple_of(every) {
                let by = if place == wrong { off_m } else { 0.0 };
                let map_from_sensor = Pose2 { x_m: map_from_sensor.x_m + by, ..map_from_sensor };
                filter.hear(place, world.now_ns, &Reading::Pose { map_from_sensor, covariance });
            }
            seen.named[place] |= filter.verdict(place).0 == Verdict::Contradicts;
        }
        // Until both were heard for a while nobody can know of it.
        if cycle > 1000 {
            let [x, y, _] = error(&filter, world.truth);
            seen.off_m = seen.off_m.max(x.hypot(y));
            seen.outside += f64::from(u8::from(3.0 * nees(&filter, world.truth) > THREE_SIGMA)) / 14_000.0;
        }
    }
    seen
}

#[test]
fn two_that_contradict_are_named_and_the_pose_stays_with_one_of_them() {
    for every in [[10, 100], [100, 10], [10, 10], [10, 25], [100, 100]] {
        for off_m in [0.0, 0.03, 0.08, 0.3] {
            for wrong in 0..2 {
                let seen = watched(every, wrong, off_m, 1);
                println!("{every:?} ms, {off_m} m, {wrong} wrong: {seen:?}");
                assert_eq!(seen.named.contains(&true), off_m > 0.0);
                assert!(
                    seen.off_m < off_m + 0.01 && seen.outside < 0.01,
                    "{every:?} {off_m} {wrong}: {seen:?}"
                );
            }
        }
    }
}

/// A coarse one agrees whatever wheels do.
#[test]
fn one_that_sees_less_does_not_refute_slip() {
    let coarse = Sensor { sigma: [1.0, 1.0, 0.1], ..tracker() };
    let sensors = [tracker(), coarse];
    let mut world = World::new(3, &sensors);
    let mut filter = Filter::new(settings(), &sensors);
    for cycle in 1..=8000_u64 {
        let mut motion = world.step();
        if (4000..5000).contains(&cycle) {
            let step = motion.body_from_next;
            motion.body_from_next = step.then(step);
        }
        filter.advance(world.now_ns, &motion);
        for (place, every) in [(1, 10), (0, 20)] {
            if cycle > 1000 * place as u64 && cycle.is_multiple_of(every) {
                let reading = world.read(place);
                filter.hear(place, world.now_ns, &reading);
            }
        }
        assert_ne!(filter.verdict(0).0, Verdict::Contradicts, "{cycle}");
    }
    let [x, y, _] = error(&filter, world.truth);
    assert!(x.hypot(y) < 3e-3, "{x} {y}");
}
