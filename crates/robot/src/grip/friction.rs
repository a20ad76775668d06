//! What friction of the wheels costs at a speed: a feed-forward with two forces that are learnt.
//!
//! Every driven wheel resists in two ways: its spin (bearing, seals, rolling) against b·ξ, and the rollers that
//! touch the floor against q·ξ, their own turning, with q = t − (u·t)/(a·u)·a and t ⟂ a.
//!
//! Both are dry friction, as each wheel's load is, so with the platform's twist ξ in body axes and a wheel's
//! load over the mean n the wrench that makes up for them is F = c_spin·Σ n·sat(b·ξ/v₀)·b + c_roller·Σ
//! n·sat(q·ξ/v₀)·q. It depends on the wish alone: no feedback, nothing to ring.

use omnibase_platform::{Kinematics, MAX_WHEELS};

use super::loads::Loads;

/// Speed below which dry friction is taken to grow in proportion, m/s: a command near rest must not jump.
pub(crate) const DRY_M_S: f64 = 0.005;

/// The wheels' rows, in body axes.
#[derive(Clone, Debug)]
pub(crate) struct WheelFriction {
    spin: [[f64; 3]; MAX_WHEELS],
    roller: [[f64; 3]; MAX_WHEELS],
    loads: Loads,
    wheels: usize,
}

impl WheelFriction {
    pub(crate) fn new(kinematics: &Kinematics) -> Self {
        let mut friction = WheelFriction {
            spin: [[0.0; 3]; MAX_WHEELS],
            roller: [[0.0; 3]; MAX_WHEELS],
            loads: Loads::new(kinematics),
            wheels: kinematics.wheel_count(),
        };
        for (index, (wheel, row)) in kinematics.wheels().iter().zip(kinematics.matrix()).enumerate() {
            let unit = |[x, y]: [f64; 2]| [x / x.hypot(y), y / x.hypot(y)];
            let ([ux, uy], [ax, ay]) = (unit(wheel.rolling_direction), unit(wheel.force_direction));
            let (tx, ty) = (-ay, ax);
            let spin_per_along = (ux * tx + uy * ty) / (ax * ux + ay * uy);
            let (qx, qy) = (tx - spin_per_along * ax, ty - spin_per_along * ay);
            let [x, y] = wheel.position_m;
            friction.spin[index] = *row;
            friction.roller[index] = [qx, qy, x * qy - y * qx];
        }
        friction
    }

    /// The wrenches of 1 N on every wheel of mean load at a twist, in body axes, with the centre of mass at a place, m: against
    /// spin, and against the rollers.
    pub(crate) fn per_newton(&self, twist: [f64; 3], centre_m: [f64; 2]) -> [[f64; 3]; 2] {
        let sum = |rows: &[[f64; 3]; MAX_WHEELS]| {
            rows[..self.wheels].iter().enumerate().fold([0.0; 3], |sum, (wheel, row)| {
                let speed: f64 = row.iter().zip(twist).map(|(part, speed)| part * speed).sum();
                let sign = self.loads.of(wheel, centre_m) * (speed / DRY_M_S).clamp(-1.0, 1.0);
                std::array::from_fn(|axis| sum[axis] + sign * row[axis])
            })
        };
        [sum(&self.spin), sum(&self.roller)]
    }

    /// What axles and rollers that stand may hold, whatever the wrench, beyond what [`WheelFriction::per_newton`] counts with: of
    /// 1 N on every wheel of mean load, by axis. Rollers of a mecanum wheel stand where it drives straight ahead.
    pub(crate) fn held_per_newton(&self, twist: [f64; 3], centre_m: [f64; 2]) -> [[f64; 3]; 2] {
        let sum = |rows: &[[f64; 3]; MAX_WHEELS]| {
            rows[..self.wheels].iter().enumerate().fold([0.0; 3], |sum, (wheel, row)| {
                let speed: f64 = row.iter().zip(twist).map(|(part, speed)| part * speed).sum();
                let part = self.loads.of(wheel, centre_m) * (1.0 - (speed / DRY_M_S).abs()).max(0.0);
                std::array::from_fn(|axis| sum[axis] + part * row[axis].abs())
            })
        };
        [sum(&self.spin), sum(&self.roller)]
    }

    /// The wrench of 1 N against the rollers of each wheel, whichever way they turn.
    pub(crate) fn rollers(&self) -> &[[f64; 3]] {
        &self.roller[..self.wheels]
    }

    /// The square of what nobody knows of such a wrench near rest, where dry friction has no direction: of 1 N on every wheel,
    /// by axis, all of it at 0 and none from this speed of a wheel on, m/s.
    pub(crate) fn unknown_per_newton(&self, twist: [f64; 3], until_m_s: f64) -> [f64; 3] {
        let rows = self.spin[..self.wheels].iter().chain(&self.roller[..self.wheels]);
        rows.fold([0.0; 3], |sum, row| {
            let speed: f64 = row.iter().zip(twist).map(|(part, speed)| part * speed).sum();
            let part = (1.0 - speed.abs() / until_m_s).max(0.0);
            std::array::from_fn(|axis| sum[axis] + (part * row[axis]).powi(2))
        })
    }

    /// Mean distance of the wheels' lines of force from the centre, m: by what a force becomes a moment.
    pub(crate) fn lever_m(&self) -> f64 {
        let square: f64 = self.spin[..self.wheels].iter().map(|row| row[2] * row[2]).sum();
        let along: f64 = self.spin[..self.wheels].iter().map(|row| row[0] * row[0] + row[1] * row[1]).sum();
        (square / along).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use omnibase_platform::layout;

    #[test]
    fn friction_of_an_omni_wheel_opposes_along_and_across() {
        let kinematics = Kinematics::new(layout::omni(3, 0.4, 0.1, 0.0)).unwrap();
        let friction = WheelFriction::new(&kinematics);
        assert!((friction.lever_m() - 0.4).abs() < 1e-12);
        // Turning on the spot only the wheels spin: 3 N at 0.4 m.
        let [spin, roller] = friction.per_newton([0.0, 0.0, 1.0], [0.0; 2]);
        assert!(
            (spin[2] - 1.2).abs() < 1e-12 && roller.iter().all(|part| part.abs() < 1e-9),
            "{spin:?} {roller:?}"
        );
        // What friction takes is work: never negative, whatever the twist (a fan of 64 directions).
        for step in 0..64 {
            let (sin, cos) = (f64::from(step) * 0.1).sin_cos();
            let twist = [0.5 * cos, 0.5 * sin, 0.7 * (sin - cos)];
            for wrench in friction.per_newton(twist, [0.1, -0.05]) {
                let power: f64 = wrench.iter().zip(twist).map(|(force, speed)| force * speed).sum();
                assert!(power >= 0.0, "{twist:?}: {power}");
            }
        }
    }

    #[test]
    fn rollers_of_a_mecanum_wheel_turn_when_it_drives_straight() {
        let friction = WheelFriction::new(&Kinematics::new(layout::mecanum4(0.24, 0.21, 0.076)).unwrap());
        let [spin, roller] = friction.per_newton([0.3, 0.0, 0.0], [0.0; 2]);
        // Straight ahead the axle alone turns: its rollers stand where they touch the floor.
        assert!((spin[0] - 4.0).abs() < 1e-12, "{spin:?}");
        assert!(roller.iter().all(|part| part.abs() < 1e-9), "{roller:?}");
        // So they hold what would turn it, 1 N·√2 at 0.24 m each, or push it sideways; and nothing along the way.
        let [axles, rollers] = friction.held_per_newton([0.3, 0.0, 0.0], [0.0; 2]);
        assert!(axles.iter().all(|part| part.abs() < 1e-9), "{axles:?}");
        let root = 4.0 * 2.0_f64.sqrt();
        assert!(rollers[0] < 1e-9 && (rollers[1] - root).abs() < 1e-9, "{rollers:?}");
        assert!((rollers[2] - 0.24 * root).abs() < 1e-9, "{rollers:?}");
        // Sideways both turn: the rollers by √2 of the speed.
        let [spin, roller] = friction.per_newton([0.0, 0.3, 0.0], [0.0; 2]);
        assert!(
            (spin[1] - 4.0).abs() < 1e-12 && (roller[1] - 4.0 * 2.0_f64.sqrt()).abs() < 1e-9,
            "{roller:?}"
        );
    }
}
