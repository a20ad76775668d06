//! Speed control with an integral part: speed = feed-forward + Kp·e + Ki·∫e dt, per axis in odom.
use omnibase::prelude::*;

/// Its name, and the keys of `[controller] custom` that it reads.
pub fn kind() -> Kind {
    let kp = needed("kp_1_s").number("Proportional gain, 1/s", 0.0..=100.0);
    let ki = needed("ki_1_s2").number("Integral gain, 1/s²", 0.0..=100.0);
    Kind { name: "pi_speed", meaning: "Speed control with an integral part", keys: vec![kp, ki] }
}

/// The law, and ∫e dt of x, y and heading, m·s and rad·s.
pub struct PiSpeed {
    wheels: WheelSpeeds,
    gains: [f64; 2],
    integral: [f64; 3],
}

/// The law as a plan says.
pub fn make(plan: &RobotPlan) -> Made<PiSpeed> {
    let gains = plan.controller.custom.numbers(["kp_1_s", "ki_1_s2"])?;
    Ok(PiSpeed { wheels: WheelSpeeds::new(plan), gains, integral: [0.0; 3] })
}

impl Controller for PiSpeed {
    fn reset(&mut self) {
        self.integral = [0.0; 3];
    }

    fn update(&mut self, time: &CycleTime, state: &PlatformState, setpoint: &Setpoint) -> Commands {
        let ([kp, ki], forward) = (self.gains, axes(&setpoint.twist_in_odom));
        let error = pose_error(&setpoint.odom_from_body, &state.odom_from_body);
        let speed = std::array::from_fn(|axis| forward[axis] + kp * error[axis] + ki * self.integral[axis]);
        let commands = self.wheels.commands(speed, state.odom_from_body.heading_rad, 0.5 * time.period_s());
        // Anti-windup: while the wheels can't follow, the error says nothing about what lacks.
        if commands.saturation == 1.0 {
            self.integral = std::array::from_fn(|axis| self.integral[axis] + error[axis] * time.period_s());
        }
        commands
    }
}
