//! Odometry from raw counts: exact arcs, wraps, regimes, covariance.

use omnibase_platform::layout::{bmm, omni};
use omnibase_platform::{
    BodyStep, Kinematics, Odometry, OdometryError, OdometrySettings, PerWheel, Pose2, Regime, Twist2,
};
use proptest::prelude::*;

const COUNTS_PER_REVOLUTION: u32 = 1_048_576;

fn kinematics() -> Kinematics {
    Kinematics::new(bmm(0.35, 0.30, 0.075)).unwrap()
}

fn odometry() -> Odometry {
    Odometry::new(kinematics(), OdometrySettings::direct_drive(3, COUNTS_PER_REVOLUTION)).unwrap()
}

fn apart(a: Pose2, b: Pose2) -> f64 {
    a.distance_m(b).max((a.heading_rad - b.heading_rad).abs())
}

/// Constant whole counts per sample are a constant twist, whose arc the exponential of the whole gives.
fn error_on_an_arc(samples: i32, per_sample: [i32; 3], rate_hz: f64, reference: Option<Twist2>) -> f64 {
    let mut odometry = odometry();
    let start = [i32::MAX - 1000, i32::MIN + 10, 123_456];
    for sample in 0..=samples {
        let counts = PerWheel::from_fn(3, |at| start[at].wrapping_add(sample * per_sample[at]));
        odometry.update(&counts, 1.0 / rate_hz, reference).unwrap();
    }
    let rad = std::f64::consts::TAU / f64::from(COUNTS_PER_REVOLUTION);
    let angles = PerWheel::from_fn(3, |at| f64::from(samples) * f64::from(per_sample[at]) * rad);
    let (whole, _) = kinematics().body_step(&angles);
    let mut found = odometry.state().odom_from_base;
    found.heading_rad = odometry.state().turned_rad;
    apart(found, whole.exp())
}

#[test]
fn an_exact_arc_is_met_at_1_khz_100_hz_and_20_hz() {
    // 20 s, wheels at about 3, -1 and -4 rad/s: 0.3 m/s and 0.16 rad/s.
    for (samples, divisor, rate_hz) in [(20_000, 50, 1000.0), (2000, 5, 100.0), (400, 1, 20.0)] {
        let per_sample = [25_000 / divisor, -8_300 / divisor, -33_350 / divisor];
        let error = error_on_an_arc(samples, per_sample, rate_hz, None);
        assert!(error <= 1e-9, "{error:e} m at {rate_hz} Hz, integrated");
        let twist = Twist2::new(-0.13, 0.2, 0.06);
        let error = error_on_an_arc(samples, per_sample, rate_hz, Some(twist));
        assert!(error <= 1e-9, "{error:e} m at {rate_hz} Hz, in closed form");
        println!("{rate_hz} Hz: {error:e} m");
    }
}

#[test]
fn a_sample_that_came_too_soon_is_refused_and_its_way_is_not_lost() {
    let mut odometry = odometry();
    odometry.update(&[0, 0, 0].counts(), 1e-3, None).unwrap();
    let refused = odometry.update(&[500, 500, 500].counts(), 1e-7, None).map(|_| ());
    assert_eq!(refused, Err(OdometryError::Period { found_s: 1e-7 }));
    for period_s in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(odometry.update(&[500, 500, 500].counts(), period_s, None).is_err());
    }
    assert_eq!(odometry.state().odom_from_base, Pose2::default());
    odometry.update(&[1000, 1000, 1000].counts(), 1e-3, None).unwrap();
    let way = 1000.0 * std::f64::consts::TAU / f64::from(COUNTS_PER_REVOLUTION) * 0.075;
    assert!((odometry.state().turned_rad + 3.0 * way / 0.95).abs() < 1e-15);
}

trait Counts {
    fn counts(self) -> PerWheel<i32>;
}

impl Counts for [i32; 3] {
    fn counts(self) -> PerWheel<i32> {
        PerWheel::from_fn(3, |at| self[at])
    }
}

/// Drives a twist for some samples with exact angles; returns the regimes seen.
fn drive(odometry: &mut Odometry, twist_in_base: Twist2, samples: u32, period_s: f64) -> Vec<Regime> {
    let speeds = kinematics().wheel_speeds_rad_s(twist_in_base);
    let mut regimes = Vec::new();
    for _ in 0..samples {
        let regime = odometry
            .advance(&speeds.map(|speed| speed * period_s), period_s, Some(twist_in_base))
            .unwrap()
            .regime;
        if regimes.last() != Some(&regime) {
            regimes.push(regime);
        }
    }
    regimes
}

#[test]
fn holonomic_regimes_are_recognised_and_shown() {
    let mut odometry = odometry();
    let mut expected = Pose2::default();
    for (twist, regime) in [
        (Twist2::new(0.0, 0.0, 0.0), Regime::Standstill),
        (Twist2::new(0.3, -0.2, 0.0), Regime::Translation),
        (Twist2::new(-0.1, 0.4, 0.0), Regime::Translation),
        (Twist2::new(0.0, 0.0, 0.5), Regime::Rotation),
        (Twist2::new(0.3, 0.1, 0.4), Regime::Tangent),
        (Twist2::new(0.3, 0.1, -0.4), Regime::Tangent),
        (Twist2::new(0.0, 0.0, -0.5), Regime::Rotation),
    ] {
        let seen = drive(&mut odometry, twist, 2000, 1e-3);
        assert_eq!(seen.last(), Some(&regime), "{twist:?}: {seen:?}");
        expected = expected.moved_by(twist.over(2.0));
        let found = Pose2 { heading_rad: odometry.state().turned_rad, ..odometry.state().odom_from_base };
        assert!(apart(found, expected) < 1e-9, "{regime:?}: {:e}", apart(found, expected));
    }
}

#[test]
fn both_reference_and_measurement_must_say_so() {
    let mut odometry = odometry();
    let still = PerWheel::from([0.0; 3]);
    let told = Some(Twist2::new(0.3, 0.0, 0.0));
    assert_eq!(odometry.advance(&still, 1e-3, told).unwrap().regime, Regime::Other, "told, but blocked");
    let pushed = kinematics().wheel_speeds_rad_s(Twist2::new(0.3, 0.0, 0.0)).map(|speed| speed * 1e-3);
    for _ in 0..200 {
        odometry.advance(&pushed, 1e-3, Some(Twist2::default())).unwrap();
    }
    assert_eq!(odometry.state().regime, Regime::Other, "pushed, not told");
    odometry.advance(&pushed, 1e-3, None).unwrap();
    assert_eq!(odometry.state().regime, Regime::Other, "nobody says what was told");
}

/// A sum that keeps what rounding takes away (Knuth's two-sum).
#[derive(Clone, Copy, Default)]
struct Sum {
    high: f64,
    low: f64,
}

impl Sum {
    fn add(&mut self, value: f64) {
        let sum = self.high + value;
        let of_value = sum - self.high;
        self.low += (self.high - (sum - of_value)) + (value - of_value);
        self.high = sum;
    }
}

/// Mixed motion, the same every 20 s: straight, round, turning on the spot, at rest, and slowly bending between them.
fn mixed(time_s: f64) -> Twist2 {
    let phase = time_s % 20.0;
    let (slow, fast) = ((0.37 * phase).sin(), (2.9 * phase).cos());
    match phase as u32 {
        0..3 => Twist2::new(0.3, 0.02 * slow, 1e-3 * slow),
        3..7 => Twist2::new(0.3, 0.1, 0.4 + 0.008 * slow),
        7..9 => Twist2::new(0.0, 5e-4, 0.5),
        9..10 => Twist2::default(),
        10..15 => Twist2::new(0.3 * fast, 0.25, 0.0019 * fast),
        _ => Twist2::new(0.2, -0.3 * fast, 0.6 * slow),
    }
}

/// How far the pose is from that by arcs whose sums keep every bit, after so many samples of 1 ms: m, and rad.
fn off_exact(samples: u32) -> [f64; 2] {
    let (mut odometry, kinematics) = (odometry(), kinematics());
    let [mut x, mut y, mut heading] = [Sum::default(); 3];
    for sample in 0..samples {
        let told = mixed(f64::from(sample) * 1e-3);
        let angles = kinematics.wheel_speeds_rad_s(told).map(|speed| speed * 1e-3);
        odometry.advance(&angles, 1e-3, Some(told)).unwrap();
        let (step, _) = kinematics.body_step(&angles);
        let from = Pose2 { x_m: 0.0, y_m: 0.0, heading_rad: heading.high + heading.low };
        let moved = from.moved_by(step);
        x.add(moved.x_m);
        y.add(moved.y_m);
        heading.add(step.angle_rad);
    }
    let state = odometry.state();
    let away_m = (state.odom_from_base.x_m - x.high).hypot(state.odom_from_base.y_m - y.high);
    [away_m, (state.turned_rad - heading.high - heading.low).abs()]
}

#[test]
fn every_motion_is_met_within_a_nanometre_in_20_s_and_a_micrometre_in_an_hour() {
    for (samples, most_m) in [(20_000, 1e-9), (3_600_000, 1e-6)] {
        let [away_m, turned_rad] = off_exact(samples);
        println!("{samples} samples: {away_m:e} m, {turned_rad:e} rad off the exact arcs");
        assert!(away_m < most_m && turned_rad < most_m, "{samples}: {away_m:e} m, {turned_rad:e} rad");
    }
}

#[test]
fn speeds_are_the_filtered_derivative() {
    let mut odometry = odometry();
    let increment = PerWheel::from([0.002; 3]);
    let keep = f64::exp(-50.0 * 1e-3);
    odometry.advance(&increment, 1e-3, None).unwrap();
    assert!((odometry.state().wheel_speeds_rad_s[0] - (1.0 - keep) * 2.0).abs() < 1e-15);
    odometry.advance(&increment, 1e-3, None).unwrap();
    assert!((odometry.state().wheel_speeds_rad_s[0] - (1.0 - keep * keep) * 2.0).abs() < 1e-15);
}

fn eigenvalues(covariance: [[f64; 3]; 3]) -> [f64; 3] {
    let matrix = nalgebra::Matrix3::from_fn(|row, column| covariance[row][column]);
    matrix.symmetric_eigenvalues().into()
}

#[test]
fn covariance_grows_with_motion_and_slip_and_is_never_zero() {
    let mut odometry = odometry();
    let start = odometry.state().covariance;
    assert!(eigenvalues(start).into_iter().all(|value| value > 0.0));
    drive(&mut odometry, Twist2::default(), 1000, 1e-3);
    assert_eq!(odometry.state().covariance, start, "standing still adds nothing");
    drive(&mut odometry, Twist2::new(0.5, 0.0, 0.0), 2000, 1e-3);
    let fast_sampled = odometry.state().covariance;
    assert!(fast_sampled[1][1] > fast_sampled[0][0], "heading errors count across the way");
    let mut slow = self::odometry();
    drive(&mut slow, Twist2::new(0.5, 0.0, 0.0), 20, 0.1);
    for (axis, row) in fast_sampled.iter().enumerate() {
        let ratio = slow.state().covariance[axis][axis] / row[axis];
        assert!((ratio - 1.0).abs() < 0.1, "axis {axis}: {ratio}: the rate of samples hardly matters");
    }

    let four = Kinematics::new(omni(4, 0.4, 0.1, std::f64::consts::FRAC_PI_4)).unwrap();
    let mut settings = OdometrySettings::direct_drive(4, COUNTS_PER_REVOLUTION);
    let mut grip = Odometry::new(four.clone(), settings).unwrap();
    let mut slip = grip.clone();
    for _ in 0..100 {
        let mut angles = four.wheel_speeds_rad_s(Twist2::new(0.5, 0.0, 0.0)).map(|speed| speed * 1e-3);
        grip.advance(&angles, 1e-3, None).unwrap();
        angles[0] += 1e-3;
        slip.advance(&angles, 1e-3, None).unwrap();
    }
    assert!(grip.state().slip_residual_m_s < 1e-12);
    assert!((slip.state().slip_residual_m_s - 0.05).abs() < 1e-12);
    assert!(slip.state().covariance[0][0] > 2.0 * grip.state().covariance[0][0]);

    settings.covariance.initial_m2 = 0.0;
    assert!(Odometry::new(four, settings).is_err());
}

#[test]
fn resync_keeps_the_pose_and_takes_the_next_sample_as_origin() {
    let mut odometry = odometry();
    odometry.update(&[0, 0, 0].counts(), 1e-3, None).unwrap();
    odometry.update(&[100, 200, -300].counts(), 1e-3, None).unwrap();
    let before = odometry.state().odom_from_base;
    odometry.resync();
    odometry.update(&[-1_000_000_000, 5, i32::MIN].counts(), 1e-3, None).unwrap();
    assert_eq!(odometry.state().odom_from_base, before);
    odometry.set_pose(Pose2::new(1.0, 2.0, 7.0));
    assert!((odometry.state().odom_from_base.heading_rad - (7.0 - std::f64::consts::TAU)).abs() < 1e-15);
}

proptest! {
    /// Any first value and any place of the wrap: the same bits of pose.
    #[test]
    fn the_first_value_and_the_wrap_make_no_difference(
        first in any::<[i32; 3]>(),
        increments in proptest::collection::vec([-40_000..40_000i32, -40_000..40_000i32, -40_000..40_000i32], 1..300),
    ) {
        let (mut plain, mut shifted) = (odometry(), odometry());
        let mut counts = [0i32; 3];
        plain.update(&counts.counts(), 1e-3, None).unwrap();
        shifted.update(&first.counts(), 1e-3, None).unwrap();
        prop_assert_eq!(shifted.state().odom_from_base, Pose2::default(), "the first sample is the origin");
        for increment in increments {
            for at in 0..3 {
                counts[at] = counts[at].wrapping_add(increment[at]);
            }
            let there = PerWheel::from_fn(3, |at| first[at].wrapping_add(counts[at]));
            plain.update(&counts.counts(), 1e-3, None).unwrap();
            let before = shifted.state().odom_from_base;
            shifted.update(&there, 1e-3, None).unwrap();
            prop_assert_eq!(shifted.state(), plain.state());
            prop_assert!(before.distance_m(shifted.state().odom_from_base) < 0.025, "no jump");
        }
    }

    /// Arcs compose: two halves of a step are the whole.
    #[test]
    fn an_arc_is_the_same_in_two_halves(x in -2.0..2.0, y in -2.0..2.0, angle in -6.0..6.0) {
        let half = BodyStep::new(x / 2.0, y / 2.0, angle / 2.0);
        let whole = BodyStep::new(x, y, angle).exp();
        prop_assert!(apart(half.exp().moved_by(half), whole) < 1e-14);
    }
}
