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

    /// Wheels around a body of 40 kg, its centre of mass 0.25 m high, on a floor of friction 0.4.
    struct Body {
        rims: Rims,
        count: usize,
        /// Where they stand, m.
        places: Vec<[f64; 2]>,
    }

    const RADIUS_M: f64 = 0.1;

    impl Body {
        /// Omni wheels on a circle, tangential.
        fn round(count: usize) -> Body {
            let places: Vec<[f64; 2]> = (0..count)
                .map(|at| (std::f64::consts::TAU * (at as f64 + 0.5) / count as f64).sin_cos())
                .map(|(sin, cos)| [0.3 * cos, 0.3 * sin])
                .collect();
            let mut per_force = [[0.0; 3]; MAX_WHEELS];
            per_force.iter_mut().zip(&places).for_each(|(row, [x, y])| *row = [-y / 0.3, x / 0.3, 0.3]);
            Body { rims: Rims { per_force, radius_m: [RADIUS_M; MAX_WHEELS] }, count, places }
        }

        fn mecanum() -> Body {
            let places = vec![[0.3, 0.2], [0.3, -0.2], [-0.3, 0.2], [-0.3, -0.2]];
            Body { rims: mecanum(), count: 4, places }
        }

        /// What each wheel can give at an acceleration, which shifts loads, N·m.
        fn most_nm(&self, acceleration: [f64; 2]) -> Vec<f64> {
            let squares = [0, 1].map(|axis| self.places.iter().map(|place| place[axis].powi(2)).sum::<f64>());
            let shift = |place: &[f64; 2]| -> f64 {
                (0..2).map(|axis| acceleration[axis] * place[axis] / squares[axis]).sum()
            };
            let load_n = |place| 40.0 * (9.81 / self.count as f64 - 0.25 * shift(place));
            self.places.iter().map(|place| 0.4 * RADIUS_M * load_n(place).max(1e-6)).collect()
        }

        /// The greatest acceleration in a direction at which every wheel grips, m/s², as torques are shared.
        fn most_m_s2(&self, along: [f64; 3], shared: impl Fn(&mut [f64], &[f64])) -> f64 {
            let (mut grips, mut slips) = (0.0, 20.0);
            for _ in 0..40 {
                let a: f64 = 0.5 * (grips + slips);
                let most = self.most_nm([along[0] * a, along[1] * a]);
                let mut torques = self.least([40.0 * along[0] * a, 40.0 * along[1] * a, 2.0 * along[2] * a]);
                shared(&mut torques, &most);
                let is_gripping = torques.iter().zip(&most).all(|(torque, most)| torque.abs() <= *most);
                *(if is_gripping { &mut grips } else { &mut slips }) = a;
            }
            grips
        }

        /// The torques of least squares that make a wrench.
        fn least(&self, wrench: [f64; 3]) -> Vec<f64> {
            let rows = &self.rims.per_force[..self.count];
            let normal = [0, 1, 2].map(|a| [0, 1, 2].map(|b| rows.iter().map(|row| row[a] * row[b]).sum()));
            let solved = solved(normal, wrench).unwrap();
            rows.iter()
                .map(|row| RADIUS_M * (0..3).map(|axis| row[axis] * solved[axis]).sum::<f64>())
                .collect()
        }
    }

    /// What docs/control.md shows: `cargo test -p omnibase-robot --lib sharing -- --nocapture`.
    #[test]
    fn wheels_grip_at_greater_accelerations_than_by_least_squares_alone() {
        println!(
            "wheels              least squares: least, mean   by load where needed: least, mean   gain: mean, most"
        );
        for (name, body, gain) in [
            ("3 omni", Body::round(3), 1.0),
            ("4 mecanum", Body::mecanum(), 1.1),
            ("4 omni", Body::round(4), 1.1),
            ("6 omni", Body::round(6), 1.1),
            ("8 omni", Body::round(8), 1.1),
        ] {
            let mut found: Vec<[f64; 2]> = Vec::new();
            // Directions over the floor, and turning meanwhile: by so many rad/s² for each m/s².
            for turn in [0.0, 1.0, -2.0] {
                for at in 0..72 {
                    let (sin, cos) = (std::f64::consts::TAU * f64::from(at) / 72.0).sin_cos();
                    let alone = body.most_m_s2([cos, sin, turn], |_, _| {});
                    let ours =
                        body.most_m_s2([cos, sin, turn], |torques, most| share(torques, most, &body.rims));
                    assert!(ours > alone * (1.0 - 1e-9), "{name}: {ours} {alone}");
                    found.push([alone, ours]);
                }
            }
            let least = [0, 1].map(|at| found.iter().map(|pair| pair[at]).fold(f64::INFINITY, f64::min));
            let mean = [0, 1].map(|at| found.iter().map(|pair| pair[at]).sum::<f64>() / found.len() as f64);
            let gains: Vec<f64> = found.iter().map(|pair| pair[1] / pair[0]).collect();
            let most = gains.iter().copied().fold(0.0, f64::max);
            let mean_gain = gains.iter().sum::<f64>() / gains.len() as f64;
            println!(
                "{name:<18} {:>17.2}, {:.2} m/s² {:>23.2}, {:.2} m/s² {:>12.1} %, {:.1} %",
                least[0],
                mean[0],
                least[1],
                mean[1],
                100.0 * (mean_gain - 1.0),
                100.0 * (most - 1.0)
            );
            assert!(most >= gain, "{name}: {most}");
        }
    }
}
