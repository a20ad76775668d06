//! What is still wrong with wheels that were found, where the truth is known.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use omnibase_platform::{Kinematics, LayoutError, PerWheel, Pose2, Twist2, Wheel, wrap_angle_rad};

use crate::build::{Build, SensorMount, Tolerances};
use crate::unknown::Unknown;

/// What is wrong with a wheel that was found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WheelErrors {
    /// Its radius, as a share.
    pub radius_share: f64,
    /// Its direction, rad.
    pub direction_rad: f64,
    /// Its place across its force, m.
    pub across_m: f64,
}

/// By how much wheels are changed to see what that does to the platform.
const NUDGE: f64 = 1e-6;

impl WheelErrors {
    /// Found wheels against the true ones; `true_from_found` is where the base frame of the found ones is in the true one, for
    /// which of a body's frames is called base is nobody's truth.
    pub fn of(found: &[Wheel], truth: &[Wheel], true_from_found: Pose2) -> Vec<WheelErrors> {
        let angle = |wheel: &Wheel| wheel.force_direction[1].atan2(wheel.force_direction[0]);
        let errors = found.iter().zip(truth).map(|(found, truth)| {
            let place = true_from_found.then(Pose2::new(found.position_m[0], found.position_m[1], 0.0));
            let (here, there) = (angle(found) + true_from_found.heading_rad, angle(truth));
            let (dx, dy) = (place.x_m - truth.position_m[0], place.y_m - truth.position_m[1]);
            WheelErrors {
                radius_share: found.radius_m / truth.radius_m - 1.0,
                direction_rad: wrap_angle_rad(here - there),
                across_m: dx * there.sin() - dy * there.cos(),
            }
        });
        errors.collect()
    }

    /// The part of errors that moves the platform: the least ones, in tolerances, that make the same of every motion in which the
    /// wheels don't contradict each other. With three wheels that is all of them; four and more have others, by which they
    /// only contradict each other.
    pub fn that_move(
        errors: &[WheelErrors],
        wheels: &[Wheel],
        tolerances: &Tolerances,
    ) -> Result<Vec<WheelErrors>, LayoutError> {
        let (mut unknowns, mut amounts) = (Vec::new(), Vec::new());
        for (wheel, error) in errors.iter().enumerate() {
            unknowns.extend([Unknown::Radius(wheel), Unknown::Direction(wheel), Unknown::Across(wheel)]);
            amounts.extend([error.radius_share, error.direction_rad, error.across_m]);
        }
        let sigmas: Vec<f64> = unknowns.iter().map(|unknown| unknown.sigma(tolerances)).collect();
        let by_tolerance = motions(wheels, &unknowns, &sigmas)?;
        let scaled = amounts.iter().zip(&sigmas).map(|(amount, sigma)| amount / sigma);
        let all = DVector::from_iterator(unknowns.len(), scaled);
        let shown = &by_tolerance * &all;
        let inverse = by_tolerance.pseudo_inverse(1e-9).unwrap_or_else(|_| DMatrix::zeros(all.len(), 9));
        let moving = inverse * shown;
        let error = |wheel: usize| {
            let at = |row: usize| moving[3 * wheel + row] * sigmas[3 * wheel + row];
            WheelErrors { radius_share: at(0), direction_rad: at(1), across_m: at(2) }
        };
        Ok((0..errors.len()).map(error).collect())
    }
}

/// What changes of a platform's motion by each unknown at its tolerance, column by column: nine numbers, the motion of the platform
/// where it should do one of each axis.
fn motions(wheels: &[Wheel], unknowns: &[Unknown], sigmas: &[f64]) -> Result<DMatrix<f64>, LayoutError> {
    let build = Build {
        wheels: wheels.to_vec(),
        creep: 0.0,
        roller_resistance: 0.0,
        sensor: SensorMount::default(),
        gyro_scale: 0.0,
    };
    let nominal = Kinematics::new(wheels.to_vec())?;
    let motion = |build: &Build| -> Result<Matrix3<f64>, LayoutError> {
        let kinematics = Kinematics::new(build.wheels.clone())?;
        let axes = [Twist2::new(1.0, 0.0, 0.0), Twist2::new(0.0, 1.0, 0.0), Twist2::new(0.0, 0.0, 1.0)];
        let columns = axes.map(|wished| {
            let speeds: PerWheel = nominal.wheel_speeds_rad_s(wished);
            let Twist2 { vx_m_s, vy_m_s, w_rad_s } = kinematics.twist(&speeds).twist_in_base;
            Vector3::new(vx_m_s, vy_m_s, w_rad_s)
        });
        Ok(Matrix3::from_columns(&columns))
    };
    let mut by_tolerance = DMatrix::zeros(9, unknowns.len());
    for (column, (unknown, sigma)) in unknowns.iter().zip(sigmas).enumerate() {
        let mut nudged = build.clone();
        unknown.add_to(&mut nudged, &build, NUDGE);
        let change = (motion(&nudged)? - motion(&build)?) * (sigma / NUDGE);
        by_tolerance.set_column(column, &DVector::from_column_slice(change.as_slice()));
    }
    Ok(by_tolerance)
}

/// Directions, in tolerances, of radii, directions and places across forces that move nothing: there are none with three wheels.
pub(crate) fn contradictions(
    build: &Build,
    unknowns: &[Unknown],
    sigmas: &DVector<f64>,
) -> Vec<DVector<f64>> {
    let is_of_wheel = |unknown: &Unknown| {
        matches!(unknown, Unknown::Radius(_) | Unknown::Direction(_) | Unknown::Across(_))
    };
    let places: Vec<usize> = (0..unknowns.len()).filter(|at| is_of_wheel(&unknowns[*at])).collect();
    let own: Vec<Unknown> = places.iter().map(|at| unknowns[*at]).collect();
    let own_sigmas: Vec<f64> = places.iter().map(|at| sigmas[*at]).collect();
    let Ok(motions) = motions(&build.wheels, &own, &own_sigmas) else { return Vec::new() };
    let eigen = (motions.transpose() * motions).symmetric_eigen();
    let greatest = eigen.eigenvalues.max();
    let still = (0..own.len()).filter(|at| eigen.eigenvalues[*at] < 1e-9 * greatest);
    let spread = |column: usize| {
        let mut direction = DVector::zeros(unknowns.len());
        for (place, part) in places.iter().zip(eigen.eigenvectors.column(column).iter()) {
            direction[*place] = *part;
        }
        direction
    };
    still.map(spread).collect()
}
