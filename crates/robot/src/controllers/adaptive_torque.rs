//! Control by torque that learns mass, inertia, friction and a slow force, with a loop that has margins on every tread.
//!
//! Ze = Z − Zr, η = Ż + Kp·Ze − Żr, wrench F = M̂·Z̈r − K·low-pass(η) + friction + d̂, τ = R·B⁻ᵀ·Rot(ψ)ᵀ·F. After
//! Slotine and Li (*Applied Nonlinear Control*, 1991, section 9.2), made fit for a machine:
//! - K is the whole gain, and it, Kp and the low-pass come from the loop of wheel, tread and delay (`torque_design.rs`). What
//!   is learnt feeds forward and never changes the gain;
//! - mass, inertia and the friction of wheels and rollers are learnt from what wrenches did (`grip.rs`), which closes
//!   no loop; a slow force d̂' = −i·K·low-pass(η) takes what no model tells, and the loop's margins count with it;
//! - mass and friction are fed forward for the instant at which the torque acts;
//! - the measured speed is brought up to the instant of the pose, by the reference's acceleration;
//! - the correction asks for no more speed than the platform may, or a robot that was held fast would come back faster;
//! - where the file says what the treads are, and torques swing all the same, it goes on with the gains for all treads until it begins anew;
//! - d̂ learns nothing at rest, while a wheel slips or torques are saturated, here or by a drive, nor from an η within the
//!   measurement's noise, and stays within its bounds.

use omnibase_platform::{Kinematics, Twist2, axes, pose_error};

use super::torque_design::{INTEGRAL_1_S, TorqueDesign};
use super::torque_loop::LoopGains;
use super::{Correction, LEAD_PERIODS, saturated, within_speed, wrench};
use crate::config::{Limits, RobotPlan, WheelLimits, rated_nm};
use crate::grip::friction::WheelFriction;
use crate::registry::{Kind, Made, given, needed, optional};
use crate::signals::{
    Commands, CycleTime, Dynamics, MAX_WHEELS, PlatformState, Quantity, ReferenceStatus, Setpoint,
};
use crate::stages::{Controller, Gain};
use crate::swing::{NOISE_OF_RATED, Swing, taken};

/// η below this is noise and says nothing, m/s (as a surface speed about the vertical axis): some counts of a 20-bit
/// encoder over the speed filter's time.
const NOISE_M_S: f64 = 1e-4;

/// So many half swings of what it commands, and its gains are those for all treads: before the stop for a torque that swings.
const HALF_SWINGS: u32 = 3;

/// Its name and keys.
pub(super) fn kind() -> Kind {
    let gains = ["torque_kp_1_s", "damping_n_s_m", "turn_damping_n_m_s_rad", "torque_filter_1_s"];
    let treads = ["tread_stiffness_n_m", "tread_damping_ratio", "wheel_inertia_kg_m2", "torque_lag_us"];
    let estimates = ["mass_bounds_kg", "inertia_bounds_kg_m2", "friction_max_n"];
    let may_be_given = [gains.as_slice(), &treads, &estimates].into_iter().flatten().copied().map(optional);
    Kind {
        name: "adaptive_torque",
        meaning: "Wheel torques; mass, inertia and friction are learnt while tracking",
        keys: ["mass_kg", "inertia_kg_m2"].map(needed).into_iter().chain(may_be_given).collect(),
    }
}

/// The controller.
#[derive(Clone, Debug)]
pub struct AdaptiveTorque {
    kinematics: Kinematics,
    limits: Limits,
    gains: [LoopGains; 3],
    /// Those for where torques swing, and whether they do since it began.
    softer: Option<[LoopGains; 3]>,
    is_softer: bool,
    swings: [Swing; MAX_WHEELS],
    /// What reaches less far is no swing, N·m.
    noise_nm: [f64; MAX_WHEELS],
    /// The greatest Kp that the design allows, 1/s.
    greatest_kp_1_s: [f64; 3],
    friction_max_n: f64,
    dynamics: Dynamics,
    /// What no model tells, in odom, N and N·m.
    force: [f64; 3],
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

impl AdaptiveTorque {
    /// The controller as a plan says.
    pub fn new(plan: &RobotPlan) -> Made<Self> {
        let table = &plan.controller;
        let design = TorqueDesign::new(plan)?;
        let friction = WheelFriction::new(&plan.kinematics);
        let friction_max_n = table.friction_max_n.unwrap_or(100.0);
        let dynamics = Dynamics {
            mass_kg: given(table.mass_kg, "mass_kg")?,
            inertia_kg_m2: given(table.inertia_kg_m2, "inertia_kg_m2")?,
            ..Dynamics::default()
        };
        Ok(AdaptiveTorque {
            lever_m: friction.lever_m(),
            friction,
            is_held_back: false,
            before: None,
            kinematics: plan.kinematics.clone(),
            limits: plan.limits,
            greatest_kp_1_s: design.gains.map(|gains| gains.kp_1_s),
            gains: design.gains,
            softer: design.softer,
            is_softer: false,
            swings: [Swing::default(); MAX_WHEELS],
            noise_nm: rated_nm(plan).map(|rated_nm| NOISE_OF_RATED * rated_nm),
            friction_max_n,
            dynamics,
            force: [0.0; 3],
        })
    }

    /// The gains of now: at most the Kp that was set.
    fn gains(&self) -> [LoopGains; 3] {
        match self.softer.filter(|_| self.is_softer) {
            None => self.gains,
            Some(softer) => std::array::from_fn(|axis| LoopGains {
                kp_1_s: self.gains[axis].kp_1_s.min(softer[axis].kp_1_s),
                ..softer[axis]
            }),
        }
    }

    /// Whether what it commands swings: then the treads, or a floor on which they slip, aren't what it was designed for.
    fn watch(&mut self, commands: &Commands, time: &CycleTime) {
        if self.softer.is_none() || self.is_softer {
            return;
        }
        let taken = taken(time.period_s());
        let wheels = self.kinematics.wheel_count();
        for (wheel, swing) in self.swings.iter_mut().take(wheels).enumerate() {
            swing.see(commands.values[wheel], self.noise_nm[wheel], time.now_ns, taken);
        }
        self.is_softer = self.swings.iter().any(|swing| swing.half_swings >= HALF_SWINGS);
    }

    /// The slow force follows what η asks for.
    fn observe(&mut self, eta: &[f64; 3], gains: &[LoopGains; 3], period_s: f64) {
        let surface = [eta[0], eta[1], eta[2] * self.lever_m];
        if surface.iter().all(|eta| eta.abs() <= NOISE_M_S) {
            return;
        }
        for (axis, force) in self.force.iter_mut().enumerate() {
            let most = if axis == 2 { self.lever_m * self.friction_max_n } else { self.friction_max_n };
            let rate = -INTEGRAL_1_S * gains[axis].damping * eta[axis];
            *force = (*force + period_s * rate).clamp(-most, most);
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
        self.force = [0.0; 3];
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
            let keep = (-gains[axis].filter_1_s * period_s).exp();
            keep * before[axis] + (1.0 - keep) * now
        });
        let led = self.led(acceleration, period_s);
        self.before = Some(Before { eta, acceleration });
        let force: [f64; 3] = std::array::from_fn(|axis| self.force[axis] - gains[axis].damping * eta[axis]);
        let lead_s = LEAD_PERIODS * period_s;
        let heading_rad = state.odom_from_body.heading_rad + lead_s * wished_speed[2];
        let wished_in_body = setpoint.twist_in_odom.rotated(-heading_rad);
        let friction_per_newton = self.friction.per_newton(axes(&wished_in_body), self.dynamics.centre_m());
        let mut wrench_in_body = wrench(force).rotated(-heading_rad);
        let led_in_body = axes(&Twist2::new(led[0], led[1], led[2]).rotated(-heading_rad));
        let moved = (1.0, self.dynamics.wrench(led_in_body, wished_speed[2]));
        let [spin_n, roller_n] = self.dynamics.friction_n;
        let rubbed = [spin_n, roller_n].into_iter().zip(friction_per_newton);
        for (factor, [fx_n, fy_n, torque_nm]) in rubbed.chain([moved]) {
            wrench_in_body.fx_n += factor * fx_n;
            wrench_in_body.fy_n += factor * fy_n;
            wrench_in_body.torque_nm += factor * torque_nm;
        }
        let torques = self.kinematics.wheel_torques_nm(wrench_in_body);
        let commands = saturated(Quantity::Torque, &torques, self.limits.wheel_torque_nm);
        self.watch(&commands, time);
        let is_held_back = std::mem::take(&mut self.is_held_back);
        let moves = setpoint.status == ReferenceStatus::Moving;
        let is_obeyed = commands.saturation >= 1.0 && correction == Correction::Whole && !is_held_back;
        if moves && is_obeyed {
            self.observe(&eta, &gains, period_s);
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

    fn force_n(&self) -> f64 {
        let [fx_n, fy_n, _] = self.force;
        omnibase_platform::length([fx_n, fy_n])
    }
}
