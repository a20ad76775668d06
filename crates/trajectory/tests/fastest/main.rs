//! The fastest motion along a way: against optima that are known in closed form, and within every limit.

mod curves;
mod ends;
mod heat;

use omnibase_platform::Pose2;
use omnibase_trajectory::fastest::{FastestError, Limit, WayEnd};
use omnibase_trajectory::reach::{self, AccelerationBounds, Bend, Interval, Plane};
use omnibase_trajectory::{
    FastestTrajectory, GeometricPath, Heading, Joining, Limits, Passing, PiecewisePath, PlatformBounds,
    Shape, ShapePath, Trajectory,
};

const LIMITS: Limits = Limits {
    speed_m_s: 1.0,
    acceleration_m_s2: 1.5,
    jerk_m_s3: 40.0,
    rate_rad_s: 1.5,
    angular_acceleration_rad_s2: 3.0,
    angular_jerk_rad_s3: 80.0,
};
const JOINING: Joining = Joining { radius_m: 0.67, corner_rad: 0.5, tolerance_m: 0.05 };

/// The grid of a path, and x by a limit on the speed.
fn grid(path: &impl GeometricPath, count: usize, speed: f64) -> (Vec<Interval>, Vec<f64>) {
    let at = |index: usize| path.length() * index as f64 / count as f64;
    let bend = |sigma: f64, side: f64| {
        let axes = path.sample(sigma, side);
        Bend { rate: axes.map(|axis| axis[1]), curve: axes.map(|axis| axis[2]) }
    };
    let intervals = (0..count)
        .map(|index| Interval {
            length: at(index + 1) - at(index),
            ends: [bend(at(index), 1.0), bend(at(index + 1), -1.0)],
            share: 1.0,
        })
        .collect();
    let most = |index: usize| {
        let rate = bend(at(index), 1.0).rate;
        (speed / rate[0].hypot(rate[1])).powi(2)
    };
    (intervals, (0..=count).map(most).collect())
}

fn time_s(intervals: &[Interval], x: &[f64]) -> f64 {
    let speeds = x.windows(2).map(|pair| pair[0].max(0.0).sqrt() + pair[1].max(0.0).sqrt());
    intervals.iter().zip(speeds).map(|(interval, speeds)| 2.0 * interval.length / speeds).sum()
}

fn line(length_m: f64) -> PiecewisePath {
    PiecewisePath::through(&[Pose2::default(), Pose2::new(length_m, 0.0, 0.0)], JOINING).unwrap()
}

#[test]
fn points_that_only_rounding_tells_apart_are_one() {
    let (here, near) = (Pose2::default(), Pose2::new(6.7e-14, 2.7e-19, -1.3e-16));
    assert!(PiecewisePath::through(&[near, here], JOINING).is_none());
    let path = PiecewisePath::through(&[here, near, Pose2::new(1.0, 0.0, 0.0)], JOINING).unwrap();
    let bounds = PlatformBounds::new(LIMITS);
    let [with, without] =
        [path, line(1.0)].map(|path| FastestTrajectory::new(path, &bounds).unwrap().duration_s());
    assert!((with - without).abs() < 1e-9, "{with} s, {without} s");
}

#[test]
fn limits_beyond_any_use_are_refused_and_a_jerk_that_no_cycle_sees_costs_nothing() {
    let eight = ShapePath { shape: Shape::Eight { half_length_m: 0.8 }, heading: Heading::Fixed, turns: 1.0 };
    let timed =
        |limits| FastestTrajectory::new(eight, &PlatformBounds::new(limits)).map(|found| found.duration_s());
    for acceleration_m_s2 in [1e-12, 1e-15] {
        let refused = timed(Limits { acceleration_m_s2, ..LIMITS }).unwrap_err();
        assert!(matches!(refused, FastestError::TooLong { .. } | FastestError::TooFine { .. }), "{refused}");
    }
    let of = |jerk| timed(Limits { jerk_m_s3: jerk, angular_jerk_rad_s3: jerk, ..LIMITS }).unwrap();
    let expected_s = of(1e6);
    for jerk in [1e9, 1e12, 1e15, 1e18] {
        assert!((of(jerk) - expected_s).abs() < 1e-3 * expected_s, "{jerk}: {} s, {expected_s} s", of(jerk));
    }
}

#[test]
fn a_straight_line_takes_the_time_of_a_trapezoid() {
    let disk = AccelerationBounds { length: Some(1.5), ..Default::default() };
    let (intervals, most) = grid(&line(3.0), 450, 1.0);
    // v/a to reach the speed, and again to stop; both take half of the way that they would else.
    let x = reach::fastest(&intervals, &most, &disk, [0.0, 0.0]).unwrap();
    let expected_s = 3.0 + 1.0 / 1.5;
    assert!((time_s(&intervals, &x) - expected_s).abs() < 1e-4, "{}", time_s(&intervals, &x));
    // Any speed at either end: from 0.5 to 0.8 m/s.
    let x = reach::fastest(&intervals, &most, &disk, [0.25, 0.64]).unwrap();
    assert!((x[0] - 0.25).abs() < 1e-12 && (x[450] - 0.64).abs() < 1e-12);
    let lost_s = (0.5_f64.powi(2) + 0.2_f64.powi(2)) / (2.0 * 1.5);
    assert!((time_s(&intervals, &x) - 3.0 - lost_s).abs() < 1e-4, "{}", time_s(&intervals, &x));
    // Too fast at an end, or too fast to brake.
    assert!(reach::fastest(&intervals, &most, &disk, [0.0, 1.1]).is_err());
    let (short, most) = grid(&line(0.1), 50, 1.0);
    assert!(reach::fastest(&short, &most, &disk, [0.81, 0.0]).is_err());
    assert!(reach::fastest(&short, &most, &disk, [0.0, 0.81]).is_err());
}

#[test]
fn a_circle_is_driven_at_the_edge_of_the_disk() {
    let circle = ShapePath { shape: Shape::Circle { radius_m: 0.5 }, heading: Heading::Fixed, turns: 1.0 };
    let disk = AccelerationBounds { length: Some(1.5), ..Default::default() };
    let (intervals, most) = grid(&circle, 2000, 9.0);
    let x = reach::fastest(&intervals, &most, &disk, [0.0, 0.0]).unwrap();
    // |a|² = (r·φ̈)² + (r·φ̇²)²: from rest φ̇² = (A/r)·sin 2φ until it is A/r at π/4.
    let most_rate = 1.5 / 0.5;
    for (at, x) in x.iter().enumerate() {
        let phi = std::f64::consts::TAU * at as f64 / 2000.0;
        let phi = phi.min(std::f64::consts::TAU - phi);
        let expected =
            if phi < std::f64::consts::FRAC_PI_4 { most_rate * (2.0 * phi).sin() } else { most_rate };
        assert!((x - expected).abs() < 0.02, "at {phi}: {x}, expected {expected}");
    }
}

#[test]
fn zero_inertia_points_are_passed_without_a_swing() {
    // x² along y: where q' of y is zero its limit says nothing of u, and the bend alone bounds x.
    let count = 400;
    let bend = |sigma: f64| Bend { rate: [1.0, 2.0 * sigma, 0.0], curve: [0.0, 2.0, 0.0] };
    let at = |index: usize| -1.0 + 2.0 * index as f64 / count as f64;
    let intervals: Vec<Interval> = (0..count)
        .map(|index| Interval {
            length: at(index + 1) - at(index),
            ends: [bend(at(index)), bend(at(index + 1))],
            share: 1.0,
        })
        .collect();
    let plane = |normal: [f64; 3], most: f64| Plane { normal, most, ..Plane::default() };
    let planes = vec![
        plane([1.0, 0.0, 0.0], 5.0),
        plane([-1.0, 0.0, 0.0], 5.0),
        plane([0.0, 1.0, 0.0], 1.0),
        plane([0.0, -1.0, 0.0], 1.0),
    ];
    let bounds = AccelerationBounds { planes, ..Default::default() };
    let x = reach::fastest(&intervals, &vec![1e6; count + 1], &bounds, [0.0, 0.0]).unwrap();
    assert!((x[count / 2] - 0.5).abs() < 1e-3, "2·x is at most 1 at the vertex: {}", x[count / 2]);
    // The profile is smooth there: no chatter of u.
    let u = |index: usize| (x[index + 1] - x[index]) / (2.0 * intervals[index].length);
    let jumps = (150..250).map(|index| (u(index + 1) - u(index)).abs()).fold(0.0, f64::max);
    assert!(jumps < 0.1, "{jumps}");
}

/// The greatest part of each limit, at times that aren't the planner's own.
fn loads(motion: &impl Trajectory, bounds: &PlatformBounds) -> f64 {
    let count = 20_000;
    let at = |index: usize| motion.sample(motion.duration_s() * (index as f64 + 0.37) / count as f64);
    let mut most: f64 = 0.0;
    for index in 0..count {
        bounds.loads(&at(index), |_, found, may| most = most.max(found / may));
    }
    most
}

fn square() -> Vec<Pose2> {
    [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [0.0, 0.0]].map(|[x, y]| Pose2::new(x, y, 0.0)).to_vec()
}

#[test]
fn every_limit_is_kept_and_the_time_is_short() {
    let bounds = PlatformBounds::new(LIMITS);
    let stops = Joining { tolerance_m: 0.0, ..JOINING };
    let eight = |heading| ShapePath { shape: Shape::Eight { half_length_m: 0.8 }, heading, turns: 1.0 };
    let circle = ShapePath { shape: Shape::Circle { radius_m: 0.5 }, heading: Heading::Fixed, turns: 1.0 };
    let paths: [(&str, Box<dyn GeometricPath>, f64); 5] = [
        ("square", Box::new(PiecewisePath::through(&square(), stops).unwrap()), 10.68 + 4.0 * 0.055),
        ("blended", Box::new(PiecewisePath::through(&square(), JOINING).unwrap()), 9.86),
        ("circle", Box::new(circle), 4.29),
        ("eight", Box::new(eight(Heading::Fixed)), 7.12),
        ("tangent", Box::new(eight(Heading::FollowsTangent)), 8.95),
    ];
    for (name, path, most_s) in paths {
        let ends = [path.sample(0.0, 1.0), path.sample(path.length(), -1.0)];
        let motion = FastestTrajectory::new(path, &bounds).unwrap();
        assert!(loads(&motion, &bounds) < 1.003, "{name}: {}", loads(&motion, &bounds));
        assert!(motion.duration_s() < most_s, "{name}: {}", motion.duration_s());
        for (time_s, axes) in
            [(0.0, ends[0]), (motion.duration_s(), ends[1]), (1e9, ends[1]), (f64::NAN, ends[0])]
        {
            let setpoint = motion.sample(time_s);
            let Pose2 { x_m, y_m, heading_rad } = setpoint.odom_from_base;
            let off = [x_m - axes[0][0], y_m - axes[1][0], heading_rad - axes[2][0]];
            assert!(off.iter().all(|off| off.abs() < 1e-9), "{name} at {time_s}: {off:?}");
            assert!(setpoint.twist_in_odom.speed_m_s() < 1e-6, "{name} at {time_s}");
        }
    }
}

#[test]
fn shapes_of_many_turns_keep_their_limits_and_their_time() {
    let bounds = PlatformBounds::new(LIMITS);
    for shape in [Shape::Eight { half_length_m: 0.5 }, Shape::Circle { radius_m: 0.5 }] {
        let timed = |turns| {
            let way = ShapePath { shape, heading: Heading::Fixed, turns };
            FastestTrajectory::new(way, &bounds).unwrap()
        };
        // What one turn more takes, once it goes on as it went.
        let [two_s, three_s] = [2.0, 3.0].map(|turns| timed(turns).duration_s());
        for turns in [64.0, 128.0, 200.0, 1024.0] {
            let motion = timed(turns);
            assert!(loads(&motion, &bounds) < 1.003, "{shape:?}, {turns}: {}", loads(&motion, &bounds));
            let expected_s = two_s + (turns - 2.0) * (three_s - two_s);
            let longer = motion.duration_s() / expected_s - 1.0;
            assert!(longer.abs() < 0.01, "{shape:?}, {turns}: {} s, {expected_s} s", motion.duration_s());
        }
    }
}

/// A path told in many pieces, so that the first grid is as fine.
struct InPieces<'a>(&'a PiecewisePath, usize);

impl GeometricPath for InPieces<'_> {
    fn length(&self) -> f64 {
        self.0.length()
    }

    fn sample(&self, sigma: f64, side: f64) -> [[f64; 4]; 3] {
        self.0.sample(sigma, side)
    }

    fn breaks(&self) -> Vec<f64> {
        let parts = |pair: &[f64]| {
            (0..self.1)
                .map(|at| at as f64 / self.1 as f64)
                .map(|part| pair[0] + part * (pair[1] - pair[0]))
                .collect::<Vec<_>>()
        };
        self.0.breaks().windows(2).flat_map(parts).chain([self.length()]).collect()
    }
}

/// A robot on three wheels that may be fast, and grip.
fn with_wheels() -> PlatformBounds {
    let mut wheels =
        PlatformBounds::new(Limits { speed_m_s: 1.5, acceleration_m_s2: 6.0, jerk_m_s3: 400.0, ..LIMITS });
    for wheel in 0..3 {
        let (sin, cos) = (2.1 * f64::from(wheel)).sin_cos();
        wheels.wheel_speeds.push([-sin, cos, 0.4].map(|part| part / 1.5));
        for sign in [1.0, -1.0] {
            let normal = [sign * -sin * 47.0 + 18.0 * cos, sign * cos * 47.0 + 18.0 * sin, sign * 5.8];
            wheels.planes.push((Limit::Grip, Plane { normal, most: 91.0, ..Plane::default() }));
        }
    }
    wheels
}

#[test]
fn the_grid_costs_less_than_half_a_percent() {
    let wheels = with_wheels();
    let round = |count: usize, step: f64| -> Vec<Pose2> {
        let phi = |at: usize| step * at as f64;
        let pose = |phi: f64| Pose2::new(2.0 * phi.sin(), 1.5 * (1.3 * phi).cos(), 0.4 * (0.7 * phi).sin());
        (0..count).map(|at| pose(phi(at))).collect()
    };
    let stops = Joining { tolerance_m: 0.0, ..JOINING };
    let legs: Vec<Pose2> =
        (0..60).map(|at| Pose2::new(f64::from(at % 2), 0.1 * f64::from(at), 0.0)).collect();
    let ways = [
        ("square", PiecewisePath::through(&square(), stops)),
        ("blended", PiecewisePath::through(&square(), JOINING)),
        ("20 points", PiecewisePath::through(&round(20, 0.1), JOINING)),
        ("sharp points", PiecewisePath::through(&round(20, 0.8), Joining { corner_rad: 3.0, ..JOINING })),
        ("100 points", PiecewisePath::through(&round(100, 0.02), JOINING)),
        ("60 legs with stops", PiecewisePath::through(&legs, stops)),
        ("60 legs", PiecewisePath::through(&legs, JOINING)),
    ];
    for (name, way) in ways {
        let way = way.unwrap();
        let parts = 4000 / way.breaks().len();
        for (floor, bounds) in [("platform", PlatformBounds::new(LIMITS)), ("wheels", wheels.clone())] {
            let own_s = FastestTrajectory::new(&way, &bounds).unwrap().duration_s();
            let fine_s = FastestTrajectory::new(InPieces(&way, parts), &bounds).unwrap().duration_s();
            println!(
                "{name}, {floor}: {own_s:.4} s, {fine_s:.4} s on a fine grid: {:.3} %",
                100.0 * (own_s / fine_s - 1.0)
            );
            assert!(
                (own_s / fine_s - 1.0).abs() < 0.005,
                "{name}, {floor}: {own_s} s, {fine_s} s on a fine grid"
            );
        }
    }
}

#[test]
fn wheels_bind_where_the_platform_does_not() {
    let mut bounds = PlatformBounds::new(LIMITS);
    // One wheel that rolls along x: no faster than 0.4 m/s, and 50 kg that it pushes by 20 N.
    bounds.wheel_speeds.push([1.0 / 0.4, 0.0, 0.0]);
    for sign in [1.0, -1.0] {
        bounds.planes.push((
            Limit::WheelTorque,
            Plane { normal: [sign * 50.0, 0.0, 0.0], most: 20.0, ..Plane::default() },
        ));
    }
    let motion = FastestTrajectory::new(line(2.0), &bounds).unwrap();
    assert!(loads(&motion, &bounds) < 1.003);
    let expected_s = 2.0 / 0.4 + 0.4 / 0.4;
    assert!((motion.duration_s() - expected_s).abs() < 0.05, "{}", motion.duration_s());
}

#[test]
fn corners_are_cut_within_their_tolerance_and_smooth_points_are_met() {
    let path = PiecewisePath::through(&square(), JOINING).unwrap();
    let mut nearest = [f64::INFINITY; 5];
    for at in 0..=10_000 {
        let [x, y, _] = path.sample(path.length() * f64::from(at) / 10_000.0, 1.0).map(|axis| axis[0]);
        for (nearest, corner) in nearest.iter_mut().zip(square()) {
            *nearest = nearest.min((x - corner.x_m).hypot(y - corner.y_m));
        }
    }
    assert!(nearest[1..4].iter().all(|off_m| (0.045..0.0501).contains(off_m)), "{nearest:?}");
    // Direction and curvature are continuous at every joint.
    for at in path.breaks() {
        let [before, after] = [-1.0, 1.0].map(|side| path.sample(at, side));
        for (before, after) in before.iter().zip(after) {
            assert!((0..3).all(|order| (before[order] - after[order]).abs() < 1e-6), "{at}");
        }
    }
    let round: Vec<Pose2> = (0..=80)
        .map(|at| f64::from(at) / 80.0 * std::f64::consts::TAU)
        .map(|phi| Pose2::new(0.8 * phi.sin(), 0.4 * (2.0 * phi).sin(), 0.0))
        .collect();
    let path = PiecewisePath::through(&round, JOINING).unwrap();
    assert_eq!(path.breaks().len(), 81, "no corner among them");
    for (at, pose) in path.breaks().iter().zip(&round) {
        let [x, y, _] = path.sample(*at, 1.0).map(|axis| axis[0]);
        assert!((x - pose.x_m).hypot(y - pose.y_m) < 1e-12);
    }
}

#[test]
fn points_that_repeat_count_once() {
    let pose = |x_m: f64| Pose2::new(x_m, 0.0, 0.0);
    let path = PiecewisePath::through(&[pose(0.0), pose(0.0), pose(1.0), pose(1.0)], JOINING).unwrap();
    assert_eq!(path.length(), 1.0);
    assert!(PiecewisePath::through(&[pose(1.0), pose(1.0)], JOINING).is_none());
}

#[test]
fn what_changed_is_solved_as_if_all_were() {
    let circle =
        ShapePath { shape: Shape::Eight { half_length_m: 0.8 }, heading: Heading::Fixed, turns: 1.0 };
    let disk = AccelerationBounds { length: Some(1.5), ..Default::default() };
    let (mut intervals, most) = grid(&circle, 500, 9.0);
    let mut reached = reach::Reached::new(intervals.len());
    reached.solve(&intervals, &most, &disk, [0.0, 0.0]).unwrap();
    for (at, share) in [(100, 0.5), (101, 0.5), (400, 0.7), (100, 0.3), (0, 0.9), (499, 0.2)] {
        intervals[at].share = share;
        reached.change(at);
        reached.solve(&intervals, &most, &disk, [0.0, 0.0]).unwrap();
        assert_eq!(reached.x, reach::fastest(&intervals, &most, &disk, [0.0, 0.0]).unwrap(), "{at}");
        let new = reached.is_new.iter().filter(|is_new| **is_new).count();
        assert!((1..300).contains(&new), "{new} of 501 points are new");
    }
}

/// A wheel base that is fast forward and sideways alike, and slower between the two: four wheels with rollers at 45°.
fn askew() -> PlatformBounds {
    let mut bounds = PlatformBounds::new(Limits { speed_m_s: 1.5, ..LIMITS });
    bounds.wheel_speeds = [[1.0, -1.0, -0.3], [1.0, 1.0, 0.3], [1.0, 1.0, -0.3], [1.0, -1.0, 0.3]]
        .map(|row| row.map(|part| part / 1.2))
        .to_vec();
    bounds
}

#[test]
fn a_free_heading_turns_to_where_the_wheels_are_fast() {
    let bounds = askew();
    let places = [[0.0, 0.0], [1.5, 1.5], [3.0, 3.0]].map(|[x, y]| Pose2::new(x, y, 0.0));
    let way = PiecewisePath::through(&places, JOINING).unwrap();
    let given_s = FastestTrajectory::new(way.clone(), &bounds).unwrap().duration_s();
    let free = FastestTrajectory::with_free_heading(&way, [0.0, 0.0], &bounds).unwrap();
    assert!(free.duration_s() < 0.9 * given_s, "{} s, {given_s} s with one heading", free.duration_s());
    assert!(loads(&free, &bounds) < 1.003, "{}", loads(&free, &bounds));
    for (time_s, expected) in [(0.0, places[0]), (free.duration_s(), places[2])] {
        let setpoint = free.sample(time_s);
        let Pose2 { x_m, y_m, heading_rad } = setpoint.odom_from_base;
        assert!((x_m - expected.x_m).hypot(y_m - expected.y_m) < 1e-9 && heading_rad.abs() < 1e-9);
        assert!(setpoint.twist_in_odom.speed_m_s() < 1e-6);
    }
    for at in 0..=1000 {
        let pose = free.sample(free.duration_s() * f64::from(at) / 1000.0).odom_from_base;
        assert!((pose.x_m - pose.y_m).abs() < 1e-9, "{pose:?}");
    }
    let middle = free.sample(0.5 * free.duration_s()).odom_from_base;
    let off_rad = (middle.heading_rad - std::f64::consts::FRAC_PI_4).rem_euclid(std::f64::consts::FRAC_PI_2);
    assert!(off_rad.min(std::f64::consts::FRAC_PI_2 - off_rad) < 0.2, "{middle:?}");
}

#[test]
fn a_free_heading_turns_no_more_than_it_gains() {
    // No limit asks for a heading: it stays.
    let bounds = PlatformBounds::new(LIMITS);
    let circle = ShapePath { shape: Shape::Circle { radius_m: 0.5 }, heading: Heading::Fixed, turns: 1.0 };
    let fixed_s = FastestTrajectory::new(circle, &bounds).unwrap().duration_s();
    let free = FastestTrajectory::with_free_heading(&circle, [0.3, 0.3], &bounds).unwrap();
    assert!((free.duration_s() / fixed_s - 1.0).abs() < 1e-3, "{} s, {fixed_s} s", free.duration_s());
    // One that is to be a whole turn further is the same one, and isn't turned to.
    let tangent = ShapePath { heading: Heading::FollowsTangent, ..circle };
    let free = FastestTrajectory::with_free_heading(&tangent, [0.0, std::f64::consts::TAU], &bounds).unwrap();
    assert!((free.duration_s() / fixed_s - 1.0).abs() < 1e-3, "{} s, {fixed_s} s", free.duration_s());
    assert!(free.sample(free.duration_s()).odom_from_base.heading_rad.abs() < 1e-9);
}

#[test]
fn a_small_jerk_is_kept_on_both_sides_of_each_joint() {
    let slow = PlatformBounds::new(Limits { jerk_m_s3: 10.0, angular_jerk_rad_s3: 20.0, ..LIMITS });
    for number in 0..20_u64 {
        let mut state = number;
        let mut next = |most: f64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            most * (state >> 33) as f64 / (1_u64 << 31) as f64
        };
        let points: Vec<Pose2> =
            (0..12).map(|at| Pose2::new(0.3 * f64::from(at) + next(0.15), next(0.5), next(1.0))).collect();
        let path = PiecewisePath::through(&points, Joining { corner_rad: 3.0, ..JOINING }).unwrap();
        let motion = FastestTrajectory::new(path, &slow).unwrap();
        assert!(loads(&motion, &slow) < 1.0035, "{number}: {}", loads(&motion, &slow));
    }
}

#[test]
fn a_straight_line_takes_hardly_longer_than_its_jerk_asks_for() {
    // It speeds up and brakes by a jerk of either sign alone: each takes 2·√(v/j).
    let slow = Limits { speed_m_s: 1.5, acceleration_m_s2: 6.0, jerk_m_s3: 10.0, ..LIMITS };
    let least_s = 4.0 * (1.5_f64 / 10.0).sqrt() + (2.0 - 2.0 * 1.5 * (1.5_f64 / 10.0).sqrt()) / 1.5;
    let motion = FastestTrajectory::new(line(2.0), &PlatformBounds::new(slow)).unwrap();
    let more = motion.duration_s() / least_s - 1.0;
    assert!((0.0..0.006).contains(&more), "{} s, {least_s} s at least", motion.duration_s());
}

#[test]
fn a_small_jerk_costs_little_where_wheels_bind() {
    // The mean with limits lowered took 2.2 to 4.5 % longer, with the best window of some.
    let square = PiecewisePath::through(&square(), JOINING).unwrap();
    for (jerk_m_s3, most_s) in [(20.0, 8.05), (10.0, 8.93), (5.0, 10.42)] {
        let mut bounds = with_wheels();
        bounds.limits = Limits { jerk_m_s3, angular_jerk_rad_s3: 4.0 * jerk_m_s3, ..bounds.limits };
        let motion = FastestTrajectory::new(&square, &bounds).unwrap();
        assert!(motion.duration_s() < most_s, "{jerk_m_s3} m/s³: {} s", motion.duration_s());
        assert!(loads(&motion, &bounds) < 1.0035, "{jerk_m_s3} m/s³: {}", loads(&motion, &bounds));
    }
}
