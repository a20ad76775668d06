//! A tracker that was silent while wheels went wrong by more than their tolerances say.

use omnibase_fusion::{Filter, Reading, Sensor, Verdict};
use omnibase_platform::{BodyStep, Pose2, Twist2};

use crate::faulty::every;
use crate::world::{PERIOD_NS, World, error, gyro, mouse, settings, tracker};

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

/// What was told after poses fell silent.
#[derive(Debug)]
struct Unheard {
    /// Variances of x and y at the last look, and in the end, m².
    variances_m2: [[f64; 2]; 2],
    /// The least share of a variance that was left from one cycle to the next.
    least_left: f64,
    /// How far the truth was at most, in standard deviations of x and y.
    sigmas: f64,
}

/// Forth along x, slower and faster, with poses whose clock is off by so much; then nobody hears any, and it stops, and stands for long.
fn falls_silent(sensors: &[Sensor], early_ms: i64, seed: u64) -> Unheard {
    let mut world = World::new(seed, sensors);
    let mut filter = Filter::new(settings(), sensors);
    let mut kept = std::collections::VecDeque::new();
    let mut seen = Unheard { variances_m2: [[0.0; 2]; 2], least_left: 1.0, sigmas: 0.0 };
    for cycle in 0..28_000_u64 {
        let time_s = 1e-3 * cycle as f64;
        // It stops within half a second.
        let stops = (1.0 - 2.0 * (time_s - 8.0)).clamp(0.0, 1.0);
        let speed_m_s = stops * time_s.min(1.0) * (0.4 + 0.1 * (1.5 * time_s).sin());
        let motion = world.drive(Twist2::new(speed_m_s, 0.0, 0.0));
        filter.advance(world.now_ns, &motion);
        let is_silent = cycle >= 8000;
        for (place, sensor) in sensors.iter().enumerate() {
            if !cycle.is_multiple_of(every(sensor)) {
                continue;
            }
            let reading = world.read(place);
            if place > 0 {
                filter.hear(place, world.now_ns, &reading);
                continue;
            }
            kept.push_back((world.now_ns, reading));
            if kept.len() > 10 {
                let (instant_ns, reading) = kept.pop_front().expect("a reading");
                if !is_silent {
                    filter.hear(0, instant_ns.saturating_add_signed(-early_ms * 1_000_000), &reading);
                }
            }
        }
        if !is_silent || !filter.is_settled() {
            continue;
        }
        let covariance = filter.estimate().covariance;
        let now_m2 = [covariance[0], covariance[3]];
        if seen.variances_m2[0] == [0.0; 2] {
            seen.variances_m2 = [now_m2; 2];
        }
        for ((now, before), off) in now_m2.iter().zip(seen.variances_m2[1]).zip(error(&filter, world.truth)) {
            seen.least_left = seen.least_left.min(now / before);
            seen.sigmas = seen.sigmas.max(off.abs() / now.sqrt());
        }
        seen.variances_m2[1] = now_m2;
    }
    seen
}

#[test]
fn the_pose_is_never_told_surer_than_at_the_last_look_while_no_pose_is_heard() {
    for beside in [&[][..], &[gyro()], &[gyro(), mouse(0.2, 0.1), mouse(-0.2, 0.1)]] {
        let sensors = [&[tracker()], beside].concat();
        for early_ms in [0, 15, 50, -15, -50, 90] {
            for seed in 0..4 {
                let seen = falls_silent(&sensors, early_ms, seed);
                let [last, end] = seen.variances_m2.map(|all| all.map(|variance| 1e3 * variance.sqrt()));
                let what = format!("beside {}, {early_ms} ms, {seed}", beside.len());
                println!(
                    "{what}: {last:.2?} mm, then {end:.2?}, least left {:.6}, within {:.2} sigma",
                    seen.least_left, seen.sigmas
                );
                // Mice tell a little of the way that was just driven.
                let least = if beside.is_empty() { 1.0 - 1e-9 } else { 1.0 - 1e-3 };
                assert!(seen.least_left > least, "{what}: {} is left", seen.least_left);
                assert!((0..2).all(|axis| end[axis] >= last[axis]), "{what}: {last:?}, then {end:?}");
                assert!(seen.sigmas < 3.5, "{what}: {} sigma", seen.sigmas);
            }
        }
    }
}

/// It turns, with poses whose clock is off by so much, rests in silence until that is forgotten, and drives four metres. Variances of
/// the place and of the heading at the last look, before it drives, and at the end, m² and rad².
fn turns_and_drives(early_ms: u64) -> [[f64; 2]; 3] {
    let sensors = [tracker()];
    let mut world = World::new(3, &sensors);
    let mut filter = Filter::new(settings(), &sensors);
    let variances = |filter: &Filter| {
        let [xx, .., yy, _, hh] = filter.estimate().covariance;
        [xx + yy, hh]
    };
    let mut seen = [[0.0; 2]; 3];
    for cycle in 0..58_000_u64 {
        let time_s = 1e-3 * cycle as f64;
        let twist = match cycle {
            0..8000 => Twist2::new(0.0, 0.0, time_s.min(1.0) * (0.6 + 0.2 * (1.5 * time_s).sin())),
            8000..50_000 => Twist2::default(),
            _ => Twist2::new(0.5, 0.0, 0.0),
        };
        let motion = world.drive(twist);
        filter.advance(world.now_ns, &motion);
        if cycle < 8000 && cycle.is_multiple_of(10) {
            let reading = world.read(0);
            filter.hear(0, world.now_ns - 1_000_000 * early_ms, &reading);
            seen[0] = variances(&filter);
        } else if cycle == 50_000 {
            seen[1] = variances(&filter);
        }
    }
    seen[2] = variances(&filter);
    seen
}

#[test]
fn a_heading_that_a_clock_made_wrong_sweeps_the_place_along_the_way() {
    let [sound, off] = [0, 15].map(turns_and_drives);
    let told = |all: [[f64; 2]; 3]| all.map(|variances| variances.map(|variance| 1e3 * variance.sqrt()));
    println!("mm and mrad: {:.2?}, of a clock that is right {:.2?}", told(off), told(sound));
    assert!(off[0][1] > 5e-3_f64.powi(2) && off[1][1] >= off[0][1] && off[2][1] >= off[1][1], "{off:?}");
    let (swept_m2, expected_m2) = (off[2][0] - sound[2][0], 16.0 * (off[1][1] - sound[1][1]));
    assert!((swept_m2 / expected_m2 - 1.0).abs() < 0.02, "{swept_m2}, expected {expected_m2}");
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
