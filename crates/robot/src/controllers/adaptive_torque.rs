//! Adaptive control by torque: mass, inertia and an uncertain force are learnt while tracking.
//!
//! Ze = Z − Zr, η = Ż + Kp·Ze − Żr, wrench F = M̂·Z̈r − (K + M̂·Kp)·η − k̂·sgn(η), τ = R·B⁻ᵀ·Rot(ψ)ᵀ·F, with
//! m̂' = λm·(−η1·ẍr − η2·ÿr + kp1·η1² + kp2·η2²), Ĵ' = λJ·(−η3·ψ̈r + kp3·η3²), k̂' = λk·‖η‖₁ (thesis 8.29, with its
//! signs put right). What makes it fit for a machine:
//! - sgn is linear within a boundary layer, and k̂ is learnt from what exceeds a fifth of it;
//! - about the vertical axis k̂ counts with the wheels' lever ρ: moment k̂·ρ, surface speed η3·ρ. A force of 100 N taken
//!   for 100 N·m would ask for more bandwidth than delay and filter leave: drives ring and motors get hot;
//! - dry friction of wheels and rollers is fed forward with two forces that are learnt (`friction.rs`), for
//!   what is left to η would else look like mass: kp·η² is never negative, so m̂ would only rise;
//! - the measured speed is brought up to the instant of the pose, by the reference's acceleration;
//! - the correction asks for no more speed than the platform may, or a robot that was held fast would come back faster;
//!   nothing is learnt meanwhile;
//! - estimates stay within their bounds; k̂ leaks, so that it doesn't grow for ever; nothing is learnt while torques
//!   are saturated, here or by a drive, nor of mass and inertia where nothing is accelerated, nor from an η within the measurement's noise.

use omnibase_platform::{Kinematics, Twist2};

use super::friction::{WheelForces, WheelFriction};
use super::{Correction, LEAD_PERIODS, axes, pose_error, saturated, within_speed, wrench};
use crate::config::{ControllerTable, Limits, Problem, RobotPlan, WheelLimits};
use crate::registry::{Kind, Made, StageError, given, needed, optional};
use crate::signals::{Commands, CycleTime, PlatformState, Quantity, Setpoint};
use crate::stages::{Controller, Gain};

/// Default Kp, 1/s: a sixth of the speed loop's bandwidth with the default damping on 70 kg.
const KP_1_S: [f64; 3] = [15.0; 3];
/// Mass and inertia show where they are accelerated: they are learnt only while the reference's acceleration is so
/// many times what the error alone asks for.
const EXCITATION: f64 = 3.0;
/// And only above these, m/s² and rad/s²: below, the little of friction that no model tells would look like mass.
const LEAST_ACCELERATION: [f64; 2] = [0.1, 0.15];
/// η below this is noise and says nothing, m/s (as a surface speed about the vertical axis): some counts of a 20-bit
/// encoder over the speed filter's time.
const NOISE_M_S: f64 = 1e-4;
/// How fast the friction of the wheels is learnt, N/m.
const WHEEL_FRICTION_RATE_N_M: f64 = 1000.0;

/// Everything that can be set while it runs.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Gains {
    kp_1_s: [f64; 3],
    damping_n_s_m: f64,
    turn_damping_n_m_s_rad: f64,
    mass_rate_kg_s2_m2: f64,
    inertia_rate_kg_m2_s2: f64,
    friction_rate_n_m: f64,
    friction_leak_1_s: f64,
    boundary_m_s: f64,
}

impl Gains {
    fn new(table: &ControllerTable) -> Self {
        Gains {
            kp_1_s: table.kp_1_s.unwrap_or(KP_1_S),
            damping_n_s_m: table.damping_n_s_m.unwrap_or(3000.0),
            turn_damping_n_m_s_rad: table.turn_damping_n_m_s_rad.unwrap_or(300.0),
            mass_rate_kg_s2_m2: table.mass_rate_kg_s2_m2.unwrap_or(5000.0),
            inertia_rate_kg_m2_s2: table.inertia_rate_kg_m2_s2.unwrap_or(1000.0),
            friction_rate_n_m: table.friction_rate_n_m.unwrap_or(2000.0),
            friction_leak_1_s: table.friction_leak_1_s.unwrap_or(0.2),
            boundary_m_s: table.boundary_m_s.unwrap_or(0.03),
        }
    }

    fn list(&mut self) -> [(&'static str, &mut f64, f64); 10] {
        let [x, y, heading] = &mut self.kp_1_s;
        [
            ("kp_x_1_s", x, 1000.0),
            ("kp_y_1_s", y, 1000.0),
            ("kp_heading_1_s", heading, 1000.0),
            ("damping_n_s_m", &mut self.damping_n_s_m, 1e6),
            ("turn_damping_n_m_s_rad", &mut self.turn_damping_n_m_s_rad, 1e6),
            ("mass_rate_kg_s2_m2", &mut self.mass_rate_kg_s2_m2, 1e9),
            ("inertia_rate_kg_m2_s2", &mut self.inertia_rate_kg_m2_s2, 1e9),
            ("friction_rate_n_m", &mut self.friction_rate_n_m, 1e9),
            ("friction_leak_1_s", &mut self.friction_leak_1_s, 1000.0),
            ("boundary_m_s", &mut self.boundary_m_s, 10.0),
        ]
    }
}

/// Its name and keys.
pub(super) fn kind() -> Kind {
    let gains = ["kp_1_s", "damping_n_s_m", "turn_damping_n_m_s_rad", "boundary_m_s"];
    let learning = ["mass_rate_kg_s2_m2", "inertia_rate_kg_m2_s2", "friction_rate_n_m", "friction_leak_1_s"];
    let estimates = ["mass_bounds_kg", "inertia_bounds_kg_m2", "friction_n", "friction_max_n"];
    let may_be_given = [gains, learning, estimates].into_iter().flatten().map(optional);
    Kind {
        name: "adaptive_torque",
        meaning: "Wheel torques; mass, inertia and friction are learnt while tracking",
        keys: ["mass_kg", "inertia_kg_m2"].map(needed).into_iter().chain(may_be_given).collect(),
    }
}

/// What is wrong with a first estimate and its bounds.
fn out_of_bounds(key: &str, first: f64, bounds: Option<[f64; 2]>) -> Option<Problem> {
    let [low, high] = bounds?;
    let limit = Some(format!("{low} to {high}"));
    let reason = "the first estimate must lie within its bounds, which must be positive and ascending";
    let problem = Problem { value: Some(first.to_string()), limit, ..Problem::refused(key, reason) };
    (!(low..=high).contains(&first)).then_some(problem)
}

/// Bounds of the estimates, and where they begin.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Estimates {
    mass_kg: f64,
    inertia_kg_m2: f64,
    friction_n: f64,
}

/// The controller.
#[derive(Clone, Debug)]
pub struct AdaptiveTorque {
    kinematics: Kinematics,
    limits: Limits,
    gains: Gains,
    start: Estimates,
    mass_bounds_kg: [f64; 2],
    inertia_bounds_kg_m2: [f64; 2],
    friction_max_n: f64,
    estimates: Estimates,
    friction: WheelFriction,
    /// By what a force becomes a moment, m.
    lever_m: f64,
    wheel_forces_n: WheelForces,
    /// A drive holds back what it is told, in this cycle.
    is_held_back: bool,
}

/// What a cycle's law worked with, for learning from it.
struct Step {
    eta: [f64; 3],
    eta_in_body: [f64; 3],
    acceleration: [f64; 3],
    friction_per_newton: [[f64; 3]; 2],
    period_s: f64,
}

impl AdaptiveTorque {
    /// The controller as a plan says.
    pub fn new(plan: &RobotPlan) -> Made<Self> {
        let table = &plan.controller;
        let mass_kg = given(table.mass_kg, "mass_kg")?;
        let inertia_kg_m2 = given(table.inertia_kg_m2, "inertia_kg_m2")?;
        let problems: Vec<Problem> = [
            out_of_bounds("mass_kg", mass_kg, table.mass_bounds_kg),
            out_of_bounds("inertia_kg_m2", inertia_kg_m2, table.inertia_bounds_kg_m2),
            out_of_bounds(
                "friction_n",
                table.friction_n.unwrap_or(0.0),
                table.friction_max_n.map(|max| [0.0, max]),
            ),
        ]
        .into_iter()
        .flatten()
        .collect();
        if !problems.is_empty() {
            return Err(StageError(problems));
        }
        let start = Estimates { mass_kg, inertia_kg_m2, friction_n: table.friction_n.unwrap_or(0.0) };
        let friction = WheelFriction::new(&plan.kinematics);
        Ok(AdaptiveTorque {
            lever_m: friction.lever_m(),
            friction,
            wheel_forces_n: [0.0; 2],
            is_held_back: false,
            kinematics: plan.kinematics.clone(),
            limits: plan.limits,
            gains: Gains::new(table),
            start,
            mass_bounds_kg: table.mass_bounds_kg.unwrap_or([mass_kg / 10.0, mass_kg * 10.0]),
            inertia_bounds_kg_m2: table
                .inertia_bounds_kg_m2
                .unwrap_or([inertia_kg_m2 / 10.0, inertia_kg_m2 * 10.0]),
            friction_max_n: table.friction_max_n.unwrap_or(100.0),
            estimates: start,
        })
    }

    fn adapt(&mut self, step: &Step) {
        let Step { eta, eta_in_body, acceleration, friction_per_newton, period_s } = *step;
        let kp = self.gains.kp_1_s;
        let surface = [eta[0], eta[1], eta[2] * self.lever_m];
        let speaks = surface.iter().any(|eta| eta.abs() > NOISE_M_S);
        let learn = |axis: usize| -eta[axis] * acceleration[axis] + kp[axis] * eta[axis] * eta[axis];
        let is_excited =
            |along: f64, asked: f64, least: f64| speaks && along > EXCITATION * asked && along > least;
        let estimates = &mut self.estimates;

        let [low, high] = self.mass_bounds_kg;
        let (along, asked) = (acceleration[0].hypot(acceleration[1]), (kp[0] * eta[0]).hypot(kp[1] * eta[1]));
        if is_excited(along, asked, LEAST_ACCELERATION[0]) {
            let rate = self.gains.mass_rate_kg_s2_m2 * (learn(0) + learn(1));
            estimates.mass_kg = (estimates.mass_kg + period_s * rate).clamp(low, high);
        }
        let [low, high] = self.inertia_bounds_kg_m2;
        if is_excited(acceleration[2].abs(), (kp[2] * eta[2]).abs(), LEAST_ACCELERATION[1]) {
            let rate = self.gains.inertia_rate_kg_m2_s2 * learn(2);
            estimates.inertia_kg_m2 = (estimates.inertia_kg_m2 + period_s * rate).clamp(low, high);
        }
        for (force_n, wrench) in self.wheel_forces_n.iter_mut().zip(friction_per_newton) {
            let power: f64 = wrench.iter().zip(eta_in_body).map(|(force, eta)| force * eta).sum();
            if speaks {
                *force_n =
                    (*force_n - period_s * WHEEL_FRICTION_RATE_N_M * power).clamp(0.0, self.friction_max_n);
            }
        }
        let dead_m_s = 0.2 * self.gains.boundary_m_s;
        let size: f64 = surface.iter().map(|eta| (eta.abs() - dead_m_s).max(0.0)).sum();
        let rate = self.gains.friction_rate_n_m * size - self.gains.friction_leak_1_s * estimates.friction_n;
        estimates.friction_n = (estimates.friction_n + period_s * rate).clamp(0.0, self.friction_max_n);
    }
}

impl Controller for AdaptiveTorque {
    fn quantity(&self) -> Quantity {
        Quantity::Torque
    }

    fn reset(&mut self) {
        self.estimates = self.start;
        self.wheel_forces_n = [0.0; 2];
    }

    fn limit_wheels(&mut self, limits: &WheelLimits) {
        self.limits.wheel_torque_nm = limits.torque_nm;
    }

    fn limited_by_drives(&mut self) {
        self.is_held_back = true;
    }

    fn update(&mut self, time: &CycleTime, state: &PlatformState, setpoint: &Setpoint) -> Commands {
        let error = pose_error(&setpoint.odom_from_body, &state.odom_from_body);
        let speed = axes(&state.twist_in_odom());
        let wished_speed = axes(&setpoint.twist_in_odom);
        let acceleration = axes(&setpoint.acceleration_in_odom);
        let kp = self.gains.kp_1_s;
        let age_s = state.twist_age_s;
        // η is the speed against a wished one that includes the correction: żr − Kp·Ze, kept within the limits.
        let (corrected, correction) = within_speed(
            std::array::from_fn(|axis| wished_speed[axis] + kp[axis] * error[axis]),
            &self.limits,
        );
        let eta: [f64; 3] =
            std::array::from_fn(|axis| speed[axis] + age_s * acceleration[axis] - corrected[axis]);
        let Estimates { mass_kg, inertia_kg_m2, friction_n } = self.estimates;
        let inertia = [mass_kg, mass_kg, inertia_kg_m2];
        let damping = [self.gains.damping_n_s_m, self.gains.damping_n_s_m, self.gains.turn_damping_n_m_s_rad];
        let levers = [1.0, 1.0, self.lever_m];
        let force: [f64; 3] = std::array::from_fn(|axis| {
            let sign = (levers[axis] * eta[axis] / self.gains.boundary_m_s).clamp(-1.0, 1.0);
            inertia[axis] * acceleration[axis]
                - (damping[axis] + inertia[axis] * kp[axis]) * eta[axis]
                - levers[axis] * friction_n * sign
        });
        let lead_s = LEAD_PERIODS * time.period_s();
        let heading_rad = state.odom_from_body.heading_rad + lead_s * wished_speed[2];
        let wished_in_body = setpoint.twist_in_odom.rotated(-heading_rad);
        let friction_per_newton = self.friction.per_newton(axes(&wished_in_body));
        let mut wrench_in_body = wrench(force).rotated(-heading_rad);
        for (force_n, [fx_n, fy_n, torque_nm]) in self.wheel_forces_n.iter().zip(friction_per_newton) {
            wrench_in_body.fx_n += force_n * fx_n;
            wrench_in_body.fy_n += force_n * fy_n;
            wrench_in_body.torque_nm += force_n * torque_nm;
        }
        let torques = self.kinematics.wheel_torques_nm(wrench_in_body);
        let commands = saturated(Quantity::Torque, &torques, self.limits.wheel_torque_nm);
        let is_held_back = std::mem::take(&mut self.is_held_back);
        if commands.saturation >= 1.0 && correction == Correction::Whole && !is_held_back {
            let eta_in_body = axes(&Twist2::new(eta[0], eta[1], eta[2]).rotated(-heading_rad));
            let period_s = time.period_s();
            self.adapt(&Step { eta, eta_in_body, acceleration, friction_per_newton, period_s });
        }
        commands
    }

    fn gain(&self, index: usize) -> Option<Gain> {
        let mut gains = self.gains;
        let (name, value, greatest) = gains.list().into_iter().nth(index)?;
        // Nothing may be divided by zero.
        let least = if name == "boundary_m_s" { 1e-6 } else { 0.0 };
        Some(Gain { name, value: *value, least, greatest })
    }

    fn set_gain(&mut self, index: usize, value: f64) {
        if let Some((_, gain, _)) = self.gains.list().into_iter().nth(index) {
            *gain = value;
        }
    }

    fn estimates(&self) -> [f64; 3] {
        [self.estimates.mass_kg, self.estimates.inertia_kg_m2, self.estimates.friction_n]
    }
}
