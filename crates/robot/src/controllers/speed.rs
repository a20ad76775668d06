//! Speed control: by the reference alone, or with the pose error fed back.

use omnibase_platform::{Kinematics, Twist2};

use super::{LEAD_PERIODS, axes, pose_error, saturated, within_speed};
use crate::config::{Limits, RobotPlan, WheelLimits};
use crate::signals::{Commands, CycleTime, PlatformState, Quantity, Setpoint};
use crate::stages::{Controller, Gain};

/// Wheel speeds = B/R · Rot(ψ)ᵀ · reference speed; the pose error is never looked at.
#[derive(Clone, Debug)]
pub struct OpenLoop {
    kinematics: Kinematics,
    wheel_speed_rad_s: f64,
}

impl OpenLoop {
    /// The law as a plan says.
    pub fn new(plan: &RobotPlan) -> Self {
        OpenLoop { kinematics: plan.kinematics.clone(), wheel_speed_rad_s: plan.limits.wheel_speed_rad_s }
    }
}

impl Controller for OpenLoop {
    fn quantity(&self) -> Quantity {
        Quantity::Speed
    }

    fn reset(&mut self) {}

    fn limit_wheels(&mut self, limits: &WheelLimits) {
        self.wheel_speed_rad_s = limits.speed_rad_s;
    }

    fn update(&mut self, time: &CycleTime, _: &PlatformState, setpoint: &Setpoint) -> Commands {
        // The reference's own heading: what isn't measured can't be wrong. Its middle over the coming period, for
        // the command stands for a whole one.
        let heading_rad =
            setpoint.odom_from_body.heading_rad + 0.5 * setpoint.twist_in_odom.w_rad_s * time.period_s();
        let twist_in_body = setpoint.twist_in_odom.rotated(-heading_rad);
        let wheels = self.kinematics.wheel_speeds_rad_s(twist_in_body);
        saturated(Quantity::Speed, &wheels, self.wheel_speed_rad_s)
    }

    fn gain(&self, _: usize) -> Option<Gain> {
        None
    }

    fn set_gain(&mut self, _: usize, _: f64) {}
}

/// Speed = feed-forward + Kp · (pose error in odom, angle wrapped). Thesis 8.20.
#[derive(Clone, Debug)]
pub struct ClosedLoopSpeed {
    kinematics: Kinematics,
    limits: Limits,
    kp_1_s: [f64; 3],
}

const KP_1_S: [f64; 3] = [8.0; 3];
const KP_NAMES: [&str; 3] = ["kp_x_1_s", "kp_y_1_s", "kp_heading_1_s"];

impl ClosedLoopSpeed {
    /// The law as a plan says.
    pub fn new(plan: &RobotPlan) -> Self {
        ClosedLoopSpeed {
            kinematics: plan.kinematics.clone(),
            limits: plan.limits,
            kp_1_s: plan.controller.kp_1_s.unwrap_or(KP_1_S),
        }
    }
}

impl Controller for ClosedLoopSpeed {
    fn quantity(&self) -> Quantity {
        Quantity::Speed
    }

    fn reset(&mut self) {}

    fn limit_wheels(&mut self, limits: &WheelLimits) {
        self.limits.wheel_speed_rad_s = limits.speed_rad_s;
    }

    fn update(&mut self, time: &CycleTime, state: &PlatformState, setpoint: &Setpoint) -> Commands {
        let error = pose_error(&setpoint.odom_from_body, &state.odom_from_body);
        let lead_s = LEAD_PERIODS * time.period_s();
        let (wished, acceleration) = (axes(&setpoint.twist_in_odom), axes(&setpoint.acceleration_in_odom));
        let forward: [f64; 3] = std::array::from_fn(|axis| wished[axis] + lead_s * acceleration[axis]);
        let speed: [f64; 3] = std::array::from_fn(|axis| forward[axis] + self.kp_1_s[axis] * error[axis]);
        let (speed, _) = within_speed(speed, &self.limits);
        let heading_rad = state.odom_from_body.heading_rad + lead_s * speed[2];
        let twist_in_body = Twist2::new(speed[0], speed[1], speed[2]).rotated(-heading_rad);
        let wheels = self.kinematics.wheel_speeds_rad_s(twist_in_body);
        saturated(Quantity::Speed, &wheels, self.limits.wheel_speed_rad_s)
    }

    fn gain(&self, index: usize) -> Option<Gain> {
        let value = *self.kp_1_s.get(index)?;
        Some(Gain { name: KP_NAMES[index], value, least: 0.0, greatest: 1000.0 })
    }

    fn set_gain(&mut self, index: usize, value: f64) {
        if let Some(gain) = self.kp_1_s.get_mut(index) {
            *gain = value;
        }
    }
}
