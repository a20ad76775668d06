//! What the laws of torque have in common: a loop with margins on every tread, fed forward with what is known of the platform.
//!
//! Ze = Z − Zr, η = Ż + Kp·Ze − Żr, wrench F = M̂·Z̈r − K·low-pass(η) + friction + d̂, τ = R·B⁻ᵀ·Rot(ψ)ᵀ·F. After
//! Slotine and Li (*Applied Nonlinear Control*, 1991, section 9.2), made fit for a machine:
//! - K is the whole gain, and it, Kp and the low-pass come from the loop of wheel, tread and delay (`torque_design.rs`). What
//!   is learnt feeds forward and never changes the gain;
//! - mass, inertia and the friction of wheels and rollers are learnt from what wrenches did (`grip.rs`), which closes
//!   no loop; a slow force d̂ takes what no model tells, by each law in its own way, and the loop's margins count with it;
//! - mass and friction are fed forward for the instant at which the torque acts;
//! - the measured speed is brought up to the instant of the pose, by the reference's acceleration;
//! - the correction asks for no more speed than the platform may, or a robot that was held fast would come back faster;
//! - where the file says what the treads are, and torques swing all the same, it goes on with the gains for all treads until it begins anew.

use std::fmt::Debug;

use omnibase_platform::{Kinematics, Twist2, Wrench2, axes, pose_error};

use super::{Correction, LEAD_PERIODS, saturated, within_speed, wrench};
use crate::config::{Limits, RobotPlan, WheelLimits, rated_nm};
use crate::decay::Decay;
use crate::grip::friction::WheelFriction;
use crate::registry::{Key, Made, given, needed, optional};
use crate::signals::{
    Commands, CycleTime, Dynamics, MAX_WHEELS, Measurements, PlatformState, Quantity, ReferenceStatus,
    Setpoint,
};
use crate::stages::{Controller, Gain};
use crate::swing::{AVERAGED, NOISE_OF_RATED, Swing};
use crate::torque_loop::{LoopGains, TorqueDesign};

/// So many half swings of what it commands, and its gains are those for all treads: before the stop for a torque that swings.
const HALF_SWINGS: u32 = 3;

/// The keys that all of them read.
pub(super) fn keys() -> impl Iterator<Item = Key> {
    let gains = ["torque_kp_1_s", "damping_n_s_m", "turn_damping_n_m_s_rad", "torque_filter_1_s"];
    let treads = ["tread_stiffness_n_m", "tread_damping_ratio", "wheel_inertia_kg_m2", "torque_lag_us"];
    let estimates = ["mass_bounds_kg", "inertia_bounds_kg_m2", "friction_max_n"];
    let may_be_given = gains.into_iter().chain(treads).chain(estimates).map(optional);
    ["mass_kg", "inertia_kg_m2"].map(needed).into_iter().chain(may_be_given)
}

/// The force that no model tells, in odom, N and N·m, as a law finds it; it is added to what else the law asks for.
pub trait ForceBeside: Clone + Debug + Send {
    /// Begins anew.
    fn reset(&mut self);

    /// The force now.
    fn force(&self) -> [f64; 3];

    /// What the drives measured, in a cycle in which all were heard; before [`follow`](ForceBeside::follow).
    fn feel(&mut self, kinematics: &Kinematics, measurements: &Measurements) {
        let _ = (kinematics, measurements);
    }

    /// Takes in what the law did in a cycle.
    fn follow(&mut self, done: &Done<'_>);
}

/// What a law did in a cycle.
#[derive(Clone, Copy, Debug)]
pub struct Done<'a> {
    /// Period of the cycle, s.
    pub period_s: f64,
    /// Its gains, by axis.
    pub gains: &'a [LoopGains; 3],
    /// η behind its low-pass, m/s and rad/s.
    pub eta: [f64; 3],
    /// By how much the platform is faster than the setpoint, in odom, m/s and rad/s.
    pub faster: [f64; 3],
    /// The measured heading.
    pub heading_rad: f64,
    /// What was fed forward, in body axes.
    pub fed: Wrench2,
    /// The setpoint moves: at rest friction holds against any force.
    pub moves: bool,
    /// A drive or the floor holds back what it is told, or it wasn't heard.
    pub is_held_back: bool,
    /// The wheels were asked for all of it.
    pub is_whole: bool,
}

/// The controller.
#[derive(Clone, Debug)]
pub struct TorqueLaw<F> {
    kinematics: Kinematics,
    limits: Limits,
    design: TorqueDesign,
    /// The design's, with the Kp that was set.
    gains: [LoopGains; 3],
    /// Whether torques swing since it began: then with the design's softer gains.
    is_softer: bool,
    /// The low-passes of η.
    filters: [Decay; 3],
    averaged: Decay,
    swings: [Swing; MAX_WHEELS],
    /// What reaches less far is no swing, N·m.
    noise_nm: [f64; MAX_WHEELS],
    dynamics: Dynamics,
    friction: WheelFriction,
    beside: F,
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

/// The most that a law finds beside its model where the file says nothing, N.
const FORCE_MAX_N: f64 = 100.0;

/// The most that a law finds beside its model, by axis, N and N·m.
pub(super) fn most(plan: &RobotPlan) -> [f64; 3] {
    let most_n = plan.controller.friction_max_n.unwrap_or(FORCE_MAX_N);
    [most_n, most_n, lever_m(plan) * most_n]
}

/// By what a force becomes a moment, m.
pub(super) fn lever_m(plan: &RobotPlan) -> f64 {
    WheelFriction::new(&plan.kinematics).lever_m()
}

impl<F: ForceBeside> TorqueLaw<F> {
    /// The controller as a plan says, with a design for its slow force.
    pub(super) fn with(plan: &RobotPlan, design: TorqueDesign, beside: F) -> Made<Self> {
        let table = &plan.controller;
        let dynamics = Dynamics {
            mass_kg: given(table.mass_kg, "mass_kg")?,
            inertia_kg_m2: given(table.inertia_kg_m2, "inertia_kg_m2")?,
            ..Dynamics::default()
        };
        Ok(TorqueLaw {
            friction: WheelFriction::new(&plan.kinematics),
            is_held_back: false,
            before: None,
            kinematics: plan.kinematics.clone(),
            limits: plan.limits,
            gains: design.gains,
            filters: design.gains.map(|gains| Decay::new(gains.filter_1_s)),
            design,
            is_softer: false,
            averaged: AVERAGED,
            swings: [Swing::default(); MAX_WHEELS],
            noise_nm: rated_nm(plan).map(|rated_nm| NOISE_OF_RATED * rated_nm),
            dynamics,
            beside,
        })
    }

    /// The gains of now: at most the Kp that was set.
    fn gains(&self) -> [LoopGains; 3] {
        match self.design.softer.filter(|_| self.is_softer) {
            None => self.gains,
            Some(softer) => std::array::from_fn(|axis| LoopGains {
                kp_1_s: self.gains[axis].kp_1_s.min(softer[axis].kp_1_s),
                ..softer[axis]
            }),
        }
    }

    /// Whether what it commands swings: then the treads, or a floor on which they slip, aren't what it was designed for.
    fn watch(&mut self, commands: &Commands, time: &CycleTime) {
        if self.design.softer.is_none() || self.is_softer {
            return;
        }
        let taken = 1.0 - self.averaged.kept(time.period_s());
        let wheels = self.kinematics.wheel_count();
        for (wheel, swing) in self.swings.iter_mut().take(wheels).enumerate() {
            swing.see(commands.values[wheel], self.noise_nm[wheel], time.now_ns, taken);
        }
        self.is_softer = self.swings.iter().any(|swing| swing.half_swings >= HALF_SWINGS);
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

impl<F: ForceBeside> Controller for TorqueLaw<F> {
    fn quantity(&self) -> Quantity {
        Quantity::Torque
    }

    fn reset(&mut self) {
        self.beside.reset();
        self.before = None;
        (self.swings, self.is_softer) = ([Swing::default(); MAX_WHEELS], false);
    }

    fn limit_wheels(&mut self, limits: &WheelLimits) {
        self.limits.wheel_torque_nm = limits.torque_nm;
    }

    fn knows(&mut self, dynamics: &Dynamics) {
        self.dynamics = *dynamics;
    }

    fn limited_by_drives(&mut self) {
        self.is_held_back = true;
    }

    fn feels(&mut self, measurements: &Measurements) {
        self.beside.feel(&self.kinematics, measurements);
    }

    fn update(&mut self, time: &CycleTime, state: &PlatformState, setpoint: &Setpoint) -> Commands {
        let period_s = time.period_s();
        let error = pose_error(&setpoint.odom_from_body, &state.odom_from_body);
        let speed = axes(&state.twist_in_odom());
        let wished_speed = axes(&setpoint.twist_in_odom);
        let acceleration = axes(&setpoint.acceleration_in_odom);
        let age_s = state.twist_age_s;
        let gains = self.gains();
        // η is the speed against a wished one that includes the correction: żr − Kp·Ze, kept within the limits.
        let (corrected, correction) = within_speed(
            std::array::from_fn(|axis| wished_speed[axis] + gains[axis].kp_1_s * error[axis]),
            &self.limits,
        );
        let before = self.before.map_or([0.0; 3], |before| before.eta);
        let eta: [f64; 3] = std::array::from_fn(|axis| {
            let now = speed[axis] + age_s * acceleration[axis] - corrected[axis];
            let keep = self.filters[axis].kept_at(gains[axis].filter_1_s, period_s);
            keep * before[axis] + (1.0 - keep) * now
        });
        let led = self.led(acceleration, period_s);
        self.before = Some(Before { eta, acceleration });
        let beside = self.beside.force();
        let force: [f64; 3] = std::array::from_fn(|axis| beside[axis] - gains[axis].damping * eta[axis]);
        let lead_s = LEAD_PERIODS * period_s;
        let heading_rad = state.odom_from_body.heading_rad + lead_s * wished_speed[2];
        let wished_in_body = setpoint.twist_in_odom.rotated(-heading_rad);
        let [spin, roller] = self.friction.per_newton(axes(&wished_in_body), self.dynamics.centre_m());
        let [spin_n, roller_n] = self.dynamics.friction_n;
        let led_in_body = axes(&Twist2::new(led[0], led[1], led[2]).rotated(-heading_rad));
        let moved = self.dynamics.wrench(led_in_body, wished_speed[2]);
        let fed: [f64; 3] =
            std::array::from_fn(|axis| moved[axis] + spin_n * spin[axis] + roller_n * roller[axis]);
        let Wrench2 { fx_n, fy_n, torque_nm } = wrench(force).rotated(-heading_rad);
        let whole = Wrench2::new(fx_n + fed[0], fy_n + fed[1], torque_nm + fed[2]);
        let torques = self.kinematics.wheel_torques_nm(whole);
        let commands = saturated(Quantity::Torque, &torques, self.limits.wheel_torque_nm);
        self.watch(&commands, time);
        let is_held_back = std::mem::take(&mut self.is_held_back);
        self.beside.follow(&Done {
            period_s,
            gains: &gains,
            eta,
            faster: std::array::from_fn(|axis| speed[axis] + age_s * acceleration[axis] - wished_speed[axis]),
            heading_rad: state.odom_from_body.heading_rad,
            fed: wrench(fed),
            moves: setpoint.status == ReferenceStatus::Moving,
            is_held_back,
            is_whole: commands.saturation >= 1.0 && correction == Correction::Whole,
        });
        commands
    }

    fn gain(&self, index: usize) -> Option<Gain> {
        let name = *["kp_x_1_s", "kp_y_1_s", "kp_heading_1_s"].get(index)?;
        let gains = self.gains.get(index)?;
        Some(Gain { name, value: gains.kp_1_s, least: 0.0, greatest: self.design.gains.get(index)?.kp_1_s })
    }

    fn set_gain(&mut self, index: usize, value: f64) {
        if let Some(gains) = self.gains.get_mut(index) {
            gains.kp_1_s = value;
        }
    }

    fn force_n(&self) -> f64 {
        let [fx_n, fy_n, _] = self.beside.force();
        omnibase_platform::length([fx_n, fy_n])
    }

    fn design(&self) -> Option<&TorqueDesign> {
        Some(&self.design)
    }
}
