//! Adaptive control by torque without a model of the platform; deprecated, kept for comparison.
//!
//! Slotine and Li's law for manipulators (Adaptive Manipulator Control: A Case Study, 1988), one axis at a time: with
//! s = Ż − Żr + Λ·(Z − Zr) the force is F = â1·z̈v + â2·żv + â3·sat(s) − Kd·s where żv = żr − Λ·(z − zr), and each
//! estimate moves by â' = −Γ·φ·s with its own regressor φ.

use omnibase_platform::Kinematics;

use super::{axes, pose_error, saturated, wrench};
use crate::config::{RobotPlan, WheelLimits};
use crate::registry::Made;
use crate::signals::{Commands, CycleTime, PlatformState, Quantity, Setpoint};
use crate::stages::{Controller, Gain};

/// Boundary layer of the sign in the friction regressor, m/s and rad/s.
const BOUNDARY: f64 = 0.005;
/// Adaptation of inertia, viscous and dry friction, per axis in SI.
const RATES: [[f64; 3]; 3] = [[2000.0, 2000.0, 500.0], [2000.0, 2000.0, 500.0], [200.0, 200.0, 50.0]];
/// Greatest estimates, per axis in SI: what the law learns stays bounded.
const GREATEST: [[f64; 3]; 3] = [[500.0, 500.0, 100.0], [500.0, 500.0, 60.0], [100.0, 100.0, 60.0]];

/// The controller.
#[derive(Clone, Debug)]
pub struct AdaptiveModelFree {
    kinematics: Kinematics,
    wheel_torque_nm: f64,
    lambda_1_s: [f64; 3],
    damping: [f64; 3],
    /// Per axis: inertia, viscous and dry friction.
    learnt: [[f64; 3]; 3],
    /// A drive holds back what it is told, in this cycle.
    is_held_back: bool,
}

impl AdaptiveModelFree {
    /// The controller as a plan says; it starts knowing nothing.
    pub fn new(plan: &RobotPlan) -> Made<Self> {
        let table = &plan.controller;
        let damping = table.damping_n_s_m.unwrap_or(1500.0);
        Ok(AdaptiveModelFree {
            kinematics: plan.kinematics.clone(),
            wheel_torque_nm: plan.limits.wheel_torque_nm,
            lambda_1_s: table.kp_1_s.unwrap_or([8.0; 3]),
            damping: [damping, damping, table.turn_damping_n_m_s_rad.unwrap_or(150.0)],
            learnt: [[0.0; 3]; 3],
            is_held_back: false,
        })
    }
}

impl Controller for AdaptiveModelFree {
    fn quantity(&self) -> Quantity {
        Quantity::Torque
    }

    fn reset(&mut self) {
        self.learnt = [[0.0; 3]; 3];
    }

    fn limit_wheels(&mut self, limits: &WheelLimits) {
        self.wheel_torque_nm = limits.torque_nm;
    }

    fn limited_by_drives(&mut self) {
        self.is_held_back = true;
    }

    fn update(&mut self, time: &CycleTime, state: &PlatformState, setpoint: &Setpoint) -> Commands {
        let error = pose_error(&setpoint.odom_from_body, &state.odom_from_body);
        let (speed, wished) = (axes(&state.twist_in_odom()), axes(&setpoint.twist_in_odom));
        let acceleration = axes(&setpoint.acceleration_in_odom);
        let mut regressors = [[0.0; 3]; 3];
        let mut slides = [0.0; 3];
        let force: [f64; 3] = std::array::from_fn(|axis| {
            let lambda = self.lambda_1_s[axis];
            let virtual_speed = wished[axis] + lambda * error[axis];
            let virtual_acceleration = acceleration[axis] + lambda * (wished[axis] - speed[axis]);
            let slide = speed[axis] - virtual_speed;
            let dry = (virtual_speed / BOUNDARY).clamp(-1.0, 1.0);
            regressors[axis] = [virtual_acceleration, virtual_speed, dry];
            slides[axis] = slide;
            let learnt: f64 = self.learnt[axis].iter().zip(regressors[axis]).map(|(a, phi)| a * phi).sum();
            learnt - self.damping[axis] * slide
        });
        let wrench_in_body = wrench(force).rotated(-state.odom_from_body.heading_rad);
        let torques = self.kinematics.wheel_torques_nm(wrench_in_body);
        let commands = saturated(Quantity::Torque, &torques, self.wheel_torque_nm);
        let is_held_back = std::mem::take(&mut self.is_held_back);
        if commands.saturation >= 1.0 && !is_held_back {
            for axis in 0..3 {
                for term in 0..3 {
                    let rate = -RATES[term][axis] * regressors[axis][term] * slides[axis];
                    let learnt = self.learnt[axis][term] + time.period_s() * rate;
                    self.learnt[axis][term] = learnt.clamp(0.0, GREATEST[term][axis]);
                }
            }
        }
        commands
    }

    fn gain(&self, index: usize) -> Option<Gain> {
        let names = ["lambda_x_1_s", "lambda_y_1_s", "lambda_heading_1_s"];
        let value = *self.lambda_1_s.get(index)?;
        Some(Gain { name: names[index], value, least: 0.0, greatest: 1000.0 })
    }

    fn set_gain(&mut self, index: usize, value: f64) {
        if let Some(gain) = self.lambda_1_s.get_mut(index) {
            *gain = value;
        }
    }

    fn estimates(&self) -> [f64; 3] {
        [
            0.5 * (self.learnt[0][0] + self.learnt[1][0]),
            self.learnt[2][0],
            0.5 * (self.learnt[0][2] + self.learnt[1][2]),
        ]
    }
}
