//! Ways that are passed with speeds, and runs that lead onto them.

use super::*;

#[test]
fn a_way_is_passed_with_speeds_between_two_rests() {
    let turning = [[0.0, 0.0, 0.0], [0.6, 0.1, 0.3], [1.1, 0.6, 0.9], [1.8, 0.7, 1.3]]
        .map(|[x, y, heading]| Pose2::new(x, y, heading));
    let circle = |heading| ShapePath { shape: Shape::Circle { radius_m: 0.8 }, heading, turns: 0.7 };
    let ways: [Box<dyn GeometricPath>; 4] = [
        Box::new(line(3.0)),
        Box::new(circle(Heading::Fixed)),
        Box::new(circle(Heading::FollowsTangent)),
        Box::new(PiecewisePath::through(&turning, JOINING).unwrap()),
    ];
    for (number, way) in ways.iter().enumerate() {
        let slow = PlatformBounds::new(Limits { jerk_m_s3: 10.0, angular_jerk_rad_s3: 20.0, ..LIMITS });
        for bounds in [PlatformBounds::new(LIMITS), with_wheels(), slow] {
            for (start_m_s, end_m_s) in [(0.5, 0.6), (0.0, 0.6), (0.4, 0.0), (0.05, 0.3)] {
                let motion =
                    FastestTrajectory::passing(way, Passing { start_m_s, end_m_s }, &bounds).unwrap();
                assert!(loads(&motion, &bounds) < 1.003, "{number}: {}", loads(&motion, &bounds));
                // No acceleration jumps where a run begins.
                for time_s in motion.breaks_s().into_iter().chain(motion.passes_s().into_iter().flatten()) {
                    let [before, after] =
                        [-1e-7, 1e-7].map(|off_s| motion.sample(time_s + off_s).acceleration_in_odom);
                    let step = (after.vx_m_s - before.vx_m_s).hypot(after.vy_m_s - before.vy_m_s);
                    assert!(step < 2.1e-7 * bounds.limits.jerk_m_s3, "{number}: {step} m/s² at {time_s}");
                }
                let rests = [0.0, motion.duration_s()].map(|time_s| motion.sample(time_s).twist_in_odom);
                assert!(rests.iter().all(|twist| twist.speed_m_s() < 1e-6 && twist.w_rad_s.abs() < 1e-6));
                let asked_m_s = [start_m_s, end_m_s];
                for (asked_m_s, at, passed_s) in [(0, 0.0), (1, way.length())]
                    .map(|(end, at)| (asked_m_s[end], at, motion.passes_s()[end]))
                {
                    assert_eq!(passed_s.is_some(), asked_m_s > 0.0);
                    let Some(passed_s) = passed_s else { continue };
                    let setpoint = motion.sample(passed_s);
                    let found_m_s = setpoint.twist_in_odom.speed_m_s();
                    assert!((found_m_s / asked_m_s - 1.0).abs() < 2e-3, "{number}: {found_m_s} {asked_m_s}");
                    let [x, y, heading] = way.sample(at, 0.0).map(|axis| axis[0]);
                    let Pose2 { x_m, y_m, heading_rad } = setpoint.odom_from_base;
                    assert!((x_m - x).hypot(y_m - y) < 1e-6 && (heading_rad - heading).abs() < 1e-6);
                }
            }
        }
    }
}

#[test]
fn runs_are_short_and_cost_little() {
    let bounds = PlatformBounds::new(LIMITS);
    let passing = Passing { start_m_s: 0.5, end_m_s: 0.8 };
    let motion = FastestTrajectory::passing(line(3.0), passing, &bounds).unwrap();
    let [Some(begin_s), Some(end_s)] = motion.passes_s() else { panic!("it passes both ends") };
    // The optimum without a limit on jerk, and the half windows for which the speeds are held.
    let lost_s = (0.5_f64.powi(2) + 0.2_f64.powi(2)) / (2.0 * 1.5);
    let taken_s = end_s - begin_s - (3.0 + lost_s);
    assert!((0.0..0.06).contains(&taken_s), "{taken_s} s longer than the optimum");
    // v²/2a, what the jerk takes, and a tenth.
    for (time_s, x_m, speed_m_s) in [(0.0, 0.0, 0.5), (motion.duration_s(), 3.0, 0.8_f64)] {
        let run_m = (motion.sample(time_s).odom_from_base.x_m - x_m).abs();
        let least_m = speed_m_s.powi(2) / 3.0;
        assert!((least_m..1.1 * least_m + speed_m_s * 0.06).contains(&run_m), "{run_m} m, {least_m} m");
    }
}

#[test]
fn every_speed_that_the_limits_leave_is_met() {
    let share = 0.98;
    let limits = Limits {
        speed_m_s: share * LIMITS.speed_m_s,
        acceleration_m_s2: share * LIMITS.acceleration_m_s2,
        jerk_m_s3: share * LIMITS.jerk_m_s3,
        ..LIMITS
    };
    let bounds = PlatformBounds::new(limits);
    for at in 1..=19 {
        let speed_m_s = 0.05 * f64::from(at);
        for ends in [[0.0, 1.0], [1.0, 0.0], [1.0, 1.0]] {
            let [start_m_s, end_m_s] = ends.map(|part| part * speed_m_s);
            let passing = Passing { start_m_s, end_m_s };
            let motion = FastestTrajectory::passing(line(3.0), passing, &bounds);
            assert!(motion.is_ok(), "{passing:?}: {}", motion.unwrap_err());
        }
    }
}

#[test]
fn what_the_limits_dont_leave_is_refused_with_what_they_do() {
    let bounds = PlatformBounds::new(LIMITS);
    let passing = |start_m_s, end_m_s| Passing { start_m_s, end_m_s };
    let fast = FastestTrajectory::passing(line(3.0), passing(0.0, 1.3), &bounds).unwrap_err();
    let FastestError::NoSpeed { end: WayEnd::End, asked_m_s: 1.3, found_m_s } = fast else {
        panic!("{fast:?}")
    };
    assert!((found_m_s - 1.0).abs() < 0.01, "{found_m_s}");
    // From rest no faster than √2as on a way of 0.1 m; what is found is possible.
    let way = || line(0.1);
    let short = FastestTrajectory::passing(way(), passing(0.0, 0.8), &bounds).unwrap_err();
    let FastestError::NoSpeed { end: WayEnd::End, found_m_s, .. } = short else { panic!("{short:?}") };
    assert!((0.35..0.55).contains(&found_m_s), "{found_m_s}");
    FastestTrajectory::passing(way(), passing(0.0, 0.9 * found_m_s), &bounds).unwrap();
    // A circle of 0.2 m is passed at √ar.
    let circle = ShapePath { shape: Shape::Circle { radius_m: 0.2 }, heading: Heading::Fixed, turns: 1.0 };
    let bent = FastestTrajectory::passing(circle, passing(0.9, 0.0), &bounds).unwrap_err();
    let FastestError::NoSpeed { end: WayEnd::Start, found_m_s, .. } = bent else { panic!("{bent:?}") };
    assert!((0.4..0.55).contains(&found_m_s), "{found_m_s}");
    let turn = PiecewisePath::through(&[Pose2::default(), Pose2::new(0.0, 0.0, 1.0)], JOINING).unwrap();
    let spot = FastestTrajectory::passing(turn, passing(0.0, 0.2), &bounds).unwrap_err();
    assert_eq!(spot, FastestError::OnTheSpot(WayEnd::End));
    for speed_m_s in [f64::NAN, f64::INFINITY, -0.1] {
        assert!(FastestTrajectory::passing(line(3.0), passing(0.0, speed_m_s), &bounds).is_err());
    }
}

/// However small the jerk, at its rests least of all.
#[test]
fn a_motion_never_goes_back() {
    let circle =
        ShapePath { shape: Shape::Circle { radius_m: 0.8 }, heading: Heading::FollowsTangent, turns: 0.7 };
    let ways: [Box<dyn GeometricPath>; 3] = [
        Box::new(line(3.0)),
        Box::new(circle),
        Box::new(PiecewisePath::through(&square(), JOINING).unwrap()),
    ];
    for (number, way) in ways.iter().enumerate() {
        for jerk_m_s3 in [40.0, 10.0, 2.0] {
            let mut bounds = with_wheels();
            bounds.limits = Limits { jerk_m_s3, angular_jerk_rad_s3: 4.0 * jerk_m_s3, ..bounds.limits };
            let motion = FastestTrajectory::new(way, &bounds).unwrap();
            let duration_s = motion.duration_s();
            let times = (0..=100_000).map(|at| duration_s * f64::from(at) / 100_000.0);
            // Of both ends every microsecond of the first and last hundredth.
            let ends = (0..10_000).flat_map(|at| {
                let time_s = 0.01 * f64::from(at) / 10_000.0;
                [time_s, duration_s - time_s]
            });
            let least =
                times.chain(ends).map(|time_s| motion.progress(time_s)[1]).fold(f64::INFINITY, f64::min);
            // Of a speed of 1 m/s, rounding leaves less at rest.
            assert!(least >= -1e-16, "way {number}, {jerk_m_s3} m/s³: {least}");
        }
    }
}
