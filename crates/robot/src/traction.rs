//! What the floor carries: how hard the platform may speed up and brake, and how hard its wheels may push.
//!
//! A wheel grips while its force on the floor stays below μ·N (C.-A. de Coulomb); its rim feels the part of it that lies along
//! it. N is its part of the weight, shifted by the platform's acceleration as the centre of mass stands above the floor. With a
//! friction μ that is counted on (`reliance.rs`) two things follow:
//! - the greatest part of the file's accelerations, of way and turn alike, at which every wheel still grips, in whatever
//!   direction, and overcomes the rollers of the others: the setpoint keeps to it under every law, stops too, so that fence
//!   and obstacles count with it;
//! - the most torque of each wheel: commands by torque are scaled as a whole, so that the direction of force is kept.
//!
//! With more than three wheels the same force on the body can be shared in many ways. The least torques are asked for first; where a wheel
//! can't give its part, the wheels that bear more take it over (`sharing.rs`).
//!
//! Where the file says nothing of the floor nothing is counted on or held back, but for wheels that spin while the robot stops.

mod reliance;
mod sharing;

use omnibase_platform::{Kinematics, MAX_WHEELS, PerWheel, Wrench2};

use crate::config::{Limits, RobotPlan};
use crate::grip::friction::WheelFriction;
use crate::grip::loads::Loads;
use crate::grip::{FirstEstimates, GRAVITY_M_S2};
use crate::motion::Carried;
use crate::signals::{Commands, CycleTime, GripReport, PlatformState, Quantity, Setpoint, TractionReport};
use reliance::Reliance;

/// The part of a friction counted on that accelerations are planned with; the rest is the control law's: its corrections, and
/// what rubs.
const PLANNED: f64 = 0.8;
/// What rollers take of what wheels push, over a wheel's load, before more is learnt; and of what the floor gives at most.
const ROLLERS: f64 = 0.03;
const MOST_ROLLERS: f64 = 0.5;
/// A wheel whose rim is further ahead spins, m/s: that is no doubt of an estimate.
const SPINS_M_S: f64 = 0.2;
/// After torques were held back, or a wheel slipped, the platform counts as behind for so long, s: what waits for it must not swing
/// with it.
const BEHIND_S: f64 = 0.1;
/// Less than this part of its acceleration is asked of no robot: it would never stand.
const LEAST_SHARE: f64 = 0.05;
/// A wheel is held back as if it bore this part of the mean load at least at rest: where a slope is taken for a centre of mass near one side, the
/// wheels beyond it would hold back all others until none brakes. And where the platform leans away from it, this part.
const LEAST_LOAD: f64 = 0.5;
const LEANING_LOAD: f64 = 0.1;
/// A wheel that slips gets this part of what it could push: its rim comes back to the platform's speed.
const SLIPPING: f64 = 0.5;

/// The stage.
#[derive(Clone, Debug)]
pub(crate) struct Traction {
    /// The force at each rim for 1 N along x and y, and 1 N·m.
    per_wrench: [[f64; 3]; MAX_WHEELS],
    /// The wrench on the body of 1 N at each rim.
    per_force: [[f64; 3]; MAX_WHEELS],
    /// The most that each wheel pushes against rollers that take 1 N each.
    per_roller: [f64; MAX_WHEELS],
    radius_m: [f64; MAX_WHEELS],
    /// The part of a wheel's force on the floor that its rim feels.
    rim_share: [f64; MAX_WHEELS],
    wheels: usize,
    loads: Loads,
    height_m: f64,
    /// What the robot's file says of floor and mass.
    told: Option<f64>,
    told_kg: f64,
    limits: Limits,
    reliance: Reliance,
    /// For how long the platform still counts as behind, s.
    behind_s: f64,
    report: TractionReport,
    /// How fast the rims of wheels that slip are ahead, m/s.
    slips_m_s: [f64; MAX_WHEELS],
}

impl Traction {
    pub(crate) fn new(plan: &RobotPlan) -> Self {
        let kinematics = &plan.kinematics;
        let mut traction = Traction {
            per_wrench: [[0.0; 3]; MAX_WHEELS],
            per_force: [[0.0; 3]; MAX_WHEELS],
            per_roller: [0.0; MAX_WHEELS],
            radius_m: [1.0; MAX_WHEELS],
            rim_share: [1.0; MAX_WHEELS],
            wheels: kinematics.wheel_count(),
            loads: Loads::new(kinematics),
            height_m: plan.grip.height_m,
            told: plan.grip.friction,
            told_kg: FirstEstimates::of(plan).mass.0,
            limits: plan.limits,
            reliance: Reliance::new(&plan.grip),
            behind_s: 0.0,
            report: TractionReport::default(),
            slips_m_s: [0.0; MAX_WHEELS],
        };
        traction.measure(kinematics);
        traction
    }

    fn measure(&mut self, kinematics: &Kinematics) {
        let units = [Wrench2::new(1.0, 0.0, 0.0), Wrench2::new(0.0, 1.0, 0.0), Wrench2::new(0.0, 0.0, 1.0)];
        for (axis, unit) in units.into_iter().enumerate() {
            let torques_nm = kinematics.wheel_torques_nm(unit);
            let rims = self.per_wrench.iter_mut().zip(&mut self.radius_m).zip(kinematics.wheels());
            for (((row, radius_m), wheel), torque_nm) in rims.zip(torques_nm.iter()) {
                *radius_m = wheel.radius_m;
                row[axis] = torque_nm / wheel.radius_m;
            }
        }
        for wheel in 0..self.wheels {
            let unit =
                PerWheel::from_fn(
                    self.wheels,
                    |other| if other == wheel { self.radius_m[wheel] } else { 0.0 },
                );
            let Wrench2 { fx_n, fy_n, torque_nm } = kinematics.wrench(&unit);
            self.per_force[wheel] = [fx_n, fy_n, torque_nm];
        }
        for (rim_share, wheel) in self.rim_share.iter_mut().zip(kinematics.wheels()) {
            *rim_share = wheel.rim_share();
        }
        let friction = WheelFriction::new(kinematics);
        for (per_roller, row) in self.per_roller.iter_mut().zip(&self.per_wrench) {
            let pushed =
                |roller: &[f64; 3]| row.iter().zip(roller).map(|(row, part)| row * part).sum::<f64>().abs();
            *per_roller = friction.rollers().iter().map(pushed).sum();
        }
    }

    /// What the floor carries from now on.
    pub(crate) fn look(
        &mut self,
        time: &CycleTime,
        grip: &GripReport,
        state: &PlatformState,
    ) -> TractionReport {
        let way_m = state.twist_in_body.speed_m_s() * time.period_s();
        self.reliance.look(grip, way_m);
        let slips = grip.slip_m_s.iter().zip(grip.slipped_m);
        for (slips_m_s, (ahead_m_s, way_m)) in self.slips_m_s.iter_mut().zip(slips) {
            *slips_m_s = if way_m > 0.0 { *ahead_m_s } else { 0.0 };
        }
        let friction = self.reliance.friction();
        let is_behind = friction.is_some() && (self.report.is_capped() || grip.slips());
        self.behind_s = if is_behind { BEHIND_S } else { (self.behind_s - time.period_s()).max(0.0) };
        let share = friction.map_or(1.0, |friction| self.share(PLANNED * friction, grip));
        self.report = TractionReport { friction, share, factor: 1.0 };
        self.report
    }

    /// What a motion that is followed has to keep to.
    pub(crate) fn carried(&self) -> Carried {
        Carried { share: self.report.share, is_behind: self.behind_s > 0.0 }
    }

    /// What was counted on in this cycle.
    pub(crate) fn report(&self) -> TractionReport {
        self.report
    }

    /// The platform's limits as far as the floor carries them.
    pub(crate) fn limits(&self) -> Limits {
        let (limits, share) = (self.limits, self.report.share);
        Limits {
            acceleration_m_s2: share * limits.acceleration_m_s2,
            turn_acceleration_rad_s2: share * limits.turn_acceleration_rad_s2,
            ..limits
        }
    }

    /// The greatest part of the limits' accelerations at which no wheel needs more friction than this.
    fn share(&self, friction: f64, grip: &GripReport) -> f64 {
        let Limits { acceleration_m_s2, turn_acceleration_rad_s2, .. } = self.limits;
        let dynamics = &grip.dynamics;
        let [along_x, along_y] = dynamics.mass_moment_kg_m;
        let mean_n = self.mean_n(grip);
        let [_, roller_n] = dynamics.friction_n;
        let roller_n = roller_n.max(ROLLERS * mean_n);
        let of_wheel = |wheel: usize| {
            let [x, y, turn] = self.per_wrench[wheel];
            // The rim's force, and by how much it becomes lighter, for an acceleration of 1 m/s² along x and y.
            let friction = friction * self.rim_share[wheel];
            let force = [dynamics.mass_kg * x - along_y * turn, dynamics.mass_kg * y + along_x * turn];
            let lighter =
                self.loads.shift(wheel).map(|shift| friction * mean_n * shift * self.height_m / GRAVITY_M_S2);
            let worst = |sign: f64| (sign * force[0] + lighter[0]).hypot(sign * force[1] + lighter[1]);
            let turning = dynamics.inertia_kg_m2 * turn - along_y * x + along_x * y;
            let needed_n =
                acceleration_m_s2 * worst(1.0).max(worst(-1.0)) + turn_acceleration_rad_s2 * turning.abs();
            let given_n = friction * mean_n * self.loads.of(wheel, dynamics.centre_m()).max(LEAST_LOAD);
            (given_n - (self.per_roller[wheel] * roller_n).min(MOST_ROLLERS * given_n)) / needed_n
        };
        let share = (0..self.wheels).map(of_wheel).fold(1.0, f64::min);
        // Before anything is known of a mass there is nothing to bound.
        if share.is_nan() { 1.0 } else { share.max(LEAST_SHARE) }
    }

    fn mean_n(&self, grip: &GripReport) -> f64 {
        grip.dynamics.mass_kg * GRAVITY_M_S2 / self.wheels as f64
    }

    /// Torques that the floor carries: all scaled alike where a wheel would slip. Where nothing is counted on each wheel that spins is
    /// caught by itself, and only once the platform `stops`: as long as it goes on its way tells that it has to.
    pub(crate) fn cap(
        &mut self,
        wished: Commands,
        (setpoint, grip): (&Setpoint, &GripReport),
        stops: bool,
    ) -> Commands {
        // A slope or a push makes a platform look light, and its wheels slip: a stop that believes that doesn't brake. What the file
        // tells counts there, where it is more.
        let counted =
            self.report.friction.map(|friction| if stops { self.told.unwrap_or(friction) } else { friction });
        let found = grip.friction.filter(|_| stops);
        let Some(friction) = counted.or(found).filter(|_| wished.quantity == Quantity::Torque) else {
            return wished;
        };
        let acceleration = setpoint.acceleration_in_odom.rotated(-setpoint.odom_from_body.heading_rad);
        let leans_m = self.height_m / GRAVITY_M_S2;
        let centre_m = grip.dynamics.centre_m();
        // How far inertia shifts where the weight presses.
        let leans = [-leans_m * acceleration.vx_m_s, -leans_m * acceleration.vy_m_s];
        let told_n = if stops { self.told_kg * GRAVITY_M_S2 / self.wheels as f64 } else { 0.0 };
        let (mean_n, [spin_n, _]) = (self.mean_n(grip).max(told_n), grip.dynamics.friction_n);
        let mut values = wished.values;
        let mut most = [0.0; MAX_WHEELS];
        for (wheel, (value, most_nm)) in values.iter().zip(&mut most).enumerate().take(self.wheels) {
            // What holds a spinning rim back ends its slip.
            let spins = self.slips_m_s[wheel] * *value > 0.0;
            let part = if spins { SLIPPING } else { 1.0 };
            // What the wheel's own bearing takes never reaches the floor.
            let given_n = part * self.rim_share[wheel] * friction * mean_n;
            let [by_x, by_y] = self.loads.shift(wheel);
            let rests = self.loads.of(wheel, centre_m).max(LEAST_LOAD);
            let load = (rests + by_x * leans[0] + by_y * leans[1]).max(LEANING_LOAD);
            *most_nm = self.radius_m[wheel] * load * (given_n + spin_n);
        }
        if counted.is_some() {
            sharing::share(
                &mut values[..self.wheels],
                &most[..self.wheels],
                (&self.per_force, &self.radius_m),
            );
        }
        let mut factor = 1.0_f64;
        for (wheel, value) in values.iter_mut().enumerate().take(self.wheels) {
            let (spins, most_nm) = (self.slips_m_s[wheel] * *value > 0.0, most[wheel]);
            match (value.abs() > most_nm, counted) {
                (true, Some(_)) => factor = factor.min(most_nm / value.abs()),
                // What the floor gives it doesn't depend on its torque: nothing turns the platform.
                (true, None) if spins && self.slips_m_s[wheel].abs() > SPINS_M_S => {
                    *value = most_nm.copysign(*value)
                }
                _ => {}
            }
        }
        self.report.factor = factor;
        Commands {
            values: values.map(|value| factor * value),
            saturation: factor * wished.saturation,
            ..wished
        }
    }
}
