//! How uncertain the pose is.

use nalgebra::{Matrix3, Vector3};

use crate::kinematics::Kinematics;
use crate::se2::{BodyStep, Pose2, Twist2};
use crate::wheel::{MAX_WHEELS, PerWheel};

/// By how much motion makes the pose uncertain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CovarianceSettings {
    /// The variance of each coordinate at start, in m²; never zero.
    pub initial_m2: f64,
    /// The variance of the heading at start, in rad².
    pub initial_rad2: f64,
    /// Added to each coordinate per metre moved, in m²/m.
    pub position_per_m: f64,
    /// Added to each coordinate per radian turned, in m²/rad.
    pub position_per_rad: f64,
    /// Added to each coordinate per metre of slip residual, in m²/m.
    pub position_per_slip: f64,
    /// Added to the heading per metre moved, in rad²/m.
    pub heading_per_m: f64,
    /// Added to the heading per radian turned, in rad²/rad.
    pub heading_per_rad: f64,
    /// Added to the heading per metre of slip residual, in rad²/m.
    pub heading_per_slip: f64,
    /// Standard deviation of each wheel's true rolling radius, over the radius: an error that stays.
    pub radius_share: f64,
}

/// By how much motion may make a pose uncertain at most: what a way must count with that is still to be driven.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseGrowth {
    /// What is added to variances.
    pub variances: CovarianceSettings,
    /// What stays as it is adds to standard deviations: of each coordinate, per metre moved, in m/m.
    pub position_per_m: f64,
    /// Likewise per radian turned, in m/rad.
    pub position_per_rad: f64,
    /// Of the heading, per metre moved, in rad/m.
    pub heading_per_m: f64,
    /// Likewise per radian turned, in rad/rad.
    pub heading_per_rad: f64,
}

impl Default for PoseGrowth {
    /// That of the default settings, on wheels whose radii are known exactly.
    fn default() -> Self {
        PoseGrowth {
            variances: CovarianceSettings::default(),
            position_per_m: 0.0,
            position_per_rad: 0.0,
            heading_per_m: 0.0,
            heading_per_rad: 0.0,
        }
    }
}

impl Default for CovarianceSettings {
    /// 1 mm of standard deviation per metre (what the thesis measured over manoeuvres of metres), 3 mrad per turn, and
    /// radii known to one in a thousand.
    fn default() -> Self {
        CovarianceSettings {
            initial_m2: 1e-8,
            initial_rad2: 1e-8,
            position_per_m: 1e-6,
            position_per_rad: 1e-7,
            position_per_slip: 1e-2,
            heading_per_m: 1e-6,
            heading_per_rad: 1.5e-6,
            heading_per_slip: 1e-2,
            radius_share: 1e-3,
        }
    }
}

impl CovarianceSettings {
    /// The settings with their names, for checks.
    pub(super) fn named(&self) -> [(&'static str, f64); 9] {
        [
            ("initial_m2", self.initial_m2),
            ("initial_rad2", self.initial_rad2),
            ("position_per_m", self.position_per_m),
            ("position_per_rad", self.position_per_rad),
            ("position_per_slip", self.position_per_slip),
            ("heading_per_m", self.heading_per_m),
            ("heading_per_rad", self.heading_per_rad),
            ("heading_per_slip", self.heading_per_slip),
            ("radius_share", self.radius_share),
        ]
    }

    pub(super) fn initial(&self) -> Matrix3<f64> {
        Matrix3::from_diagonal(&[self.initial_m2, self.initial_m2, self.initial_rad2].into())
    }

    /// The covariance after a step from one pose to the next, both in odom.
    ///
    /// A wrong heading turns the way that follows: the Jacobian of the motion carries it into x and y. What is
    /// added is proportional to the way, not to time or to the square of each step, so that the rate of the
    /// samples makes no difference.
    pub(super) fn grown(
        &self,
        covariance: &Matrix3<f64>,
        (from, to): (Pose2, Pose2),
        (step, residual_m): (BodyStep, f64),
    ) -> Matrix3<f64> {
        let carry = carry(from, to);
        let (way_m, turn_rad) = (step.distance_m(), step.angle_rad.abs());
        let position = self.position_per_m * way_m
            + self.position_per_rad * turn_rad
            + self.position_per_slip * residual_m;
        let heading =
            self.heading_per_m * way_m + self.heading_per_rad * turn_rad + self.heading_per_slip * residual_m;
        let mut grown = carry * covariance * carry.transpose();
        grown[(0, 0)] += position;
        grown[(1, 1)] += position;
        grown[(2, 2)] += heading;
        // Rounding must not make it drift away from symmetry over hours.
        (grown + grown.transpose()) * 0.5
    }
}

/// How errors of a pose are carried along to the next one: a wrong heading turns the way.
fn carry(from: Pose2, to: Pose2) -> Matrix3<f64> {
    let (dx, dy) = (to.x_m - from.x_m, to.y_m - from.y_m);
    Matrix3::new(1.0, 0.0, -dy, 0.0, 1.0, dx, 0.0, 0.0, 1.0)
}

/// What wrong radii make of the pose: an error that stays, so that it grows with the way and not with its root.
#[derive(Clone, Debug)]
pub(super) struct RadiusErrors {
    wheels: usize,
    /// The body's step for a radian of each wheel, in m and rad.
    steps: [Vector3<f64>; MAX_WHEELS],
    /// The error of the pose in odom for a radius that is wrong by itself, in m and rad.
    errors: [Vector3<f64>; MAX_WHEELS],
}

impl RadiusErrors {
    pub(super) fn new(kinematics: &Kinematics) -> RadiusErrors {
        let wheels = kinematics.wheel_count();
        let mut steps = [Vector3::zeros(); MAX_WHEELS];
        for (wheel, slot) in steps.iter_mut().enumerate().take(wheels) {
            let alone = PerWheel::from_fn(wheels, |at| if at == wheel { 1.0 } else { 0.0 });
            let twist = kinematics.twist(&alone).twist_in_base;
            *slot = Vector3::new(twist.vx_m_s, twist.vy_m_s, twist.w_rad_s);
        }
        RadiusErrors { wheels, steps, errors: [Vector3::zeros(); MAX_WHEELS] }
    }

    pub(super) fn reset(&mut self) {
        self.errors = [Vector3::zeros(); MAX_WHEELS];
    }

    pub(super) fn advance(&mut self, increments_rad: &PerWheel, (from, to): (Pose2, Pose2)) {
        let carry = carry(from, to);
        let (sin, cos) = (0.5 * (from.heading_rad + to.heading_rad)).sin_cos();
        for ((error, step), increment_rad) in
            self.errors.iter_mut().zip(&self.steps).zip(increments_rad.iter())
        {
            let [x, y, turn] = [step[0], step[1], step[2]].map(|value| value * increment_rad);
            *error = carry * *error + Vector3::new(cos * x - sin * y, sin * x + cos * y, turn);
        }
    }

    /// Their part of the pose's covariance.
    pub(super) fn covariance(&self, radius_share: f64) -> Matrix3<f64> {
        let all = self.errors.iter().take(self.wheels);
        all.fold(Matrix3::zeros(), |sum, error| sum + error * error.transpose())
            * (radius_share * radius_share)
    }

    /// By how much they and all else may make a pose more uncertain.
    pub(super) fn growth(&self, kinematics: &Kinematics, settings: &CovarianceSettings) -> PoseGrowth {
        let turned = |twist: Twist2| kinematics.wheel_speeds_rad_s(twist);
        let [ahead, aside, around] =
            [Twist2::new(1.0, 0.0, 0.0), Twist2::new(0.0, 1.0, 0.0), Twist2::new(0.0, 0.0, 1.0)].map(turned);
        let sum = |size: fn(&Vector3<f64>) -> f64, turned: &dyn Fn(usize) -> f64| {
            let square = |wheel: usize| (size(&self.steps[wheel]) * turned(wheel)).powi(2);
            settings.radius_share * (0..self.wheels).map(square).sum::<f64>().sqrt()
        };
        let way: fn(&Vector3<f64>) -> f64 = |step| step[0].hypot(step[1]);
        let turn: fn(&Vector3<f64>) -> f64 = |step| step[2].abs();
        // In the direction in which a wheel turns furthest.
        let per_m = |wheel: usize| ahead[wheel].hypot(aside[wheel]);
        let per_rad = |wheel: usize| around[wheel].abs();
        PoseGrowth {
            variances: *settings,
            position_per_m: sum(way, &per_m),
            position_per_rad: sum(way, &per_rad),
            heading_per_m: sum(turn, &per_m),
            heading_per_rad: sum(turn, &per_rad),
        }
    }
}
