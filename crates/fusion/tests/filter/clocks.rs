//! Clocks of gyros and mice that are off: named while the motion changes, and never where it is the wheels that slip.

use omnibase_fusion::{Filter, Motion, Reading, Sensor, SensorKind, Verdict};

use omnibase_platform::BodyStep;

use crate::faulty::{DriveProfile, Fault, Outcome, THREE_SIGMA, companies, drive, drive_for, every};
use crate::lively::Lively;
use crate::world::{World, camera, gyro, imu, mouse, nees, settings, tracker};

/// How long after the clock of one was off it was named, s; and whoever else was.
fn named(
    sensors: &[Sensor],
    (off_one, early_ms): (usize, i64),
    slip: Option<(f64, [f64; 2])>,
) -> (Option<f64>, Vec<usize>) {
    let mut world = Lively::new(3, slip);
    let mut filter = Filter::new(settings(), sensors);
    let (mut after_s, mut others) = (None, Vec::new());
    // When it begins to turn back.
    let from_s = 5.5;
    for cycle in 0..9000_u64 {
        let motion = world.step();
        filter.advance(world.now_ns, &motion);
        let is_off = world.time_s() >= from_s;
        for (place, sensor) in sensors.iter().enumerate() {
            let every = every(sensor);
            if !cycle.is_multiple_of(every) {
                continue;
            }
            let early_ms = if is_off && place == off_one { early_ms } else { 0 };
            // What is heard of now is said to be of before, or what was so before of now.
            let ago = (-early_ms).max(0) as usize;
            let instant_ns = world.now_ns - early_ms.max(0) as u64 * 1_000_000;
            let reading = world.read(sensor, ago);
            filter.hear(place, instant_ns, &reading);
        }
        for place in 0..sensors.len() {
            if matches!(filter.verdict(place).0, Verdict::Contradicts) {
                if place == off_one && is_off {
                    after_s.get_or_insert(world.time_s() - from_s);
                } else if !others.contains(&place) {
                    others.push(place);
                }
            }
        }
    }
    (after_s, others)
}

#[test]
fn a_clock_that_is_off_by_50_ms_is_named_within_half_a_second_of_changing_motion() {
    let [left, right] = [mouse(0.2, 0.1), mouse(-0.2, 0.1)];
    // A gyro whose clock is off beside one mouse and a twist takes the twist with it: not claimed.
    for (sensors, off) in
        [([gyro(), left, right], 3), ([imu(), left, right], 3), ([camera(), gyro(), left], 1)]
    {
        for off_one in 0..off {
            for early_ms in [50, -50] {
                let (after_s, others) = named(&sensors, (off_one, early_ms), None);
                let who = sensors[off_one].kind;
                println!("{who:?}, {early_ms} ms early: named after {after_s:?} s; others {others:?}");
                assert!(after_s.is_some_and(|after_s| after_s <= 0.5), "{who:?} {early_ms}: {after_s:?}");
                assert!(others.is_empty(), "{who:?} {early_ms}: {others:?}");
            }
        }
    }
}

#[test]
fn nobody_is_named_for_clocks_that_are_right_nor_for_wheels_that_slip() {
    let both = [gyro(), mouse(0.2, 0.1), mouse(-0.2, 0.1)];
    for sensors in [&both[..], &both[..1], &both[..2], &both[1..]] {
        for slip in [None, Some((0.2, [5.0, 6.5])), Some((0.5, [5.0, 6.5]))] {
            let (after_s, others) = named(sensors, (0, 0), slip);
            println!("{} sensors, slip {slip:?}: {after_s:?} {others:?}", sensors.len());
            // One mouse, or two without a gyro, are taken for wrong where they contradict the wheels for long, as ever.
            if slip.is_none() || sensors.len() != 2 {
                assert!(after_s.is_none() && others.is_empty(), "{slip:?}: {after_s:?} {others:?}");
            }
        }
    }
}

/// How long after its clock was off in an even motion the first of each company was named, s. Gyros and cameras alone aren't, or not
/// always: what wheels turn is known less well than what such a clock makes of it.
fn named_in_even_motion(fault: Option<Fault>) -> Vec<(&'static str, Vec<Option<f64>>)> {
    let is_told =
        |all: &[Sensor]| all[0].kind == SensorKind::Flow || all.len() > 1 && all[0].kind != SensorKind::Pose;
    let told = companies().into_iter().filter(|(_, all)| is_told(all));
    told.map(|(name, sensors)| {
        let outcomes = (0..4).map(|seed| drive_for((10.0, DriveProfile::Wanders), &sensors, fault, seed));
        let named = outcomes.map(|outcome| {
            assert_eq!(outcome.other, None, "{name}, {fault:?}");
            outcome.named.map(|(after_s, _)| after_s)
        });
        (name, named.collect())
    })
    .collect()
}

#[test]
fn a_clock_that_is_off_in_even_motion_is_named_and_no_other_is() {
    for fault in [None, Some(Fault::Early), Some(Fault::Late)] {
        for (name, named) in named_in_even_motion(fault) {
            println!("{name}, {fault:?}: {named:?}");
            for after_s in named {
                assert_eq!(after_s.is_some(), fault.is_some(), "{name}, {fault:?}");
                // A mouse beside poses, as soon as its mean over half a second shows it; a turn that hardly changes shows it late.
                let most_s = if name.contains("flow, beside a gyro") { 1.0 } else { 3.5 };
                assert!(after_s.is_none_or(|after_s| after_s < most_s), "{name}, {fault:?}: {after_s:?}");
            }
        }
    }
}

/// Until a clock is named, the covariance counts with what it seems to be off, and from then on with what is left of it.
#[test]
fn what_a_clock_seems_to_be_off_counts_in_the_covariance() {
    let all = [(1, 0.14, 2.4), (4, 0.02, 1.3), (6, 0.02, 1.3)];
    for (company, most_outside, most_nees) in all {
        let (name, sensors) = &companies()[company];
        let outcomes: Vec<_> = [Fault::Early, Fault::Late]
            .into_iter()
            .flat_map(|fault| (0..8).map(move |seed| drive(sensors, Some(fault), seed)))
            .collect();
        let mean = |of: fn(&Outcome) -> f64| outcomes.iter().map(of).sum::<f64>() / outcomes.len() as f64;
        let (outside, nees) = (mean(|one| one.outside), mean(|one| one.nees));
        println!("{name}: outside for {:.1} % of the time, NEES {nees:.2}", 100.0 * outside);
        assert!(outside < most_outside && nees < most_nees, "{name}: {outside}, {nees}");
    }
}

#[test]
fn wheels_that_turn_too_little_for_long_are_no_fault_of_a_gyro_beside_poses() {
    let sensors = [gyro(), tracker()];
    let mut world = World::new(3, &sensors);
    let mut filter = Filter::new(settings(), &sensors);
    for cycle in 0..15_000_u64 {
        let mut motion = world.step();
        if cycle > 5000 {
            // They say 10 mrad/s less than is turned, as gyros do whose clock is off.
            motion.body_from_next = motion.body_from_next.moved_by(BodyStep::new(0.0, 0.0, -1e-5));
        }
        filter.advance(world.now_ns, &motion);
        for (place, sensor) in sensors.iter().enumerate() {
            if cycle.is_multiple_of(every(sensor)) {
                let reading = world.read(place);
                filter.hear(place, world.now_ns, &reading);
            }
            assert_ne!(filter.verdict(place).0, Verdict::Contradicts, "{:?}, cycle {cycle}", sensor.kind);
        }
    }
}

/// For how much of 20 s the truth was outside, the mean NEES, whom else was named, and when the poses were, s: their clock is off by so
/// much from the beginning, or goes off by so much in each second.
fn poses_off(beside: &[Sensor], early_s: f64, per_s: f64, seed: u64) -> (f64, f64, Vec<usize>, Option<f64>) {
    let sensors = [&[tracker()], beside].concat();
    let mut world = World::new(seed, &sensors);
    let mut filter = Filter::new(settings(), &sensors);
    let mut kept = std::collections::VecDeque::new();
    let (mut outside, mut sum, mut others, mut named_s) = (0.0, 0.0, Vec::new(), None);
    let cycles = 20_000_u32;
    for cycle in 0..cycles {
        let motion = world.step();
        filter.advance(world.now_ns, &motion);
        let time_s = 1e-3 * f64::from(cycle);
        for (place, sensor) in sensors.iter().enumerate() {
            if !u64::from(cycle).is_multiple_of(every(sensor)) {
                continue;
            }
            let reading = world.read(place);
            if place > 0 {
                filter.hear(place, world.now_ns, &reading);
                continue;
            }
            // It takes 100 ms to come, and is said to be of as much before or after its instant.
            kept.push_back((world.now_ns, reading));
            if kept.len() > 10 {
                let (instant_ns, reading) = kept.pop_front().expect("a reading");
                let early_ns = 1e9 * (early_s + per_s * time_s);
                filter.hear(0, instant_ns.saturating_add_signed(-early_ns as i64), &reading);
            }
        }
        for place in 0..sensors.len() {
            if filter.verdict(place).0 == Verdict::Contradicts && place == 0 {
                named_s.get_or_insert(time_s);
            } else if filter.verdict(place).0 == Verdict::Contradicts && !others.contains(&place) {
                others.push(place);
            }
        }
        let nees = nees(&filter, world.truth);
        sum += nees / f64::from(cycles);
        outside += f64::from(u8::from(3.0 * nees > THREE_SIGMA)) / f64::from(cycles);
    }
    (outside, sum, others, named_s)
}

#[test]
fn a_clock_of_poses_that_is_off_is_named_beside_who_sees_the_floor_and_counts_in_the_covariance() {
    let [left, right] = [mouse(0.2, 0.1), mouse(-0.2, 0.1)];
    for beside in [&[][..], &[gyro()], &[left, right], &[gyro(), left, right]] {
        for (early_s, per_s) in [(0.0, 0.0), (0.05, 0.0), (-0.05, 0.0), (0.0, 5e-3), (0.0, -5e-3)] {
            for seed in 0..2 {
                let (outside, nees, others, named_s) = poses_off(beside, early_s, per_s, seed);
                let what = format!("beside {}, off by {early_s} s, {per_s} in each", beside.len());
                println!(
                    "{what}: outside {outside:.4}, NEES {nees:.2}, named {named_s:?}, others {others:?}"
                );
                assert_eq!(others, [], "{what}: who is right is named");
                let is_off = (early_s, per_s) != (0.0, 0.0);
                assert_eq!(named_s.is_some(), is_off, "{what}");
                if per_s == 0.0 {
                    assert!(outside < 0.025 && nees < 1.3, "{what}: {outside} {nees}");
                    assert!(named_s.is_none_or(|named_s| named_s < 1.0), "{what}: {named_s:?}");
                } else {
                    // What drifts is seen when it has drifted.
                    assert!(outside < 0.2 && nees < 5.0, "{what}: {outside} {nees}");
                }
            }
        }
    }
}

/// Whether poses alone are named beside wheels, of such motions.
fn names_poses(mut step: impl FnMut() -> (u64, Motion, Reading), cycles: u64) -> bool {
    let mut filter = Filter::new(settings(), &[tracker()]);
    (0..cycles).any(|cycle| {
        let (now_ns, motion, reading) = step();
        filter.advance(now_ns, &motion);
        if cycle.is_multiple_of(10) {
            filter.hear(0, now_ns, &reading);
        }
        filter.verdict(0).0 == Verdict::Contradicts
    })
}

#[test]
fn poses_alone_are_not_named_beside_wheels_that_lag_as_wheels_do_or_slip_while_they_are_strained() {
    for lag in [0, 20, 50] {
        for seed in 0..2 {
            let mut world = World::new(seed, &[tracker()]);
            let mut motions = std::collections::VecDeque::from(vec![Motion::default(); lag]);
            let step = || {
                motions.push_back(world.step());
                let motion = motions.pop_front().expect("a motion");
                (world.now_ns, Motion { is_heard: true, ..motion }, world.read(0))
            };
            // Nobody tells whether these lag by 50 ms or the clock of poses is off by as much: no wheels that grip do.
            assert_eq!(names_poses(step, 15_000), lag == 50, "wheels lag by {lag} ms, {seed}");
        }
    }
    for share in [0.2, 0.5, 0.8] {
        let mut world = Lively::new(3, Some((share, [2.0, 9.0])));
        let step = || {
            let motion = world.step();
            (world.now_ns, motion, world.read(&tracker(), 0))
        };
        assert!(!names_poses(step, 9000), "a floor that carries less by {share}");
    }
}
