//! The same force on the body by other wheels: with more than three of them there is a choice.
//!
//! The torques of least squares are kept as long as each wheel can give its part. Where one can't they go over, only as far as need be,
//! towards those that load each wheel by the same part of what it can give: least squares again, weighted by that (Σ (τᵢ/τᵢ,most)²).

use omnibase_platform::{Kinematics, MAX_WHEELS, PerWheel, Wrench2};

/// Steps from the least torques to those by load.
const STEPS: u32 = 16;
/// Below this nothing can be told from rounding.
const SINGULAR: f64 = 1e-12;

/// What torques do at the rims.
#[derive(Clone, Debug)]
pub(super) struct Rims {
    /// The wrench on the body of 1 N at each rim.
    per_force: [[f64; 3]; MAX_WHEELS],
    radius_m: [f64; MAX_WHEELS],
}

impl Rims {
    pub(super) fn new(kinematics: &Kinematics) -> Self {
        let mut rims = Rims { per_force: [[0.0; 3]; MAX_WHEELS], radius_m: [1.0; MAX_WHEELS] };
        for (at, wheel) in kinematics.wheels().iter().enumerate() {
            rims.radius_m[at] = wheel.radius_m;
            let of_one = |other| if other == at { wheel.radius_m } else { 0.0 };
            let Wrench2 { fx_n, fy_n, torque_nm } =
                kinematics.wrench(&PerWheel::from_fn(kinematics.wheel_count(), of_one));
            rims.per_force[at] = [fx_n, fy_n, torque_nm];
        }
        rims
    }
}

/// Shares torques, N·m, anew where a wheel of more than three would have to give more than it can; the force on the body stays.
pub(super) fn share(torques_nm: &mut [f64], most_nm: &[f64], rims: &Rims) {
    let load = |torques: &[f64]| {
        torques.iter().zip(most_nm).map(|(torque, most)| torque.abs() / most).fold(0.0, f64::max)
    };
    let count = torques_nm.len();
    let least_load = load(torques_nm);
    if count <= 3 || !(least_load > 1.0 && least_load.is_finite()) {
        return;
    }
    let Some(by_load) = by_load(torques_nm, most_nm, rims) else { return };
    let mut best = (least_load, [0.0; MAX_WHEELS]);
    best.1[..count].copy_from_slice(torques_nm);
    for step in 1..=STEPS {
        let part = f64::from(step) / f64::from(STEPS);
        let mut mixed = [0.0; MAX_WHEELS];
        for (wheel, mixed) in mixed.iter_mut().enumerate().take(count) {
            *mixed = torques_nm[wheel] + part * (by_load[wheel] - torques_nm[wheel]);
        }
        let found = load(&mixed[..count]);
        if found < best.0 {
            best = (found, mixed);
        }
        if found <= 1.0 {
            break;
        }
    }
    torques_nm.copy_from_slice(&best.1[..count]);
}

/// The torques that make the same wrench with the least Σ (τᵢ/τᵢ,most)²; `None` where the wheels can't make every wrench.
fn by_load(torques_nm: &[f64], most_nm: &[f64], rims: &Rims) -> Option<[f64; MAX_WHEELS]> {
    let Rims { per_force, radius_m } = rims;
    let mut wrench = [0.0; 3];
    let mut normal = [[0.0; 3]; 3];
    for (wheel, torque) in torques_nm.iter().enumerate() {
        let (row, most_n) = (per_force[wheel], most_nm[wheel] / radius_m[wheel]);
        for a in 0..3 {
            wrench[a] += row[a] * torque / radius_m[wheel];
            for b in 0..3 {
                normal[a][b] += row[a] * row[b] * most_n * most_n;
            }
        }
    }
    let solved = solved(normal, wrench)?;
    let mut found = [0.0; MAX_WHEELS];
    for (wheel, found) in found.iter_mut().enumerate().take(torques_nm.len()) {
        let most_n = most_nm[wheel] / radius_m[wheel];
        let force: f64 = (0..3).map(|axis| per_force[wheel][axis] * solved[axis]).sum();
        *found = radius_m[wheel] * most_n * most_n * force;
    }
    Some(found)
}

/// The solution of three equations, by Cramer's rule.
fn solved(m: [[f64; 3]; 3], right: [f64; 3]) -> Option<[f64; 3]> {
    let determinant = |m: &[[f64; 3]; 3]| {
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
            + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    };
    let whole = determinant(&m);
    let size = m[0][0] * m[1][1] * m[2][2];
    let is_solvable = whole.abs() > SINGULAR * size.abs();
    if !is_solvable {
        return None;
    }
    Some([0, 1, 2].map(|column| {
        let mut replaced = m;
        for row in 0..3 {
            replaced[row][column] = right[row];
        }
        determinant(&replaced) / whole
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four Mecanum wheels at the corners of 0.6 m by 0.4 m: a rim's force stands at 45° on the body.
    fn mecanum() -> Rims {
        let mut rows = [[0.0; 3]; MAX_WHEELS];
        for (row, [x, y, side]) in
            rows.iter_mut().zip([[0.3, 0.2, -1.0], [0.3, -0.2, 1.0], [-0.3, 0.2, 1.0], [-0.3, -0.2, -1.0]])
        {
            // Along x, across by the rollers, and about the centre.
            *row = [1.0, side, x * side - y];
        }
        Rims { per_force: rows, radius_m: [0.1; MAX_WHEELS] }
    }

    fn wrench(rows: &[[f64; 3]; MAX_WHEELS], torques: &[f64]) -> [f64; 3] {
        [0, 1, 2].map(|axis| torques.iter().enumerate().map(|(n, torque)| rows[n][axis] * torque / 0.1).sum())
    }

    #[test]
    fn wheels_that_bear_more_take_over_what_a_light_one_cannot_give_and_the_force_stays() {
        let rims = mecanum();
        // Turning and pushing at once: the first wheel bears little.
        let wished = [3.0, 1.0, 1.0, 3.0];
        let most = [2.0, 6.0, 6.0, 4.5];
        let mut shared = wished;
        share(&mut shared, &most, &rims);
        let (before, after) = (wrench(&rims.per_force, &wished), wrench(&rims.per_force, &shared));
        for axis in 0..3 {
            assert!((before[axis] - after[axis]).abs() < 1e-9, "{before:?} {after:?}");
        }
        assert!(
            shared.iter().zip(&most).all(|(torque, most)| torque.abs() <= most * (1.0 + 1e-9)),
            "{shared:?}"
        );
    }

    #[test]
    fn what_every_wheel_can_give_and_three_wheels_stay_to_the_bit() {
        let rims = mecanum();
        let mut shared = [1.9, -1.0, 0.3, 4.0];
        share(&mut shared, &[2.0, 6.0, 6.0, 4.5], &rims);
        assert_eq!(shared, [1.9, -1.0, 0.3, 4.0]);
        let mut three = [5.0, 1.0, 1.0];
        share(&mut three, &[2.0, 6.0, 6.0], &rims);
        assert_eq!(three, [5.0, 1.0, 1.0]);
    }
}
