//! What a controller believes of the body: mass, inertia and friction.

use crate::se2::{Twist2, Wrench2};

/// Friction of the platform as a whole, at its centre.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Friction {
    /// Coulomb friction against translation, in N.
    pub coulomb_n: f64,
    /// Coulomb friction against rotation, in N·m.
    pub coulomb_nm: f64,
    /// Viscous friction against translation, in N per m/s.
    pub viscous_n_s_m: f64,
    /// Viscous friction against rotation, in N·m per rad/s.
    pub viscous_nm_s: f64,
}

/// Mass, moment of inertia and friction; the centre of mass is taken at the origin of base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DynamicsModel {
    /// The mass, in kg.
    pub mass_kg: f64,
    /// The moment of inertia about the vertical axis, in kg·m².
    pub inertia_kg_m2: f64,
    /// Friction.
    pub friction: Friction,
}

/// Why a model was refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum DynamicsError {
    /// Mass or inertia that is no positive number.
    #[error("{setting} is {found}, expected a positive number")]
    NotPositive {
        /// Which setting.
        setting: &'static str,
        /// What was found.
        found: f64,
    },
    /// Friction that is negative or no number.
    #[error("{setting} is {found}, expected zero or a positive number")]
    Negative {
        /// Which setting.
        setting: &'static str,
        /// What was found.
        found: f64,
    },
}

/// Below these speeds Coulomb friction is taken as proportional to speed, for its sign would chatter.
const COULOMB_FULL_AT_M_S: f64 = 0.005;
const COULOMB_FULL_AT_RAD_S: f64 = 0.01;

impl DynamicsModel {
    /// Refuses numbers that no body has.
    pub fn check(&self) -> Result<(), DynamicsError> {
        for (setting, found) in [("mass_kg", self.mass_kg), ("inertia_kg_m2", self.inertia_kg_m2)] {
            if !(found.is_finite() && found > 0.0) {
                return Err(DynamicsError::NotPositive { setting, found });
            }
        }
        let Friction { coulomb_n, coulomb_nm, viscous_n_s_m, viscous_nm_s } = self.friction;
        for (setting, found) in [
            ("coulomb_n", coulomb_n),
            ("coulomb_nm", coulomb_nm),
            ("viscous_n_s_m", viscous_n_s_m),
            ("viscous_nm_s", viscous_nm_s),
        ] {
            if !(found.is_finite() && found >= 0.0) {
                return Err(DynamicsError::Negative { setting, found });
            }
        }
        Ok(())
    }

    /// The wrench that friction puts on the body at a twist; in the twist's frame, against it.
    pub fn friction_wrench(&self, twist: Twist2) -> Wrench2 {
        let friction = &self.friction;
        let speed_m_s = twist.speed_m_s();
        // Force per speed, so that no direction need be divided out at standstill.
        let per_speed = friction.viscous_n_s_m + friction.coulomb_n / speed_m_s.max(COULOMB_FULL_AT_M_S);
        let per_rate =
            friction.viscous_nm_s + friction.coulomb_nm / twist.w_rad_s.abs().max(COULOMB_FULL_AT_RAD_S);
        Wrench2::new(-per_speed * twist.vx_m_s, -per_speed * twist.vy_m_s, -per_rate * twist.w_rad_s)
    }

    /// The wrench that gives an acceleration (m/s², rad/s², as the rate of a twist in a fixed frame) at a twist.
    ///
    /// Both in the same fixed frame (odom), where M·Z̈ = F holds without gyroscopic terms.
    pub fn wrench_in_odom(&self, acceleration_in_odom: Twist2, twist_in_odom: Twist2) -> Wrench2 {
        let friction = self.friction_wrench(twist_in_odom);
        Wrench2 {
            fx_n: self.mass_kg * acceleration_in_odom.vx_m_s - friction.fx_n,
            fy_n: self.mass_kg * acceleration_in_odom.vy_m_s - friction.fy_n,
            torque_nm: self.inertia_kg_m2 * acceleration_in_odom.w_rad_s - friction.torque_nm,
        }
    }

    /// The acceleration in odom that a wrench gives at a twist; the inverse of [`DynamicsModel::wrench_in_odom`].
    pub fn acceleration_in_odom(&self, wrench_in_odom: Wrench2, twist_in_odom: Twist2) -> Twist2 {
        let friction = self.friction_wrench(twist_in_odom);
        Twist2 {
            vx_m_s: (wrench_in_odom.fx_n + friction.fx_n) / self.mass_kg,
            vy_m_s: (wrench_in_odom.fy_n + friction.fy_n) / self.mass_kg,
            w_rad_s: (wrench_in_odom.torque_nm + friction.torque_nm) / self.inertia_kg_m2,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MODEL: DynamicsModel = DynamicsModel {
        mass_kg: 180.0,
        inertia_kg_m2: 12.0,
        friction: Friction { coulomb_n: 20.0, coulomb_nm: 4.0, viscous_n_s_m: 10.0, viscous_nm_s: 1.0 },
    };

    #[test]
    fn wrench_and_acceleration_are_inverse_and_friction_opposes() {
        let (acceleration, twist) = (Twist2::new(0.3, -0.2, 0.5), Twist2::new(-0.4, 0.3, 0.2));
        let back = MODEL.acceleration_in_odom(MODEL.wrench_in_odom(acceleration, twist), twist);
        assert!((back.vx_m_s - 0.3).abs() < 1e-14 && (back.w_rad_s - 0.5).abs() < 1e-14);
        let friction = MODEL.friction_wrench(twist);
        assert!((friction.fx_n.hypot(friction.fy_n) - (20.0 + 10.0 * 0.5)).abs() < 1e-12);
        assert!(friction.fx_n > 0.0 && friction.fy_n < 0.0 && friction.torque_nm < 0.0);
        assert_eq!(MODEL.friction_wrench(Twist2::default()).fx_n.abs(), 0.0);
    }

    #[test]
    fn impossible_bodies_are_refused() {
        assert_eq!(MODEL.check(), Ok(()));
        assert!(DynamicsModel { mass_kg: 0.0, ..MODEL }.check().is_err());
        assert!(DynamicsModel { inertia_kg_m2: f64::NAN, ..MODEL }.check().is_err());
        let friction = Friction { viscous_nm_s: -1.0, ..MODEL.friction };
        assert!(
            DynamicsModel { friction, ..MODEL }
                .check()
                .unwrap_err()
                .to_string()
                .contains("viscous_nm_s is -1")
        );
    }
}
