//! How weight and acceleration share out over the wheels.

/// The share of each wheel in the weight, and how it shifts when the body accelerates.
///
/// The body stands level on wheels of equal stiffness, so the load is linear in the wheel's position; for three wheels
/// that is the exact statics, for more it is the least-squares one.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadShare {
    /// Load at rest.
    pub static_n: Vec<f64>,
    /// Change of load per m/s² along the body's x axis; negative for the wheels in front.
    pub per_ax_n: Vec<f64>,
    /// The same along the body's y axis.
    pub per_ay_n: Vec<f64>,
}

/// The mass that the wheels carry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carried {
    /// Mass.
    pub mass_kg: f64,
    /// Centre of mass in `base_link`.
    pub center_m: [f64; 2],
    /// Height of the centre of mass over the floor.
    pub height_m: f64,
}

impl LoadShare {
    /// Shares for `carried` on wheels at `positions`; `None` where the wheels stand on one line.
    pub fn new(positions: &[[f64; 2]], carried: Carried) -> Option<Self> {
        let mut share = Self {
            static_n: vec![0.0; positions.len()],
            per_ax_n: vec![0.0; positions.len()],
            per_ay_n: vec![0.0; positions.len()],
        };
        share.update(positions, carried).then_some(share)
    }

    /// Recomputes the shares in place, without allocation; `false` and no change where the wheels stand on one line.
    pub fn update(&mut self, positions: &[[f64; 2]], carried: Carried) -> bool {
        let n = positions.len() as f64;
        let mean = positions.iter().fold([0.0; 2], |sum, p| [sum[0] + p[0] / n, sum[1] + p[1] / n]);
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for p in positions {
            let (x, y) = (p[0] - mean[0], p[1] - mean[1]);
            xx += x * x;
            xy += x * y;
            yy += y * y;
        }
        let determinant = xx * yy - xy * xy;
        let scale = xx.max(yy);
        // A support narrower than a thousandth of its length can't carry a moment; also refuses NaN and no wheels.
        if determinant.is_nan() || determinant <= 1e-6 * scale * scale {
            return false;
        }
        // About the mean position the three balances separate: sum, and two moments.
        let weight = carried.mass_kg * crate::floor::GRAVITY_M_S2;
        let (cx, cy) = (carried.center_m[0] - mean[0], carried.center_m[1] - mean[1]);
        let transfer = carried.mass_kg * carried.height_m;
        for (i, p) in positions.iter().enumerate() {
            let (x, y) = (p[0] - mean[0], p[1] - mean[1]);
            let per_moment_x = (yy * x - xy * y) / determinant;
            let per_moment_y = (xx * y - xy * x) / determinant;
            self.static_n[i] = weight * (1.0 / n + cx * per_moment_x + cy * per_moment_y);
            self.per_ax_n[i] = -transfer * per_moment_x;
            self.per_ay_n[i] = -transfer * per_moment_y;
        }
        true
    }

    /// Loads of the wheels under an acceleration in the body's axes, against free fall along the floor; `upright` is the
    /// share of the weight that presses on the floor. A wheel doesn't pull at the floor.
    pub fn loads_n(&self, acceleration_m_s2: [f64; 2], upright: f64) -> impl Iterator<Item = f64> + '_ {
        let shares = self.static_n.iter().zip(&self.per_ax_n).zip(&self.per_ay_n);
        shares.map(move |((static_n, per_ax_n), per_ay_n)| {
            let shift = per_ax_n * acceleration_m_s2[0] + per_ay_n * acceleration_m_s2[1];
            let load_n = static_n * upright + shift;
            if load_n > 0.0 { load_n } else { 0.0 }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loads_balance_weight_and_moments() {
        let positions = [[-0.4, 0.0], [0.2, -0.35], [0.2, 0.35]];
        let carried = Carried { mass_kg: 100.0, center_m: [0.03, -0.05], height_m: 0.4 };
        let share = LoadShare::new(&positions, carried).expect("three wheels around the centre");
        let acceleration = [1.3, -0.7];
        let loads: Vec<f64> = share.loads_n(acceleration, 1.0).collect();
        let weight = 100.0 * crate::floor::GRAVITY_M_S2;
        let sum: f64 = loads.iter().sum();
        let moment_x: f64 = loads.iter().zip(&positions).map(|(l, p)| l * p[0]).sum();
        let moment_y: f64 = loads.iter().zip(&positions).map(|(l, p)| l * p[1]).sum();
        assert!((sum - weight).abs() < 1e-9, "{sum}");
        assert!((moment_x - (weight * 0.03 - 100.0 * 0.4 * 1.3)).abs() < 1e-9, "{moment_x}");
        assert!((moment_y - (weight * -0.05 + 100.0 * 0.4 * 0.7)).abs() < 1e-9, "{moment_y}");
    }

    #[test]
    fn four_wheels_share_evenly_and_braking_loads_the_front() {
        let positions = [[0.3, 0.2], [0.3, -0.2], [-0.3, 0.2], [-0.3, -0.2]];
        let carried = Carried { mass_kg: 80.0, center_m: [0.0, 0.0], height_m: 0.3 };
        let share = LoadShare::new(&positions, carried).expect("four wheels");
        let quarter = 20.0 * crate::floor::GRAVITY_M_S2;
        assert!(share.static_n.iter().all(|n| (n - quarter).abs() < 1e-9), "{:?}", share.static_n);
        let braking = [-2.0, 0.0];
        // 80 kg · 2 m/s² · 0.3 m over a wheelbase of 0.6 m moves 80 N from the rear pair to the front pair.
        let loads: Vec<f64> = share.loads_n(braking, 1.0).collect();
        assert!((loads[0] - quarter - 40.0).abs() < 1e-9);
        assert!((loads[2] - quarter + 40.0).abs() < 1e-9);
    }

    #[test]
    fn wheels_on_one_line_carry_nothing() {
        let carried = Carried { mass_kg: 80.0, center_m: [0.0, 0.0], height_m: 0.3 };
        assert_eq!(LoadShare::new(&[[0.0, 0.1], [0.0, 0.2], [0.0, -0.3]], carried), None);
        assert_eq!(LoadShare::new(&[], carried), None);
    }
}
