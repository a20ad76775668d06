//! The wheels' speeds of a ramp of which no complete inputs tell: by the setpoint's speed alone.
//!
//! Where a drive is lost nobody knows the platform's pose any more. A control law that goes on correcting the last pose
//! error never comes to rest; so a ramp after a loss has no feedback. What ends it is its own time.

use omnibase_platform::Kinematics;

use crate::config::RobotPlan;
use crate::controllers::saturated;
use crate::signals::{Commands, Quantity, Setpoint};

/// Leads the wheels from what they were told last to the setpoint's speed, and with it to rest.
#[derive(Clone, Debug)]
pub(crate) struct BlindRamp {
    kinematics: Kinematics,
    wheel_speed_rad_s: f64,
    /// How much a wheel's speed may change in a period, rad/s: as much as the platform's limits ask of any wheel.
    step_rad_s: f64,
}

impl BlindRamp {
    pub(crate) fn new(plan: &RobotPlan) -> Self {
        let limits = &plan.limits;
        // In base_link a turning platform's acceleration has the part w × v besides.
        let along_m_s2 = limits.acceleration_m_s2 + limits.turn_speed_rad_s * limits.speed_m_s;
        let wheels = plan.kinematics.matrix().iter().zip(plan.kinematics.wheels());
        let most_rad_s2 = wheels
            .map(|([x, y, turn], wheel)| {
                let surface_m_s2 = x.hypot(*y) * along_m_s2 + turn.abs() * limits.turn_acceleration_rad_s2;
                surface_m_s2 / wheel.radius_m
            })
            .fold(0.0, f64::max);
        BlindRamp {
            kinematics: plan.kinematics.clone(),
            wheel_speed_rad_s: limits.wheel_speed_rad_s,
            step_rad_s: most_rad_s2 * plan.bus.cycle_ns as f64 * 1e-9,
        }
    }

    /// The wheels' speeds of a cycle, from those of the cycle before.
    ///
    /// What a control law had told them beyond the setpoint's speed, to correct an error, is given up no faster than the
    /// platform's limits let a wheel brake: all wheels by the same share, so that the direction is kept.
    pub(crate) fn next(&self, last: &Commands, setpoint: &Setpoint) -> Commands {
        let twist_in_body = setpoint.twist_in_odom.rotated(-setpoint.odom_from_body.heading_rad);
        let wheels = self.kinematics.wheel_speeds_rad_s(twist_in_body);
        let mut commands = saturated(Quantity::Speed, &wheels, self.wheel_speed_rad_s);
        if last.quantity != Quantity::Speed {
            return commands;
        }
        let gaps = commands.values.iter().zip(&last.values).map(|(shall, was)| (shall - was).abs());
        let gap_rad_s = gaps.fold(0.0, f64::max);
        if gap_rad_s > self.step_rad_s {
            let share = self.step_rad_s / gap_rad_s;
            for (shall, was) in commands.values.iter_mut().zip(&last.values) {
                *shall = was + share * (*shall - was);
            }
        }
        commands
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Registry;
    use omnibase_platform::{Pose2, Twist2};

    fn plan() -> RobotPlan {
        let text = include_str!("../../../robots/bmm.toml");
        let no_files = |name: &str| Err(format!("no file {name}"));
        RobotPlan::from_toml(text, &Registry::with_built_in(), &no_files).unwrap()
    }

    #[test]
    fn a_correction_is_given_up_as_fast_as_the_limits_brake_and_no_faster() {
        let plan = plan();
        let ramp = BlindRamp::new(&plan);
        // The greatest that a controller may tell them, against a setpoint that rests already.
        let mut commands = Commands { quantity: Quantity::Speed, ..Commands::default() };
        commands.values[..3].copy_from_slice(&[15.0, -7.5, 5.0]);
        let setpoint = Setpoint::at_rest(Pose2::default());
        let mut cycles = 0;
        while commands.is_moving() {
            let before = commands;
            commands = ramp.next(&before, &setpoint);
            for wheel in 0..3 {
                let (was, is) = (before.values[wheel], commands.values[wheel]);
                assert!((was - is).abs() <= ramp.step_rad_s * (1.0 + 1e-12), "{was} to {is}");
                assert!(is.abs() <= was.abs() && is * was >= 0.0, "never away from rest, never past it");
            }
            assert!((commands.values[0] + 2.0 * commands.values[1]).abs() < 1e-9, "the direction is kept");
            cycles += 1;
            assert!(cycles < 10_000);
        }
        // 1.5 m/s² and 1.5 rad/s · 1 m/s along, 3 rad/s² about 0.4 m and more: between 30 and 60 rad/s² at a wheel.
        assert!((250..=500).contains(&cycles), "{cycles}");
    }

    #[test]
    fn a_setpoint_within_the_limits_is_followed_at_once() {
        let plan = plan();
        let ramp = BlindRamp::new(&plan);
        let mut limiter = crate::limiter::Limiter::new(&plan.limits, 1e-3).unwrap();
        let mut last = Commands { quantity: Quantity::Speed, ..Commands::default() };
        // Both at their limits, turning, then braking: no wheel lags behind.
        for cycle in 0..2500 {
            let wished = if cycle < 1200 { Twist2::new(0.6, 0.8, 1.5) } else { Twist2::default() };
            let setpoint = limiter.toward(wished);
            let told = ramp.next(&last, &setpoint);
            let unlimited = ramp.next(&Commands::default(), &setpoint);
            assert_eq!(told.values, unlimited.values, "cycle {cycle}");
            last = told;
        }
        assert!(!last.is_moving() && limiter.is_at_rest());
    }
}
