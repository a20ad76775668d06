//! Speed control with an integral part, which also takes away an error that stays.

use omnibase_platform::PerWheel;
use omnibase_platform::{Kinematics, Twist2, wrap_angle_rad};
use omnibase_robot::config::{Limits, RobotPlan};
use omnibase_robot::controllers::saturated;
use omnibase_robot::registry::{Kind, Made, Registry, needed};
use omnibase_robot::signals::{Commands, CycleTime, PlatformState, Quantity, Setpoint};
use omnibase_robot::stages::{Controller, Gain};

/// Registers it.
pub fn register(registry: &mut Registry) {
    let kind = Kind {
        name: "pi_speed",
        meaning: "Speed control with an integral part",
        keys: vec![
            needed("kp_1_s").number("Proportional gain, 1/s", 0.0..=100.0),
            needed("ki_1_s2").number("Integral gain, 1/s²", 0.0..=100.0),
        ],
    };
    registry.controllers.add(kind, Box::new(|plan| Ok(Box::new(PiSpeed::new(plan)?))));
}

/// Speed = feed-forward + Kp·e + Ki·∫e dt, per axis in odom.
#[derive(Clone, Debug)]
pub struct PiSpeed {
    kinematics: Kinematics,
    limits: Limits,
    kp_1_s: f64,
    ki_1_s2: f64,
    /// ∫e dt of x, y and heading, m·s and rad·s.
    integral: [f64; 3],
}

impl PiSpeed {
    /// The law as a plan says.
    pub fn new(plan: &RobotPlan) -> Made<Self> {
        Ok(PiSpeed {
            kinematics: plan.kinematics.clone(),
            limits: plan.limits,
            kp_1_s: plan.controller.custom.number("kp_1_s")?,
            ki_1_s2: plan.controller.custom.number("ki_1_s2")?,
            integral: [0.0; 3],
        })
    }
}

impl Controller for PiSpeed {
    fn quantity(&self) -> Quantity {
        Quantity::Speed
    }

    fn reset(&mut self) {
        self.integral = [0.0; 3];
    }

    fn update(&mut self, time: &CycleTime, state: &PlatformState, setpoint: &Setpoint) -> Commands {
        let (wished, found) = (&setpoint.odom_from_body, &state.odom_from_body);
        let error = [
            wished.x_m - found.x_m,
            wished.y_m - found.y_m,
            wrap_angle_rad(wished.heading_rad - found.heading_rad),
        ];
        let forward = setpoint.twist_in_odom;
        let correction = |axis: usize| self.kp_1_s * error[axis] + self.ki_1_s2 * self.integral[axis];
        let twist_in_odom = Twist2::new(
            forward.vx_m_s + correction(0),
            forward.vy_m_s + correction(1),
            forward.w_rad_s + correction(2),
        );
        // The command stands for a whole period: the heading in its middle counts.
        let heading_rad = found.heading_rad + 0.5 * twist_in_odom.w_rad_s * time.period_s();
        let wheels: PerWheel = self.kinematics.wheel_speeds_rad_s(twist_in_odom.rotated(-heading_rad));
        let commands = saturated(Quantity::Speed, &wheels, self.limits.wheel_speed_rad_s);
        // Anti-windup: while the wheels can't follow, the error says nothing about what lacks.
        if commands.saturation == 1.0 {
            for (integral, error) in self.integral.iter_mut().zip(error) {
                *integral += error * time.period_s();
            }
        }
        commands
    }

    fn gain(&self, index: usize) -> Option<Gain> {
        let (name, value) = match index {
            0 => ("kp_1_s", self.kp_1_s),
            1 => ("ki_1_s2", self.ki_1_s2),
            _ => return None,
        };
        Some(Gain { name, value, least: 0.0, greatest: 100.0 })
    }

    fn set_gain(&mut self, index: usize, value: f64) {
        match index {
            0 => self.kp_1_s = value,
            1 => self.ki_1_s2 = value,
            _ => {}
        }
    }
}
