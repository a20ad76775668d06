//! Speed control: by the reference alone, or with the pose error fed back.

use omnibase_platform::{Kinematics, Twist2, axes, pose_error};

use super::{LEAD_PERIODS, saturated, within_speed};
use crate::config::{Limits, RobotPlan, WheelLimits};
use crate::grip::probe::Swing;
use crate::registry::Made;
use crate::signals::{Commands, CycleTime, PlatformState, Quantity, Setpoint};
use crate::stages::{Controller, Gain};

/// From the platform's speed to the wheels': = B/R · Rot(ψ)ᵀ · speed in odom, scaled as a whole where a wheel can't.
#[derive(Clone, Debug)]
pub struct WheelSpeeds {
    kinematics: Kinematics,
    /// What each wheel may do, rad/s.
    pub limit_rad_s: f64,
}

impl WheelSpeeds {
    /// For a plan's wheels and their limit.
    pub fn new(plan: &RobotPlan) -> Self {
        WheelSpeeds { kinematics: plan.kinematics.clone(), limit_rad_s: plan.limits.wheel_speed_rad_s }
    }

    /// The commands for a speed in odom, (m/s, m/s, rad/s), from a heading, rad, on which the platform turns on for
    /// `lead_s` until the commands count: half a period for the middle of the time for which they stand.
    pub fn commands(&self, speed_in_odom: [f64; 3], heading_rad: f64, lead_s: f64) -> Commands {
        let [vx_m_s, vy_m_s, w_rad_s] = speed_in_odom;
        let twist_in_body = Twist2::new(vx_m_s, vy_m_s, w_rad_s).rotated(-(heading_rad + lead_s * w_rad_s));
        saturated(Quantity::Speed, &self.kinematics.wheel_speeds_rad_s(twist_in_body), self.limit_rad_s)
    }
}

/// The setpoint's speed, and its acceleration for so long, s.
fn forward(setpoint: &Setpoint, lead_s: f64) -> [f64; 3] {
    let (speed, acceleration) = (axes(&setpoint.twist_in_odom), axes(&setpoint.acceleration_in_odom));
    std::array::from_fn(|axis| speed[axis] + lead_s * acceleration[axis])
}

/// The wheels' speeds by the reference alone; the pose error is never looked at.
#[derive(Clone, Debug)]
pub struct OpenLoop {
    wheels: WheelSpeeds,
    swing: Swing,
}

impl OpenLoop {
    /// The law as a plan says.
    pub fn new(plan: &RobotPlan) -> Made<Self> {
        Ok(OpenLoop { wheels: WheelSpeeds::new(plan), swing: Swing::new(plan) })
    }
}

impl Controller for OpenLoop {
    fn quantity(&self) -> Quantity {
        Quantity::Speed
    }

    fn asks_floor(&self) -> bool {
        self.swing.asks()
    }

    fn limit_wheels(&mut self, limits: &WheelLimits) {
        self.wheels.limit_rad_s = limits.speed_rad_s;
    }

    fn update(&mut self, time: &CycleTime, _: &PlatformState, setpoint: &Setpoint) -> Commands {
        // The reference's own heading: what isn't measured can't be wrong.
        let heading_rad = setpoint.odom_from_body.heading_rad;
        let forward = forward(setpoint, self.swing.lead_s(time, setpoint));
        self.wheels.commands(forward, heading_rad, 0.5 * time.period_s())
    }
}

/// Speed = feed-forward + Kp · (pose error in odom, angle wrapped). Thesis 8.20.
#[derive(Clone, Debug)]
pub struct ClosedLoopSpeed {
    wheels: WheelSpeeds,
    swing: Swing,
    limits: Limits,
    kp_1_s: [f64; 3],
}

const KP_1_S: [f64; 3] = [8.0; 3];
const KP_NAMES: [&str; 3] = ["kp_x_1_s", "kp_y_1_s", "kp_heading_1_s"];

impl ClosedLoopSpeed {
    /// The law as a plan says.
    pub fn new(plan: &RobotPlan) -> Made<Self> {
        Ok(ClosedLoopSpeed {
            wheels: WheelSpeeds::new(plan),
            swing: Swing::new(plan),
            limits: plan.limits,
            kp_1_s: plan.controller.kp_1_s.unwrap_or(KP_1_S),
        })
    }
}

impl Controller for ClosedLoopSpeed {
    fn quantity(&self) -> Quantity {
        Quantity::Speed
    }

    fn asks_floor(&self) -> bool {
        self.swing.asks()
    }

    fn limit_wheels(&mut self, limits: &WheelLimits) {
        self.wheels.limit_rad_s = limits.speed_rad_s;
    }

    fn update(&mut self, time: &CycleTime, state: &PlatformState, setpoint: &Setpoint) -> Commands {
        let error = pose_error(&setpoint.odom_from_body, &state.odom_from_body);
        let lead_s = LEAD_PERIODS * time.period_s();
        let forward = forward(setpoint, lead_s + self.swing.lead_s(time, setpoint));
        let speed: [f64; 3] = std::array::from_fn(|axis| forward[axis] + self.kp_1_s[axis] * error[axis]);
        let (speed, _) = within_speed(speed, &self.limits);
        self.wheels.commands(speed, state.odom_from_body.heading_rad, lead_s)
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
