//! How uncertain the pose is.

use nalgebra::Matrix3;

use super::geometry::GeometrySigmas;
use crate::se2::{BodyStep, Pose2};

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
    /// Added to each coordinate per metre of slip that contradicts the other wheels, in m²/m.
    pub position_per_slip: f64,
    /// Added to the heading per metre moved, in rad²/m.
    pub heading_per_m: f64,
    /// Added to the heading per radian turned, in rad²/rad.
    pub heading_per_rad: f64,
    /// Added to the heading per metre of slip that contradicts the other wheels, in rad²/m.
    pub heading_per_slip: f64,
    /// How well the wheels are known: errors that stay.
    pub geometry: GeometrySigmas,
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
    /// That of the default settings, on wheels that are known exactly.
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
            geometry: GeometrySigmas::default(),
        }
    }
}

impl CovarianceSettings {
    /// The settings with their names, for checks.
    pub(super) fn named(&self) -> [(&'static str, f64); 11] {
        [
            ("initial_m2", self.initial_m2),
            ("initial_rad2", self.initial_rad2),
            ("position_per_m", self.position_per_m),
            ("position_per_rad", self.position_per_rad),
            ("position_per_slip", self.position_per_slip),
            ("heading_per_m", self.heading_per_m),
            ("heading_per_rad", self.heading_per_rad),
            ("heading_per_slip", self.heading_per_slip),
            ("radius_share", self.geometry.radius_share),
            ("direction_rad", self.geometry.direction_rad),
            ("position_m", self.geometry.position_m),
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
        from: Pose2,
        to: Pose2,
        step: BodyStep,
        slip_m: f64,
    ) -> Matrix3<f64> {
        let (way_m, turn_rad) = (step.distance_m(), step.angle_rad.abs());
        let position =
            self.position_per_m * way_m + self.position_per_rad * turn_rad + self.position_per_slip * slip_m;
        let heading =
            self.heading_per_m * way_m + self.heading_per_rad * turn_rad + self.heading_per_slip * slip_m;
        let mut grown = carried(covariance, from, to);
        grown[(0, 0)] += position;
        grown[(1, 1)] += position;
        grown[(2, 2)] += heading;
        // Rounding must not make it drift away from symmetry over hours.
        (grown + grown.transpose()) * 0.5
    }
}

/// C·P·Cᵀ with C = [1 0 −dy; 0 1 dx; 0 0 1]: how errors of a pose are carried along to the next one, for a wrong heading turns the way.
fn carried(covariance: &Matrix3<f64>, from: Pose2, to: Pose2) -> Matrix3<f64> {
    let turned = [from.y_m - to.y_m, to.x_m - from.x_m];
    let mut carried = *covariance;
    for (axis, turned) in turned.into_iter().enumerate() {
        for other in 0..3 {
            carried[(axis, other)] += turned * covariance[(2, other)];
        }
    }
    for (axis, turned) in turned.into_iter().enumerate() {
        for other in 0..3 {
            carried[(other, axis)] += turned * carried[(other, 2)];
        }
    }
    carried
}
