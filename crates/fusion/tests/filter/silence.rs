//! A tracker that was silent while wheels went wrong by more than their tolerances say.

use omnibase_fusion::{Filter, Reading, Verdict};
use omnibase_platform::{BodyStep, Pose2, Twist2};

use crate::world::{PERIOD_NS, World, error, gyro, settings, tracker};

/// What was seen after the tracker spoke again.
struct Returned {
    verdict: Verdict,
    off_m: f64,
    /// How far the truth was from what was believed at most, in standard deviations.
    sigmas: f64,
    /// When it was believed for good, s.
    good_s: f64,
}

/// Silent for 1.7 s on the way, in which wheels tell so much more than is true; then it says a place so far off, of a platform that is free to
/// be carried from then on, or driven.
fn returns(told_more: f64, jump_m: f64, is_free: bool) -> Returned {
    let sensors = [tracker()];
    let mut world = World::new(5, &sensors);
    let mut filter = Filter::new(settings(), &sensors);
    let (from_ns, to_ns) = (world.now_ns + 4_000_000_000, world.now_ns + 5_700_000_000);
    let (mut sigmas, mut good_s) = (0.0_f64, 0.0);
    for _ in 0..9000 {
        let mut motion = world.step();
        let is_silent = (from_ns..to_ns).contains(&world.now_ns);
        if is_silent {
            let BodyStep { x_m, y_m, angle_rad } = motion.body_from_next.log();
            let more = 1.0 + told_more;
            motion.body_from_next = BodyStep::new(more * x_m, more * y_m, more * angle_rad).exp();
        }
        motion.is_free = is_free && world.now_ns >= from_ns;
        filter.advance(world.now_ns, &motion);
        if (world.now_ns / PERIOD_NS).is_multiple_of(10) {
            let said = world.read(0);
            let Reading::Pose { mut map_from_sensor, covariance } = said else { unreachable!("a tracker") };
            if !is_silent {
                let jump_m = if world.now_ns >= to_ns { jump_m } else { 0.0 };
                map_from_sensor = Pose2 { x_m: map_from_sensor.x_m + jump_m, ..map_from_sensor };
                filter.hear(0, world.now_ns, &Reading::Pose { map_from_sensor, covariance });
            }
        }
        if world.now_ns > to_ns {
            let since_s = (world.now_ns - to_ns) as f64 * 1e-9;
            if filter.verdict(0).0 != Verdict::Good {
                good_s = since_s;
            }
            let covariance = filter.estimate().covariance;
            for (off, variance) in
                error(&filter, world.truth).iter().zip([covariance[0], covariance[3], covariance[5]])
            {
                // Until it was heard twice nothing could be known of it.
                if since_s > 0.05 {
                    sigmas = sigmas.max(off.abs() / variance.sqrt());
                }
            }
        }
    }
    let [x, y, _] = error(&filter, world.truth);
    Returned { verdict: filter.verdict(0).0, off_m: x.hypot(y), sigmas, good_s }
}

#[test]
fn a_tracker_that_is_right_after_a_silence_is_believed_though_wheels_slipped_meanwhile() {
    for told_more in [0.05, -0.05, 0.1, 0.15] {
        let Returned { verdict, off_m, sigmas, good_s } = returns(told_more, 0.0, false);
        println!("{told_more}: {verdict:?} from {good_s} s on, {off_m:.4} m off, within {sigmas:.2} sigma");
        assert_eq!(verdict, Verdict::Good, "{told_more}");
        assert!(good_s < 0.05 && off_m < 2e-3 && sigmas < 4.0, "{told_more}: {good_s} {off_m} {sigmas}");
    }
}

#[test]
fn one_that_comes_back_elsewhere_is_named() {
    for jump_m in [1.0, -0.5, 0.3] {
        let Returned { verdict, off_m, sigmas, .. } = returns(0.0, jump_m, false);
        println!("{jump_m}: {verdict:?}, {off_m:.4} m off, within {sigmas:.2} sigma");
        assert_eq!(verdict, Verdict::Contradicts, "{jump_m}");
        assert!(off_m < 0.05 && sigmas < 3.0, "{jump_m}: {off_m} {sigmas}");
    }
}

#[test]
fn one_that_says_the_same_other_place_for_a_second_of_a_robot_that_was_carried_is_believed() {
    for jump_m in [1.0, -0.5, 0.3] {
        let Returned { verdict, off_m, good_s, .. } = returns(0.0, jump_m, true);
        println!("{jump_m}: {verdict:?} from {good_s} s on, {off_m:.4} m off");
        assert_eq!(verdict, Verdict::Good, "{jump_m}");
        assert!(
            (1.0..3.0).contains(&good_s) && (off_m - jump_m.abs()).abs() < 5e-3,
            "{jump_m}: {good_s} {off_m}"
        );
    }
}

#[test]
fn one_that_froze_is_not_believed_because_torque_is_off_until_it_says_something_new() {
    let sensors = [tracker()];
    let mut world = World::new(5, &sensors);
    let mut filter = Filter::new(settings(), &sensors);
    let mut frozen = None;
    let (freezes_ns, free_ns, lives_ns) =
        [4.0, 5.0, 9.0].map(|after_s| world.now_ns + (1e9 * after_s) as u64).into();
    let mut returned_s = None;
    for _ in 0..10_500 {
        // It stands where its torque was taken, half a metre on.
        let is_free = world.now_ns >= free_ns;
        let mut motion = if is_free { world.drive(Twist2::default()) } else { world.step() };
        motion.is_free = is_free;
        filter.advance(world.now_ns, &motion);
        if (world.now_ns / PERIOD_NS).is_multiple_of(10) {
            let mut said = world.read(0);
            if (freezes_ns..lives_ns).contains(&world.now_ns) {
                said = *frozen.get_or_insert(said);
            }
            filter.hear(0, world.now_ns, &said);
        }
        if world.now_ns > freezes_ns + 500_000_000 && filter.verdict(0).0 != Verdict::Frozen {
            returned_s.get_or_insert((world.now_ns as f64 - lives_ns as f64) * 1e-9);
        }
    }
    let returned_s = returned_s.expect("it lives again");
    assert!((0.0..1.2).contains(&returned_s), "{returned_s} s after it lived again");
}

/// What is 500 ms late but steady isn't silent; who never spoke is.
#[test]
fn silence_is_what_does_not_arrive() {
    let sensors = [gyro(), tracker()];
    let mut world = World::new(5, &sensors);
    let mut filter = Filter::new(settings(), &sensors);
    let mut under_way = std::collections::VecDeque::new();
    for cycle in 0..3000_u64 {
        let motion = world.step();
        filter.advance(world.now_ns, &motion);
        if cycle.is_multiple_of(10) && cycle < 2000 {
            under_way.push_back((world.now_ns, world.read(1)));
        }
        while let Some((instant_ns, reading)) =
            under_way.pop_front_if(|(instant_ns, _)| *instant_ns + 500_000_000 <= world.now_ns)
        {
            filter.hear(1, instant_ns, &reading);
        }
        let [gyro, tracker] = [0, 1].map(|place| filter.verdict(place).0);
        assert_eq!(gyro == Verdict::Silent, cycle > 300, "cycle {cycle}: {gyro:?}");
        // It spoke last of cycle 1990, which arrived in 2490.
        assert_eq!(tracker == Verdict::Silent, (301..500).contains(&cycle) || cycle > 2790, "cycle {cycle}");
    }
}
