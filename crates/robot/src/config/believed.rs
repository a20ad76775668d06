//! What is believed of motors and masses before anything was measured.

use std::f64::consts::TAU;

use super::drive_plan::DriveScale;
use super::plan::RobotPlan;
use crate::signals::MAX_WHEELS;

/// A wheel with its rotor and gear where the file doesn't say, as a mass at its rim: this, kg, or such a part of the first
/// estimate of the mass, whichever is less.
const WHEEL_KG: f64 = 2.0;
const WHEEL_SHARE: f64 = 1.0 / 35.0;
/// Bounds of an estimate without bounds of its own, over its first value.
pub(crate) const ESTIMATE_BOUNDS: [f64; 2] = [1.0 / 3.0, 3.0];

/// A wheel of a platform with its rotor and gear, as a mass at its rim, kg.
pub(crate) fn wheel_kg(plan: &RobotPlan, mass_kg: f64) -> f64 {
    let radius_m = plan.kinematics.wheels().iter().map(|wheel| wheel.radius_m).fold(f64::INFINITY, f64::min);
    let assumed_kg = WHEEL_KG.min(WHEEL_SHARE * mass_kg);
    plan.controller.wheel_inertia_kg_m2.map_or(assumed_kg, |inertia| inertia / (radius_m * radius_m))
}

/// The motors' rated torques at the wheels, N·m.
pub(crate) fn rated_nm(plan: &RobotPlan) -> [f64; MAX_WHEELS] {
    let mut rated_nm = [0.0; MAX_WHEELS];
    for (rated_nm, drive) in rated_nm.iter_mut().zip(&plan.drives) {
        *rated_nm = drive.scale.rated_torque_nm * drive.scale.gear_ratio;
    }
    rated_nm
}

/// The farthest that a rim goes by a count of its encoder, m.
pub(crate) fn rim_per_count_m(plan: &RobotPlan) -> f64 {
    let rims = plan.kinematics.wheels().iter().zip(&plan.drives);
    rims.map(|(wheel, drive)| {
        let DriveScale { counts_per_revolution, gear_ratio, .. } = drive.scale;
        TAU * wheel.radius_m / (f64::from(counts_per_revolution) * gear_ratio.abs())
    })
    .fold(0.0, f64::max)
}
