//! Planned motions: what they promise at points and ends, and that derivatives are derivatives.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use omnibase_platform::{Pose2, Twist2, wrap_angle_rad};
use omnibase_trajectory::limits::{self, Quantity, Retiming};
use omnibase_trajectory::path_points::nearest_turn_rad;
use omnibase_trajectory::{
    Heading, InPlatformAxes, Interpolation, LONGEST_S, Limits, PathPoint, PathPoints, PathPointsError, Peaks,
    Placed, PointTrajectory, Shape, ShapeTrajectory, SpeedRule, Trajectory,
};
use proptest::prelude::*;

const SQUARE: &str = "(0,0,0,0)\n(5,2,0,0)\n(10,2,2,0)\n(15,0,2,0)\n(20,0,0,0)\n";
const LIMITS: Limits = Limits {
    speed_m_s: 0.6,
    acceleration_m_s2: 0.5,
    jerk_m_s3: 5.0,
    rate_rad_s: 0.8,
    angular_acceleration_rad_s2: 1.0,
    angular_jerk_rad_s3: 8.0,
};
const ALL: [Interpolation; 5] = [
    Interpolation::Cubic(SpeedRule::PreviousSlope),
    Interpolation::Cubic(SpeedRule::MeanSlope),
    Interpolation::Quintic,
    Interpolation::Spline,
    Interpolation::BSpline,
];

fn numbers(pose: Pose2) -> [f64; 3] {
    [pose.x_m, pose.y_m, pose.heading_rad]
}

fn axes(twist: Twist2) -> [f64; 3] {
    [twist.vx_m_s, twist.vy_m_s, twist.w_rad_s]
}

fn points(text: &str) -> PathPoints {
    PathPoints::parse(text).unwrap()
}

/// Each derivative is the slope of the one before (central differences, error by h² and by rounding).
fn derivatives_agree(trajectory: &dyn Trajectory, time_s: f64) {
    let h = 1e-5;
    let (before, now, after) =
        (trajectory.sample(time_s - h), trajectory.sample(time_s), trajectory.sample(time_s + h));
    let slope = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|at| (b[at] - a[at]) / (2.0 * h));
    for (found, expected) in [
        (axes(now.twist_in_odom), slope(numbers(before.odom_from_base), numbers(after.odom_from_base))),
        (axes(now.acceleration_in_odom), slope(axes(before.twist_in_odom), axes(after.twist_in_odom))),
        (axes(now.jerk_in_odom), slope(axes(before.acceleration_in_odom), axes(after.acceleration_in_odom))),
    ] {
        for (found, expected) in found.iter().zip(expected) {
            assert!(
                (found - expected).abs() < 1e-6 * (1.0 + expected.abs()),
                "{found} is not {expected} at {time_s} s"
            );
        }
    }
}

fn rests_at_both_ends(trajectory: &dyn Trajectory) {
    let end_s = trajectory.duration_s();
    for time_s in [0.0, end_s] {
        assert!(
            axes(trajectory.sample(time_s).twist_in_odom).iter().all(|speed| speed.abs() < 1e-12),
            "at {time_s} s"
        );
    }
    for time_s in [-1.0, f64::NEG_INFINITY, f64::NAN, end_s + 1.0, f64::INFINITY] {
        let outside = trajectory.sample(time_s);
        let edge = trajectory.sample(if time_s > 0.0 { end_s } else { 0.0 });
        assert_eq!(outside.odom_from_base, edge.odom_from_base, "{time_s}");
        assert_eq!(outside.twist_in_odom, Twist2::default());
        assert_eq!(outside.acceleration_in_odom, Twist2::default());
    }
}

#[test]
fn the_square_of_the_thesis_passes_its_corners() {
    for interpolation in &ALL[..4] {
        let square = PointTrajectory::new(&points(SQUARE), *interpolation);
        assert_eq!(square.duration_s(), 20.0);
        for (time_s, x, y) in
            [(0.0, 0.0, 0.0), (5.0, 2.0, 0.0), (10.0, 2.0, 2.0), (15.0, 0.0, 2.0), (20.0, 0.0, 0.0)]
        {
            let pose = square.sample(time_s).odom_from_base;
            assert!(pose.distance_m(Pose2::new(x, y, 0.0)) < 1e-14, "{interpolation:?}");
        }
        rests_at_both_ends(&square);
    }
    // The cubic of a square rests at each corner: its slopes change sign or vanish there.
    let cubic = PointTrajectory::new(&points(SQUARE), ALL[0]);
    assert_eq!(cubic.sample(5.0).twist_in_odom, Twist2::default());
    assert!((cubic.sample(2.5).twist_in_odom.vx_m_s - 0.6).abs() < 1e-15, "3/2 of the mean speed");
    assert!(
        (Peaks::of(&cubic).acceleration_jump_m_s2 - 0.48 * 2.0_f64.sqrt()).abs() < 1e-6,
        "at the corners"
    );
}

#[test]
fn speeds_at_points_follow_the_rules() {
    // Slopes 1, 3 (same sign), then -1 (change), then 0, then 2.
    let path = points("0 0 0 0\n1 1 0 0\n2 4 0 0\n3 3 0 0\n4 3 0 0\n5 5 0 0\n6 7 0 0");
    for (rule, first) in [(SpeedRule::PreviousSlope, 1.0), (SpeedRule::MeanSlope, 2.0)] {
        let trajectory = PointTrajectory::new(&path, Interpolation::Cubic(rule));
        let speeds: Vec<f64> =
            (0..=6).map(|at| trajectory.sample(f64::from(at)).twist_in_odom.vx_m_s).collect();
        for (found, expected) in speeds.iter().zip([0.0, first, 0.0, 0.0, 0.0, 2.0, 0.0]) {
            assert!((found - expected).abs() < 1e-12, "{rule:?}: {speeds:?}");
        }
    }
}

#[test]
fn splines_are_smooth_where_they_say() {
    let path = points("0 0 0 0\n1 1 0.5 0.2\n3 2 0 1\n3.5 2.2 -1 1.5\n6 0 0 0");
    for (interpolation, smooth) in ALL.into_iter().zip([false, false, true, true, true]) {
        let trajectory = PointTrajectory::new(&path, interpolation);
        rests_at_both_ends(&trajectory);
        for time_s in &trajectory.breaks_s()[1..trajectory.breaks_s().len() - 1] {
            let (before, after) = (trajectory.sample(time_s - 1e-9), trajectory.sample(time_s + 1e-9));
            let speed_jump = (before.twist_in_odom.vx_m_s - after.twist_in_odom.vx_m_s).abs();
            assert!(speed_jump < 1e-6, "{interpolation:?} at {time_s} s");
            let jump = (before.acceleration_in_odom.vx_m_s - after.acceleration_in_odom.vx_m_s).abs();
            assert!(!smooth || jump < 1e-5, "{interpolation:?} at {time_s} s: {jump}");
        }
        for time_s in [0.3, 0.9, 1.7, 3.2, 4.0, 5.9] {
            derivatives_agree(&trajectory, time_s);
        }
    }
    let b_spline = PointTrajectory::new(&path, Interpolation::BSpline);
    assert!(Peaks::of(&b_spline).acceleration_jump_m_s2 < 1e-6, "at rest at the ends, too");
    assert!(b_spline.sample(6.0).odom_from_base.distance_m(Pose2::default()) < 1e-14);
    for at in 0..=600 {
        let pose = b_spline.sample(f64::from(at) * 0.01).odom_from_base;
        assert!(
            (0.0..=2.2).contains(&pose.x_m) && (-1.0..=0.5).contains(&pose.y_m),
            "inside the hull: {pose:?}"
        );
    }
}

fn shapes() -> Vec<(Shape, f64)> {
    vec![
        (Shape::Circle { radius_m: 0.5 }, PI),
        (Shape::Ellipse { half_length_m: 1.0, half_width_m: 0.4 }, 0.0),
        (Shape::Spiral { step_m: 0.3 }, 0.0),
        (Shape::Eight { half_length_m: 0.8 }, 0.0),
    ]
}

#[test]
fn shapes_go_from_rest_to_rest_and_their_heading_follows_the_tangent() {
    for (shape, _) in shapes() {
        for heading in [Heading::Fixed, Heading::FollowsTangent] {
            let trajectory = ShapeTrajectory::new(shape, heading, 2.0, 25.0).unwrap();
            rests_at_both_ends(&trajectory);
            let start = trajectory.sample(0.0);
            assert!(start.odom_from_base.distance_m(Pose2::default()) < 1e-15);
            assert!(start.odom_from_base.heading_rad.abs() < 1e-15);
            assert!(start.acceleration_in_odom.speed_m_s() < 1e-12);
            let mut heading_before = 0.0_f64;
            for at in 1..250 {
                let time_s = f64::from(at) * 0.1;
                derivatives_agree(&trajectory, time_s);
                let setpoint = trajectory.sample(time_s);
                let heading_rad = setpoint.odom_from_base.heading_rad;
                if heading == Heading::FollowsTangent {
                    let twist = setpoint.twist_in_odom;
                    let tangent_rad = twist.vy_m_s.atan2(twist.vx_m_s);
                    assert!(wrap_angle_rad(heading_rad - tangent_rad).abs() < 1e-9, "{shape:?} at {time_s}");
                    assert!(
                        (heading_rad - heading_before).abs() < 0.6,
                        "{shape:?} at {time_s}: no jump of a turn"
                    );
                } else {
                    assert_eq!(heading_rad, 0.0);
                }
                heading_before = heading_rad;
            }
        }
    }
    let circle =
        ShapeTrajectory::new(Shape::Circle { radius_m: 0.5 }, Heading::FollowsTangent, 1.0, 10.0).unwrap();
    let half = circle.sample(5.0).odom_from_base;
    assert!(half.distance_m(Pose2::new(0.0, 1.0, 0.0)) < 1e-12 && (half.heading_rad - PI).abs() < 1e-12);
    assert!((circle.sample(10.0).odom_from_base.heading_rad - TAU).abs() < 1e-12);
    // 15/8 of the mean speed, the minimum-jerk law's peak.
    let speed = Peaks::of(&circle).peak(Quantity::Speed);
    assert!((speed.value - 1.875 * PI / 10.0).abs() < 1e-12 && (speed.time_s - 5.0).abs() < 1e-3);
    let spiral = ShapeTrajectory::new(Shape::Spiral { step_m: 0.3 }, Heading::Fixed, 2.0, 20.0).unwrap();
    assert!(spiral.sample(20.0).odom_from_base.distance_m(Pose2::new(0.6, 0.0, 0.0)) < 1e-12);
    assert!(ShapeTrajectory::new(Shape::Spiral { step_m: 0.3 }, Heading::Fixed, f64::NAN, 20.0).is_err());
    assert!(ShapeTrajectory::new(Shape::Circle { radius_m: -1.0 }, Heading::Fixed, 1.0, 20.0).is_err());
}

#[test]
fn times_beyond_any_use_are_refused_in_words() {
    let refusal = PathPoints::parse("0 0 0 0\n1e6 1 0 0\n(1e18, 2, 0, 0)").unwrap_err();
    assert_eq!(
        refusal.to_string(),
        "line 3, column 2: expected a time from −1000000 s to 1000000 s, found 1000000000000000000 s"
    );
    let point = |time_s| PathPoint { time_s, odom_from_base: Pose2::default() };
    for times in [[-1e18, 0.0], [0.0, 1.001e6], [-1e300, 1e300]] {
        let refusal = PathPoints::new(times.map(point).to_vec()).unwrap_err();
        assert!(matches!(refusal, PathPointsError::TooFar { .. }), "{refusal}");
    }
    assert!(PathPoints::new([-1e6, 1e6].map(point).to_vec()).is_ok());
    let circle =
        |duration_s| ShapeTrajectory::new(Shape::Circle { radius_m: 0.5 }, Heading::Fixed, 1.0, duration_s);
    assert!(circle(LONGEST_S).is_ok());
    let refusal = circle(1e18).unwrap_err();
    assert_eq!(refusal.to_string(), "it takes 1000000000000000000 s, expected at most 1000000 s");
}

#[test]
fn a_point_out_of_reach_is_refused_with_the_time_it_needs() {
    let path = points("# t x y\n0 0 0 0\n5 2 0 0\n10 2 2 0\n12 0 2 0");
    let refusals = limits::plan(&path, Interpolation::Quintic, &LIMITS).unwrap_err();
    assert_eq!(refusals.len(), 3, "{refusals:?}");
    // Peaks of the quintic from rest to rest: v = 15/8·L/T, a = 5.7735·L/T², j = 60·L/T³.
    let first = refusals[0];
    assert_eq!(first.quantity, Quantity::Speed);
    assert!((first.found - 0.75).abs() < 1e-9 && (first.needed_s - 6.25).abs() < 1e-6, "{first}");
    assert_eq!(
        first.to_string(),
        "point 2 (line 3) cannot be reached in 5.000 s: speed would be 0.7500 m/s at t = 2.500 s, the limit is 0.6 m/s; \
         it needs 6.250 s"
    );
    let last = refusals[2];
    assert_eq!((last.quantity, last.part.line), (Quantity::Speed, Some(5)));
    assert!((last.needed_s - 6.25).abs() < 1e-6 && (last.time_s - 11.0).abs() < 1e-3, "{last}");
    // With the time it needs, it passes; with a little less, it does not.
    for (factor, passes) in [(1.0 + 1e-8, true), (1.0 - 1e-6, false)] {
        let text = format!("0 0 0 0\n{} 2 0 0", first.needed_s * factor);
        assert_eq!(limits::plan(&points(&text), Interpolation::Quintic, &LIMITS).is_ok(), passes);
    }
    // Each limit by its own power of time.
    let straight = points("0 0 0 0\n5 2 0 0");
    for (limits, quantity, needed_s) in [
        (
            Limits { acceleration_m_s2: 0.2, ..LIMITS },
            Quantity::Acceleration,
            (10.0 / 3.0_f64.sqrt() * 2.0 / 0.2).sqrt(),
        ),
        (Limits { jerk_m_s3: 0.3, ..LIMITS }, Quantity::Jerk, (60.0 * 2.0 / 0.3_f64).cbrt()),
    ] {
        let refusal = limits::plan(&straight, Interpolation::Quintic, &limits).unwrap_err()[0];
        assert_eq!(refusal.quantity, quantity);
        assert!((refusal.needed_s - needed_s).abs() < 1e-6, "{refusal}, {needed_s}");
    }
    let circle =
        ShapeTrajectory::new(Shape::Circle { radius_m: 0.5 }, Heading::FollowsTangent, 1.0, 2.0).unwrap();
    let refusal = limits::check(&circle, circle.duration_s(), &LIMITS).unwrap_err();
    assert!(
        refusal.to_string().starts_with("the trajectory's end cannot be reached in 2.000 s"),
        "{refusal}"
    );
    assert!(
        limits::check(&Placed::new(circle).stretched(refusal.needed_s / 2.0), refusal.needed_s, &LIMITS)
            .is_ok()
    );
}

#[test]
fn retiming_meets_the_limits_and_uses_them() {
    let path = points("0 0 0 0\n1 2 0 0.3\n2 2 2 2\n12 0 2 1\n13 0 0 0");
    for interpolation in ALL {
        let slower = limits::retimed(&path, interpolation, &LIMITS, Retiming::SlowDown);
        assert!(limits::plan(&slower, interpolation, &LIMITS).is_ok(), "{interpolation:?}");
        assert!(slower.durations_s()[2] >= 10.0 - 1e-9, "what was slow enough does not become faster");
        let fastest = limits::retimed(&path, interpolation, &LIMITS, Retiming::Fastest);
        let peaks = Peaks::of(&PointTrajectory::new(&fastest, interpolation));
        let (stretch, _) = peaks.stretch(&LIMITS);
        assert!((stretch - 1.0).abs() < 1e-6, "{interpolation:?}: {stretch}");
        assert!(fastest.durations_s().iter().sum::<f64>() < slower.durations_s().iter().sum::<f64>());
    }
}

#[test]
fn a_trajectory_can_begin_elsewhere() {
    let start = Pose2::new(1.0, 2.0, PI / 2.0);
    let square =
        Placed::new(PointTrajectory::new(&points(SQUARE), Interpolation::Quintic)).beginning_at(start);
    assert_eq!(square.sample(0.0).odom_from_base, start);
    let setpoint = square.sample(2.5);
    assert!(setpoint.odom_from_base.distance_m(Pose2::new(1.0, 3.0, 0.0)) < 1e-12);
    assert!((setpoint.twist_in_odom.vy_m_s - 0.75).abs() < 1e-12);
    derivatives_agree(&square.stretched(1.7), 3.3);
}

#[test]
fn the_nearest_turn_is_within_half_a_turn() {
    assert!((nearest_turn_rad(-3.0, 3.0) - (TAU - 3.0)).abs() < 1e-15);
    assert_eq!(nearest_turn_rad(1.0, 1.5), 1.0);
}

proptest! {
    /// Any text is read or refused; it never panics, and what is read obeys its promises.
    #[test]
    fn any_text_is_read_or_refused(text in "[0-9 .,()#eE+\\-\nθx]{0,80}") {
        if let Ok(path) = PathPoints::parse(&text) {
            prop_assert!(path.as_slice().len() >= 2);
            prop_assert!(path.durations_s().iter().all(|duration_s| *duration_s > 0.0));
        }
    }

    /// Interpolations through points go through them, whatever the times.
    #[test]
    fn every_point_is_met(steps in prop::collection::vec((0.01..10.0f64, -5.0..5.0f64, -5.0..5.0f64, -7.0..7.0f64), 2..12)) {
        let mut time_s = 3.0;
        let text: String = steps.iter().map(|(step_s, x, y, heading)| {
            time_s += step_s;
            format!("({time_s}, {x}, {y}, {heading})\n")
        }).collect();
        let path = points(&text);
        let start_s = path.as_slice()[0].time_s;
        for interpolation in &ALL[..4] {
            let trajectory = PointTrajectory::new(&path, *interpolation);
            for point in path.as_slice() {
                let found = numbers(trajectory.sample(point.time_s - start_s).odom_from_base);
                for (found, expected) in found.iter().zip(numbers(point.odom_from_base)) {
                    prop_assert!((found - expected).abs() < 1e-9 * (1.0 + expected.abs()), "{:?}", interpolation);
                }
            }
        }
    }
}

#[test]
fn a_shape_without_an_end_goes_at_its_rate_and_its_derivatives_agree() {
    for (shape, _) in shapes() {
        for heading in [Heading::Fixed, Heading::FollowsTangent] {
            let endless = ShapeTrajectory::endless(shape, heading, 10.0).unwrap();
            assert_eq!(endless.duration_s(), f64::INFINITY);
            let start = endless.sample(0.0);
            assert_eq!((start.odom_from_base, start.twist_in_odom), (Pose2::default(), Twist2::default()));
            for at in 1..600 {
                let time_s = f64::from(at) * 0.1;
                // Where it has reached its rate the jerk jumps.
                if (time_s - 5.0).abs() > 1e-3 {
                    derivatives_agree(&endless, time_s);
                }
            }
            assert!(Peaks::of(&endless).acceleration_jump_m_s2 < 1e-6, "{shape:?}");
            // An hour later it is still as far from limits as in its first turn.
            let speed_m_s = |time_s: f64| endless.sample(time_s).twist_in_odom.speed_m_s();
            let at_first_m_s = (0..1500).map(|at| speed_m_s(f64::from(at) * 0.01)).fold(0.0, f64::max);
            let later_m_s = speed_m_s(3601.3);
            assert!(later_m_s < at_first_m_s * (1.0 + 1e-6), "{shape:?}: {later_m_s}, {at_first_m_s}");
        }
        if matches!(shape, Shape::Spiral { .. }) {
            continue;
        }
        let endless = ShapeTrajectory::endless(shape, Heading::Fixed, 10.0).unwrap();
        let [one, next] = [7.3, 17.3].map(|time_s| endless.sample(time_s).odom_from_base);
        assert!(one.distance_m(next) < 1e-9, "{shape:?}: a turn takes its period");
    }
}

#[test]
fn a_motion_in_the_platforms_axes_goes_where_the_platform_points() {
    // Forward by a metre while it turns by a quarter: in odom an arc to the left.
    let forward = PointTrajectory::new(&points("0 0 0 0\n4 1 0 1.5707963267948966"), Interpolation::Quintic);
    let arc = InPlatformAxes::new(forward).unwrap();
    rests_at_both_ends(&arc);
    for time_s in [0.5, 1.0, 2.0, 3.1, 3.9] {
        derivatives_agree(&arc, time_s);
        let setpoint = arc.sample(time_s);
        let own = setpoint.twist_in_odom.rotated(-setpoint.odom_from_base.heading_rad);
        assert!(own.vx_m_s > 0.0 && own.vy_m_s.abs() < 1e-12, "{own:?}");
    }
    // Rate and speed rise and fall alike, so the arc is a circle's: its radius is length by angle.
    let (end, radius_m) = (arc.sample(4.0).odom_from_base, 1.0 / FRAC_PI_2);
    assert!(end.distance_m(Pose2::new(radius_m, radius_m, 0.0)) < 1e-9, "{end:?}");
    let askew = PointTrajectory::new(&points("0 0 0 0\n2 1 0.4 0.5\n4 0 1 2"), Interpolation::Quintic);
    let askew = InPlatformAxes::new(askew).unwrap();
    for time_s in [0.4, 1.1, 1.7, 2.3, 3.6] {
        derivatives_agree(&askew, time_s);
    }
    let endless = ShapeTrajectory::endless(Shape::Circle { radius_m: 0.5 }, Heading::Fixed, 10.0).unwrap();
    assert!(InPlatformAxes::new(endless).is_none());
}

/// A lying eight of 1.6 m in so many points, from rest to rest.
fn eight_points(count: i32) -> PathPoints {
    let point = |at: i32| {
        let part = f64::from(at) / f64::from(count - 1);
        let way = part.powi(3) * (10.0 - 15.0 * part + 6.0 * part * part);
        let phi = std::f64::consts::TAU * way;
        PathPoint {
            time_s: 15.0 * part,
            odom_from_base: Pose2::new(0.8 * phi.sin(), 0.4 * (2.0 * phi).sin(), 0.0),
        }
    };
    PathPoints::new((0..count).map(point).collect()).unwrap()
}

#[test]
fn points_on_a_smooth_curve_are_driven_smoothly() {
    let limits = Limits {
        speed_m_s: 1.0,
        acceleration_m_s2: 1.1,
        jerk_m_s3: 40.0,
        rate_rad_s: 1.5,
        angular_acceleration_rad_s2: 3.0,
        angular_jerk_rad_s3: 80.0,
    };
    let thesis = Interpolation::Cubic(SpeedRule::PreviousSlope);
    let peak = |count, interpolation| {
        let motion = PointTrajectory::new(&eight_points(count), interpolation);
        Peaks::of(&motion).peak(Quantity::Acceleration).value
    };
    let curve = peak(1000, Interpolation::Smooth);
    let [smooth, rough] =
        [Interpolation::Smooth, thesis].map(|interpolation| peak(80, interpolation) / curve);
    assert!((smooth - 1.0).abs() < 0.02 && rough > 2.0, "{smooth} and {rough} of {curve}");
    assert!(limits::plan(&eight_points(80), Interpolation::Smooth, &limits).is_ok());
    assert!(limits::plan(&eight_points(80), thesis, &limits).is_err());
}

#[test]
fn corners_are_stops_by_the_same_rule_as_ever() {
    let square: Vec<PathPoint> = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [0.0, 0.0]]
        .iter()
        .enumerate()
        .map(|(at, [x, y])| PathPoint { time_s: 5.0 * at as f64, odom_from_base: Pose2::new(*x, *y, 0.0) })
        .collect();
    let points = PathPoints::new(square).unwrap();
    let thesis = PointTrajectory::new(&points, Interpolation::Cubic(SpeedRule::PreviousSlope));
    assert_eq!(PointTrajectory::new(&points, Interpolation::Smooth), thesis, "the same bits");
}

#[test]
fn a_platform_waits_and_changes_its_speed_without_overshooting() {
    // A wait of two points, then a tenfold speed.
    let places = [0.0, 0.1, 0.2, 0.3, 0.3, 0.3, 0.4, 0.5, 1.5, 2.5, 2.6];
    let points = places
        .iter()
        .enumerate()
        .map(|(at, x)| PathPoint { time_s: at as f64, odom_from_base: Pose2::new(*x, 0.0, 0.0) });
    let motion = PointTrajectory::new(&PathPoints::new(points.collect()).unwrap(), Interpolation::Smooth);
    let mut before = 0.0;
    for at in 0..=10_000 {
        let x = motion.sample(f64::from(at) * 1e-3).odom_from_base.x_m;
        assert!(x >= before - 1e-9, "back by {} at {at} ms", before - x);
        before = x;
    }
    assert_eq!(motion.sample(4.5).odom_from_base.x_m, 0.3);
}

#[test]
fn limits_are_seen_alike_by_hulls_and_by_peaks() {
    // Points at random times and places, and limits near what they need.
    let mut random = 0x9e37_79b9_7f4a_7c15_u64;
    let mut unit = || {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        (random >> 11) as f64 / (1_u64 << 53) as f64
    };
    let (mut refused, mut allowed) = (0, 0);
    for round in 0..60 {
        let mut time_s = 0.0;
        let points = (0..8).map(|_| {
            time_s += 0.5 + unit();
            PathPoint { time_s, odom_from_base: Pose2::new(unit(), unit(), unit()) }
        });
        let points = PathPoints::new(points.collect()).unwrap();
        let interpolation =
            [Interpolation::Smooth, Interpolation::Quintic, Interpolation::BSpline][round % 3];
        let peaks = Peaks::of(&PointTrajectory::new(&points, interpolation));
        let part = 0.95 + 0.1 * unit();
        let of = |quantity| part * peaks.peak(quantity).value.max(1e-3);
        let limits = Limits {
            speed_m_s: of(Quantity::Speed),
            acceleration_m_s2: of(Quantity::Acceleration),
            jerk_m_s3: of(Quantity::Jerk),
            rate_rad_s: of(Quantity::Rate),
            angular_acceleration_rad_s2: of(Quantity::AngularAcceleration),
            angular_jerk_rad_s3: of(Quantity::AngularJerk),
        };
        let is_allowed = limits::plan(&points, interpolation, &limits).is_ok();
        assert_eq!(is_allowed, part >= 1.0, "{interpolation:?}, {part}");
        if is_allowed { allowed += 1 } else { refused += 1 }
    }
    assert!(refused > 10 && allowed > 10, "{refused} and {allowed}");
}
