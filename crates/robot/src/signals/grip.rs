//! What the wheels' torques tell of platform and floor.

use super::MAX_WHEELS;

/// How the platform answers to forces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dynamics {
    /// Mass, with the wheels, kg.
    pub mass_kg: f64,
    /// Moment of inertia about the vertical axis through base_link, with the wheels, kg·m².
    pub inertia_kg_m2: f64,
    /// Dry friction of each wheel: against its spin, and against its rollers, N.
    pub friction_n: [f64; 2],
    /// Mass times the place of the centre of mass, x and y in base_link, kg·m.
    pub mass_moment_kg_m: [f64; 2],
}

impl Dynamics {
    /// Where the centre of mass is, x and y in base_link, m.
    pub fn centre_m(&self) -> [f64; 2] {
        self.mass_moment_kg_m.map(|moment| moment / self.mass_kg)
    }

    /// The wrench that an acceleration of base_link over the floor takes, in body axes, without friction.
    pub fn wrench(&self, [ax, ay, gain]: [f64; 3], turn_rad_s: f64) -> [f64; 3] {
        let Dynamics { mass_kg, inertia_kg_m2, mass_moment_kg_m: [x, y], .. } = *self;
        let square = turn_rad_s * turn_rad_s;
        [
            mass_kg * ax - y * gain - x * square,
            mass_kg * ay + x * gain - y * square,
            inertia_kg_m2 * gain + x * ay - y * ax,
        ]
    }

    /// The acceleration of base_link over the floor that a wrench makes, likewise.
    pub fn acceleration(&self, [fx, fy, torque]: [f64; 3], turn_rad_s: f64) -> [f64; 3] {
        let Dynamics { mass_kg, inertia_kg_m2, mass_moment_kg_m: [x, y], .. } = *self;
        let square = turn_rad_s * turn_rad_s;
        let (fx, fy) = (fx + x * square, fy + y * square);
        let own_kg_m2 = inertia_kg_m2 - (x * x + y * y) / mass_kg;
        let gain = (torque - (x * fy - y * fx) / mass_kg) / own_kg_m2;
        [(fx + y * gain) / mass_kg, (fy - x * gain) / mass_kg, gain]
    }
}

/// What was found in a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GripReport {
    /// Mass, inertia and friction.
    pub dynamics: Dynamics,
    /// The standard deviation of the mass, kg.
    pub mass_sigma_kg: f64,
    /// How hard a slope may pull the platform, x and y in base_link, m/s²; 0 where the floor may be level.
    pub slope_m_s2: [f64; 2],
    /// By how much each wheel's rim is faster than the floor under it, as forces tell, m/s.
    pub slip_m_s: [f64; MAX_WHEELS],
    /// How far each wheel slipped lately, m, this time and within two seconds before; 0 where it grips.
    pub slipped_m: [f64; MAX_WHEELS],
    /// The most that a wheel pushes the floor with, over its load, whether it slips or not.
    pub felt: f64,
    /// Force that the floor gave a wheel while it slipped, over its load; `None` where none has slipped yet.
    pub friction: Option<f64>,
    /// The standard deviation of that.
    pub friction_sigma: Option<f64>,
}

impl GripReport {
    /// Whether any wheel slips.
    pub fn slips(&self) -> bool {
        self.slipped_m.iter().any(|way_m| *way_m > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrench_and_its_acceleration_are_one_anothers_inverse() {
        let dynamics = Dynamics {
            mass_kg: 170.0,
            inertia_kg_m2: 12.0,
            friction_n: [0.0; 2],
            mass_moment_kg_m: [9.0, -14.0],
        };
        let acceleration = [0.7, -0.4, 1.9];
        let back = dynamics.acceleration(dynamics.wrench(acceleration, -0.8), -0.8);
        assert!(back.iter().zip(acceleration).all(|(a, b)| (a - b).abs() < 1e-12), "{back:?}");
        // A spin about base_link: the centre of mass is drawn inwards, by m·c·w².
        assert_eq!(dynamics.wrench([0.0; 3], 2.0), [-36.0, 56.0, 0.0]);
    }
}
