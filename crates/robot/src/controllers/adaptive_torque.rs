//! Control by torque that learns mass, inertia, friction and a slow force, with a loop that has margins on every tread.
//!
//! Ze = Z − Zr, η = Ż + Kp·Ze − Żr, wrench F = M̂·Z̈r − K·low-pass(η) + friction + d̂, τ = R·B⁻ᵀ·Rot(ψ)ᵀ·F. After
//! Slotine and Li (*Applied Nonlinear Control*, 1991, section 9.2), made fit for a machine:
//! - K is the whole gain, and it, Kp and the low-pass come from the loop of wheel, tread and delay (`torque_loop.rs`). What
//!   is learnt feeds forward and never changes the gain;
//! - everything that is learnt moves no faster than that design counts with: m̂' = −λ·K·η·Z̈r/(|Z̈r|² + a₀²), Ĵ likewise,
//!   ĉ' = −λ·K·η·w/|w|² for the friction of wheels and rollers (`friction.rs`), d̂' = −λ·K·η for what no model tells;
//! - mass and friction are fed forward for the instant at which the torque acts;
//! - the measured speed is brought up to the instant of the pose, by the reference's acceleration;
//! - the correction asks for no more speed than the platform may, or a robot that was held fast would come back faster;
//! - nothing is learnt while torques are saturated, here or by a drive, nor of mass and inertia where nothing is accelerated,
//!   nor from an η within the measurement's noise; estimates stay within their bounds.

use omnibase_platform::{Kinematics, Twist2};

use super::friction::{WheelForces, WheelFriction};
use super::torque_design::{INTEGRAL_1_S, TorqueDesign, bounds};
use super::torque_loop::LoopGains;
use super::{Correction, LEAD_PERIODS, axes, pose_error, saturated, within_speed, wrench};
use crate::config::{Limits, RobotPlan, WheelLimits};
use crate::registry::{Kind, Made, given, needed, optional};
use crate::signals::{Commands, CycleTime, PlatformState, Quantity, ReferenceStatus, Setpoint};
use crate::stages::{Controller, Gain};

/// Acceleration at which half of what an error of the force asks for goes into mass and inertia, m/s² and rad/s².
const HALF_ACCELERATION: [f64; 2] = [0.2, 0.3];
/// Mass and inertia are learnt only above these, m/s² and rad/s²: below, the little of friction that no model tells would
/// look like mass.
const LEAST_ACCELERATION: [f64; 2] = [0.1, 0.15];
/// η below this is noise and says nothing, m/s (as a surface speed about the vertical axis): some counts of a 20-bit
/// encoder over the speed filter's time.
const NOISE_M_S: f64 = 1e-4;
/// How fast each part is learnt, 1/s: together [`INTEGRAL_1_S`].
const MASS_1_S: f64 = 0.4 * INTEGRAL_1_S;
const FRICTION_1_S: f64 = 0.15 * INTEGRAL_1_S;
const FORCE_1_S: f64 = 0.3 * INTEGRAL_1_S;

/// Its name and keys.
pub(super) fn kind() -> Kind {
    let gains = ["kp_1_s", "damping_n_s_m", "turn_damping_n_m_s_rad", "torque_filter_1_s"];
    let treads = ["tread_stiffness_n_m", "tread_damping_ratio", "wheel_inertia_kg_m2", "torque_lag_us"];
    let estimates = ["mass_bounds_kg", "inertia_bounds_kg_m2", "friction_max_n"];
    let may_be_given = [gains.as_slice(), &treads, &estimates].into_iter().flatten().copied().map(optional);
    Kind {
        name: "adaptive_torque",
        meaning: "Wheel torques; mass, inertia and friction are learnt while tracking",
        keys: ["mass_kg", "inertia_kg_m2"].map(needed).into_iter().chain(may_be_given).collect(),
    }
}

/// What is learnt.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Estimates {
    mass_kg: f64,
    inertia_kg_m2: f64,
    /// Of the wheels.
    friction_n: WheelForces,
    /// What no model tells, in odom, N and N·m.
    force: [f64; 3],
}

/// The controller.
#[derive(Clone, Debug)]
pub struct AdaptiveTorque {
    kinematics: Kinematics,
    limits: Limits,
    gains: [LoopGains; 3],
    /// The greatest Kp that the design allows, 1/s.
    greatest_kp_1_s: [f64; 3],
    start: Estimates,
    mass_bounds_kg: [f64; 2],
    inertia_bounds_kg_m2: [f64; 2],
    friction_max_n: f64,
    estimates: Estimates,
    friction: WheelFriction,
    /// By what a force becomes a moment, m.
    lever_m: f64,
    /// η behind its low-pass, and the wished acceleration before; `None` before the first cycle.
    before: Option<Before>,
    /// A drive holds back what it is told, in this cycle.
    is_held_back: bool,
}

#[derive(Clone, Copy, Debug)]
struct Before {
    eta: [f64; 3],
    acceleration: [f64; 3],
}

/// What a cycle's law worked with, for learning from it.
struct Step {
    eta: [f64; 3],
    eta_in_body: [f64; 3],
    acceleration: [f64; 3],
    friction_per_newton: [[f64; 3]; 2],
    is_moving: bool,
    period_s: f64,
}

impl AdaptiveTorque {
    /// The controller as a plan says.
    pub fn new(plan: &RobotPlan) -> Made<Self> {
        let table = &plan.controller;
        let design = TorqueDesign::new(plan)?;
        let start = Estimates {
            mass_kg: given(table.mass_kg, "mass_kg")?,
            inertia_kg_m2: given(table.inertia_kg_m2, "inertia_kg_m2")?,
            friction_n: [0.0; 2],
            force: [0.0; 3],
        };
        let friction = WheelFriction::new(&plan.kinematics);
        Ok(AdaptiveTorque {
            lever_m: friction.lever_m(),
            friction,
            is_held_back: false,
            before: None,
            kinematics: plan.kinematics.clone(),
            limits: plan.limits,
            greatest_kp_1_s: design.gains.map(|gains| gains.kp_1_s),
            gains: design.gains,
            start,
            mass_bounds_kg: bounds("mass", table.mass_kg, table.mass_bounds_kg)?,
            inertia_bounds_kg_m2: bounds("inertia", table.inertia_kg_m2, table.inertia_bounds_kg_m2)?,
            friction_max_n: table.friction_max_n.unwrap_or(100.0),
            estimates: start,
        })
    }

    fn adapt(&mut self, step: &Step) {
        let Step { eta, eta_in_body, acceleration, friction_per_newton, is_moving, period_s } = *step;
        let surface = [eta[0], eta[1], eta[2] * self.lever_m];
        if surface.iter().all(|eta| eta.abs() <= NOISE_M_S) {
            return;
        }
        // The force that η asks for.
        let asked: [f64; 3] = std::array::from_fn(|axis| -self.gains[axis].damping * eta[axis]);
        let estimates = &mut self.estimates;
        let learn = |rate_1_s: f64, along: &[usize], half: f64, least: f64| {
            let square: f64 = along.iter().map(|&axis| acceleration[axis] * acceleration[axis]).sum();
            let found: f64 = along.iter().map(|&axis| asked[axis] * acceleration[axis]).sum();
            if square > least * least { period_s * rate_1_s * found / (square + half * half) } else { 0.0 }
        };
        let [low, high] = self.mass_bounds_kg;
        let change = learn(MASS_1_S, &[0, 1], HALF_ACCELERATION[0], LEAST_ACCELERATION[0]);
        estimates.mass_kg = (estimates.mass_kg + change).clamp(low, high);
        let [low, high] = self.inertia_bounds_kg_m2;
        let change = learn(MASS_1_S, &[2], HALF_ACCELERATION[1], LEAST_ACCELERATION[1]);
        estimates.inertia_kg_m2 = (estimates.inertia_kg_m2 + change).clamp(low, high);
        for (force_n, wrench) in estimates.friction_n.iter_mut().zip(friction_per_newton) {
            let square: f64 = wrench[0] * wrench[0] + wrench[1] * wrench[1] + (wrench[2] / self.lever_m).powi(2);
            if square > 0.25 {
                let found: f64 = (0..3)
                    .map(|axis| {
                        let lever = if axis == 2 { self.lever_m * self.lever_m } else { 1.0 };
                        -self.gains[axis].damping * eta_in_body[axis] * wrench[axis] / lever
                    })
                    .sum();
                *force_n = (*force_n + period_s * FRICTION_1_S * found / square).clamp(0.0, self.friction_max_n);
            }
        }
        if is_moving {
            for (axis, force) in estimates.force.iter_mut().enumerate() {
                let most = if axis == 2 { self.lever_m * self.friction_max_n } else { self.friction_max_n };
                *force = (*force + period_s * FORCE_1_S * asked[axis]).clamp(-most, most);
            }
        }
    }

    /// The wished acceleration when the torque acts: by its last change, no faster than the platform's jerk.
    fn led(&self, acceleration: [f64; 3], period_s: f64) -> [f64; 3] {
        let before = self.before.map_or(acceleration, |before| before.acceleration);
        let jerk = [self.limits.jerk_m_s3, self.limits.jerk_m_s3, self.limits.turn_jerk_rad_s3];
        std::array::from_fn(|axis| {
            let most = LEAD_PERIODS * period_s * jerk[axis];
            acceleration[axis] + (LEAD_PERIODS * (acceleration[axis] - before[axis])).clamp(-most, most)
        })
    }
}

impl Controller for AdaptiveTorque {
    fn quantity(&self) -> Quantity {
        Quantity::Torque
    }

    fn reset(&mut self) {
        self.estimates = self.start;
        self.before = None;
    }

    fn limit_wheels(&mut self, limits: &WheelLimits) {
        self.limits.wheel_torque_nm = limits.torque_nm;
    }

    fn limited_by_drives(&mut self) {
        self.is_held_back = true;
    }

    fn update(&mut self, time: &CycleTime, state: &PlatformState, setpoint: &Setpoint) -> Commands {
        let period_s = time.period_s();
        let error = pose_error(&setpoint.odom_from_body, &state.odom_from_body);
        let speed = axes(&state.twist_in_odom());
        let wished_speed = axes(&setpoint.twist_in_odom);
        let acceleration = axes(&setpoint.acceleration_in_odom);
        let age_s = state.twist_age_s;
        // η is the speed against a wished one that includes the correction: żr − Kp·Ze, kept within the limits.
        let (corrected, correction) = within_speed(
            std::array::from_fn(|axis| wished_speed[axis] + self.gains[axis].kp_1_s * error[axis]),
            &self.limits,
        );
        let before = self.before.map_or([0.0; 3], |before| before.eta);
        let eta: [f64; 3] = std::array::from_fn(|axis| {
            let now = speed[axis] + age_s * acceleration[axis] - corrected[axis];
            let keep = (-self.gains[axis].filter_1_s * period_s).exp();
            keep * before[axis] + (1.0 - keep) * now
        });
        let led = self.led(acceleration, period_s);
        self.before = Some(Before { eta, acceleration });
        let Estimates { mass_kg, inertia_kg_m2, friction_n, force } = self.estimates;
        let inertia = [mass_kg, mass_kg, inertia_kg_m2];
        let force: [f64; 3] = std::array::from_fn(|axis| {
            inertia[axis] * led[axis] - self.gains[axis].damping * eta[axis] + force[axis]
        });
        let lead_s = LEAD_PERIODS * period_s;
        let heading_rad = state.odom_from_body.heading_rad + lead_s * wished_speed[2];
        let wished_in_body = setpoint.twist_in_odom.rotated(-heading_rad);
        let friction_per_newton = self.friction.per_newton(axes(&wished_in_body));
        let mut wrench_in_body = wrench(force).rotated(-heading_rad);
        for (force_n, [fx_n, fy_n, torque_nm]) in friction_n.iter().zip(friction_per_newton) {
            wrench_in_body.fx_n += force_n * fx_n;
            wrench_in_body.fy_n += force_n * fy_n;
            wrench_in_body.torque_nm += force_n * torque_nm;
        }
        let torques = self.kinematics.wheel_torques_nm(wrench_in_body);
        let commands = saturated(Quantity::Torque, &torques, self.limits.wheel_torque_nm);
        let is_held_back = std::mem::take(&mut self.is_held_back);
        if commands.saturation >= 1.0 && correction == Correction::Whole && !is_held_back {
            let eta_in_body = axes(&Twist2::new(eta[0], eta[1], eta[2]).rotated(-heading_rad));
            let is_moving = setpoint.status == ReferenceStatus::Moving;
            self.adapt(&Step { eta, eta_in_body, acceleration, friction_per_newton, is_moving, period_s });
        }
        commands
    }

    fn gain(&self, index: usize) -> Option<Gain> {
        let name = *["kp_x_1_s", "kp_y_1_s", "kp_heading_1_s"].get(index)?;
        let gains = self.gains.get(index)?;
        Some(Gain { name, value: gains.kp_1_s, least: 0.0, greatest: *self.greatest_kp_1_s.get(index)? })
    }

    fn set_gain(&mut self, index: usize, value: f64) {
        if let Some(gains) = self.gains.get_mut(index) {
            gains.kp_1_s = value;
        }
    }

    fn estimates(&self) -> [f64; 3] {
        let [fx_n, fy_n, _] = self.estimates.force;
        [self.estimates.mass_kg, self.estimates.inertia_kg_m2, fx_n.hypot(fy_n)]
    }
}
