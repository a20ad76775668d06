//! The covariance against wheels that truly are others, by finite differences and along whole ways.

use nalgebra::{Matrix3, Vector3};
use omnibase_platform::layout::{bmm, mecanum4, omni};
use omnibase_platform::{
    BodyStep, CovarianceSettings, GeometrySigmas, Kinematics, Odometry, OdometrySettings, OdometryState,
    Pose2, Twist2, Wheel,
};

const PERIOD_S: f64 = 1e-3;
/// Small against all else: what is checked is what stays.
const NONE: f64 = 1e-15;

fn layouts() -> [Vec<Wheel>; 2] {
    [bmm(0.38, 0.40, 0.10), mecanum4(0.24, 0.21, 0.076)]
}

fn odometry(wheels: Vec<Wheel>, geometry: GeometrySigmas) -> Odometry {
    let kinematics = Kinematics::new(wheels).unwrap();
    let count = kinematics.wheel_count();
    let covariance = CovarianceSettings {
        initial_m2: NONE,
        initial_rad2: NONE,
        position_per_m: NONE,
        position_per_rad: NONE,
        heading_per_m: NONE,
        heading_per_rad: NONE,
        geometry,
        ..CovarianceSettings::default()
    };
    let settings = OdometrySettings { covariance, ..OdometrySettings::direct_drive(count, 4096) };
    Odometry::new(kinematics, settings).unwrap()
}

/// Straight, round and turning on the spot, never the same for long.
fn wandering(time_s: f64) -> Twist2 {
    let [a, b, c] = [0.7, 1.1, 0.45].map(|rate: f64| (rate * time_s).sin());
    Twist2::new(0.4 + 0.2 * a, 0.3 * b, 0.8 * c)
}

/// There and back on a straight line, without a turn.
fn there_and_back(time_s: f64) -> Twist2 {
    let sign = if time_s < 2.0 { 1.0 } else { -1.0 };
    Twist2::new(0.5 * sign, 0.2 * sign, 0.0)
}

/// Drives odometry by the wheels that turn as a layout says.
fn driven(mut odometry: Odometry, layout: &[Wheel], way: fn(f64) -> Twist2, seconds: f64) -> OdometryState {
    let kinematics = Kinematics::new(layout.to_vec()).unwrap();
    for sample in 0..(seconds / PERIOD_S) as u32 {
        let speeds = kinematics.wheel_speeds_rad_s(way(f64::from(sample) * PERIOD_S));
        odometry.advance(&speeds.map(|speed| speed * PERIOD_S), PERIOD_S, None).unwrap();
    }
    *odometry.state()
}

fn covariance(state: &OdometryState) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| state.covariance[row][column])
}

fn turned([x, y]: [f64; 2], angle_rad: f64) -> [f64; 2] {
    let (sin, cos) = angle_rad.sin_cos();
    [cos * x - sin * y, sin * x + cos * y]
}

type Change = fn(&mut Wheel, f64);

/// What can be wrong with a wheel, and the standard deviations that speak of nothing else.
fn errors() -> [(&'static str, Vec<Change>, GeometrySigmas); 3] {
    let none = GeometrySigmas { radius_share: NONE, direction_rad: NONE, position_m: NONE };
    let direction: Change = |wheel, by| {
        wheel.rolling_direction = turned(wheel.rolling_direction, by);
        wheel.force_direction = turned(wheel.force_direction, by);
    };
    [
        (
            "radius",
            vec![|wheel, by| wheel.radius_m *= 1.0 + by],
            GeometrySigmas { radius_share: 1.0, ..none },
        ),
        ("direction", vec![direction], GeometrySigmas { direction_rad: 1.0, ..none }),
        (
            "place",
            vec![|wheel, by| wheel.position_m[0] += by, |wheel, by| wheel.position_m[1] += by],
            GeometrySigmas { position_m: 1.0, ..none },
        ),
    ]
}

/// Where a platform goes whose wheels turn as one layout says and are as the other says: treads share out what they contradict
/// each other by, each giving way by its hub's speed (loads and rims are alike in these layouts where wheels are four).
fn gone(layout: &[Wheel], truly: &[Wheel], way: fn(f64) -> Twist2, seconds: f64) -> Vector3<f64> {
    let told = Kinematics::new(layout.to_vec()).unwrap();
    let rows = Kinematics::new(truly.to_vec()).unwrap();
    let (mut pose, mut turned_rad) = (Pose2::default(), 0.0);
    for sample in 0..(seconds / PERIOD_S) as u32 {
        let twist = way(f64::from(sample) * PERIOD_S);
        let speeds = told.wheel_speeds_rad_s(twist);
        let (mut resists, mut pushed) = (Matrix3::zeros(), Vector3::zeros());
        for ((wheel, row), speed) in truly.iter().zip(rows.matrix()).zip(speeds.iter()) {
            let hub = twist.at(Pose2::new(wheel.position_m[0], wheel.position_m[1], 0.0));
            let row = Vector3::from(*row);
            resists += row * row.transpose() / hub.speed_m_s();
            pushed += row * (wheel.radius_m * speed / hub.speed_m_s());
        }
        let step = resists.try_inverse().unwrap() * pushed * PERIOD_S;
        pose = Pose2 { heading_rad: turned_rad, ..pose }.moved_by(BodyStep::new(step.x, step.y, step.z));
        turned_rad += step.z;
    }
    Vector3::new(pose.x_m, pose.y_m, turned_rad)
}

#[test]
fn what_wrong_wheels_make_of_the_pose_is_what_treads_that_share_it_do() {
    // Central differences of 1e-6 have an error of 1e-12, and of 1e-9 by rounding; steps of 1 ms leave 1e-7. Where a hub goes
    // differently for another wheel is of second order.
    const BY: f64 = 1e-6;
    for layout in layouts() {
        for (name, changes, sigmas) in errors() {
            let found = covariance(&driven(odometry(layout.clone(), sigmas), &layout, wandering, 12.0));
            let mut expected = Matrix3::zeros();
            for (wheel, change) in (0..layout.len()).flat_map(|wheel| changes.iter().map(move |c| (wheel, c)))
            {
                let off = [BY, -BY].map(|by| {
                    let mut other = layout.clone();
                    change(&mut other[wheel], by);
                    gone(&layout, &other, wandering, 12.0)
                });
                let slope = (off[0] - off[1]) / (2.0 * BY);
                expected += slope * slope.transpose();
            }
            let apart = (found - expected).norm() / expected.norm();
            assert!(apart < 1e-6, "{name}, {} wheels: {apart:e}: {found} for {expected}", layout.len());
            assert!(expected.norm() > 1e-3, "{name} counts");
        }
    }
}

#[test]
fn on_the_way_back_what_wrong_radii_made_is_taken_back() {
    for layout in layouts() {
        let odometry = odometry(layout.clone(), GeometrySigmas::default());
        let there = driven(odometry.clone(), &layout, there_and_back, 2.0);
        let back = driven(odometry, &layout, there_and_back, 4.0);
        assert!(there.covariance[0][0].sqrt() > 1e-3 && there.covariance[2][2].sqrt() > 1e-3, "{there:?}");
        let left = [0, 1, 2].map(|axis| back.covariance[axis][axis].sqrt());
        assert!(left.iter().all(|sigma| *sigma < 1e-7), "{left:?}");
    }
}

#[test]
fn errors_of_wheels_begin_anew_where_the_pose_is_set() {
    let [layout, _] = layouts();
    let kinematics = Kinematics::new(layout.clone()).unwrap();
    let mut odometry = odometry(layout, GeometrySigmas::default());
    let step = kinematics.wheel_speeds_rad_s(Twist2::new(0.5, 0.0, 0.3)).map(|speed| speed * PERIOD_S);
    let drive = |odometry: &mut Odometry| {
        for _ in 0..2000 {
            odometry.advance(&step, PERIOD_S, None).unwrap();
        }
        covariance(odometry.state())
    };
    let first = drive(&mut odometry);
    odometry.set_pose(Default::default());
    assert!(covariance(odometry.state()).norm() < 1e-14, "{}", covariance(odometry.state()));
    assert!((drive(&mut odometry) - first).norm() < 1e-12 * first.norm(), "what is wrong with them stays");
}

#[test]
fn wheels_that_contradict_each_other_as_tolerances_let_them_do_not_slip() {
    let [_, layout] = layouts();
    let sigmas = GeometrySigmas::default();
    let by_file =
        || Odometry::new(Kinematics::new(layout.clone()).unwrap(), OdometrySettings::direct_drive(4, 4096));
    let straight = |_| Twist2::new(0.5, 0.0, 0.0);
    // One radius too great by two standard deviations, and by twenty.
    let [alike, within, beyond] = [0.0, 2.0, 20.0].map(|deviations| {
        let mut other = layout.clone();
        other[0].radius_m *= 1.0 + deviations * sigmas.radius_share;
        let state = driven(by_file().unwrap(), &other, straight, 2.0);
        assert_eq!(state.slip_residual_m_s > 1e-4, deviations > 0.0, "{state:?}");
        state.covariance[2][2]
    });
    assert!((within / alike - 1.0).abs() < 0.02, "{within} and {alike}");
    assert!(beyond > 3.0 * alike, "{beyond} and {alike}");
}

/// Standard deviation in the direction in which it is greatest, m, and of the heading, rad.
fn spread(state: &OdometryState) -> [f64; 2] {
    let [[xx, xy, _], [_, yy, _], [_, _, hh]] = state.covariance;
    [(0.5 * (xx + yy) + (0.5 * (xx - yy)).hypot(xy)).sqrt(), hh.sqrt()]
}

/// Those of [`layouts`], wheels whose loads differ, and five.
fn all_kinds() -> [Vec<Wheel>; 4] {
    let [three, four] = layouts();
    let mut uneven = four.clone();
    for (wheel, place) in uneven.iter_mut().zip([[0.30, 0.25], [-0.1, 0.2], [0.25, -0.30], [-0.25, -0.15]]) {
        wheel.position_m = place;
    }
    [three, four, uneven, omni(5, 0.3, 0.06, 0.2)]
}

#[test]
fn growth_bounds_each_step_whatever_its_hubs_do() {
    for layout in all_kinds() {
        let kinematics = Kinematics::new(layout.clone()).unwrap();
        let mut greatest = [0.0_f64; 2];
        for (_, _, sigmas) in errors() {
            let start = odometry(layout.clone(), sigmas);
            let growth = start.growth();
            // About each place near the platform, and none of them further than some metres.
            for (angle, away) in (0..90).flat_map(|angle| (0..60).map(move |away| (angle, away))) {
                let (sin, cos) = (f64::from(angle) * std::f64::consts::TAU / 90.0).sin_cos();
                let away_m = 1.15_f64.powi(away - 40);
                let twist = Twist2::new(away_m * cos, away_m * sin, 1.0);
                let step = kinematics.wheel_speeds_rad_s(twist).map(|speed| speed * PERIOD_S);
                let mut odometry = start.clone();
                odometry.advance(&step, PERIOD_S, None).unwrap();
                let found = spread(odometry.state());
                let per_m = [growth.position_per_m, growth.heading_per_m];
                let per_rad = [growth.position_per_rad, growth.heading_per_rad];
                for at in 0..2 {
                    let turned = (found[at] / PERIOD_S - per_m[at] * away_m) / per_rad[at];
                    greatest[at] = greatest[at].max(turned);
                    assert!(turned < 1.0 + 1e-5, "{at} {twist:?}: {turned} of the bound");
                }
            }
        }
        println!("{} wheels: at most {greatest:?} of what a radian may add", layout.len());
        assert!(greatest.iter().all(|share| *share > 0.35), "not far from what there is: {greatest:?}");
    }
}

#[test]
fn growth_bounds_what_any_way_adds() {
    for layout in all_kinds() {
        let kinematics = Kinematics::new(layout.clone()).unwrap();
        let settings = OdometrySettings::direct_drive(kinematics.wheel_count(), 4096);
        let mut tightest = [0.0_f64; 2];
        let by_default = Odometry::new(kinematics.clone(), settings).unwrap();
        let starts = [by_default, odometry(layout.clone(), GeometrySigmas::default())];
        // What stays is hidden by what chance adds, where there is any.
        for (number, start) in (0..60).flat_map(|number| starts.iter().map(move |start| (number, start))) {
            let angle = 0.4 * f64::from(number);
            let turn_rad_s = [0.0, 0.5, -2.0, 6.0, 1.6][number as usize % 5];
            let twist = Twist2::new(0.5 * angle.cos(), 0.5 * angle.sin(), turn_rad_s);
            let mut odometry = start.clone();
            let growth = odometry.growth();
            let added = growth.variances;
            // After other ways of all lengths: what is there already may add to what comes.
            for sample in 0..number * 48 {
                let speeds = kinematics.wheel_speeds_rad_s(wandering(f64::from(sample) * PERIOD_S));
                odometry.advance(&speeds.map(|speed| speed * PERIOD_S), PERIOD_S, None).unwrap();
            }
            let [position_m, heading_rad] = spread(odometry.state());
            let (mut way_m, mut turn_rad) = (0.0, 0.0);
            for _ in 0..600 {
                let step = kinematics.wheel_speeds_rad_s(twist).map(|speed| speed * PERIOD_S);
                odometry.advance(&step, PERIOD_S, None).unwrap();
                way_m += twist.speed_m_s() * PERIOD_S;
                turn_rad += turn_rad_s.abs() * PERIOD_S;
                let most_rad =
                    (heading_rad.powi(2) + added.heading_per_m * way_m + added.heading_per_rad * turn_rad)
                        .sqrt()
                        + growth.heading_per_m * way_m
                        + growth.heading_per_rad * turn_rad;
                let most_m =
                    (position_m.powi(2) + added.position_per_m * way_m + added.position_per_rad * turn_rad)
                        .sqrt()
                        + way_m * most_rad
                        + growth.position_per_m * way_m
                        + growth.position_per_rad * turn_rad;
                let found = spread(odometry.state());
                for (at, (found, most)) in found.into_iter().zip([most_m, most_rad]).enumerate() {
                    assert!(
                        found <= most * (1.0 + 1e-9),
                        "{at} {twist:?} after {way_m} m: {found} of {most}"
                    );
                    tightest[at] = tightest[at].max(found / most);
                }
            }
        }
        println!("{} wheels: at most {tightest:?} of the bound", layout.len());
        assert!(tightest.iter().all(|share| *share > 0.6), "not far from what there is: {tightest:?}");
    }
}

#[test]
fn any_covariance_can_be_one() {
    for layout in layouts() {
        let state = driven(odometry(layout.clone(), GeometrySigmas::default()), &layout, wandering, 60.0);
        let eigenvalues = covariance(&state).symmetric_eigenvalues();
        assert!(eigenvalues.iter().all(|value| *value > -1e-18), "{eigenvalues}");
    }
}
