//! What the floor carries: how hard the platform may speed up and brake, and how hard its wheels may push.
//!
//! A wheel grips while the force at its rim stays below μ·N (C.-A. de Coulomb). N is its part of the weight, shifted by the
//! platform's acceleration as the centre of mass stands above the floor. With a friction μ that is counted on
//! (`reliance.rs`) two things follow:
//! - the greatest part of the file's accelerations, of way and turn alike, at which every wheel still grips, in whatever
//!   direction: the setpoint keeps to it under every law, stops too, so that fence and obstacles count with it;
//! - the most torque of each wheel: commands by torque are scaled as a whole, so that the direction of force is kept.
//!
//! Nothing is counted on, and nothing held back, where the file says nothing of the floor.

mod reliance;

use omnibase_platform::{Kinematics, MAX_WHEELS, Wrench2};

use crate::config::{Limits, RobotPlan};
use crate::grip::GRAVITY_M_S2;
use crate::grip::loads::Loads;
use crate::signals::{Commands, CycleTime, GripReport, PlatformState, Quantity, Setpoint, TractionReport};
use reliance::Reliance;

/// The part of a friction counted on that accelerations are planned with; the rest is the control law's: its corrections, and
/// what rubs.
const PLANNED: f64 = 0.8;
/// Less than this part of its acceleration is asked of no robot: it would never stand.
const LEAST_SHARE: f64 = 0.05;
/// A wheel that slips gets this part of what it could push: its rim comes back to the platform's speed.
const SLIPPING: f64 = 0.5;

/// The stage.
#[derive(Clone, Debug)]
pub(crate) struct Traction {
    /// The force at each rim for 1 N along x and y, and 1 N·m.
    per_wrench: [[f64; 3]; MAX_WHEELS],
    radius_m: [f64; MAX_WHEELS],
    wheels: usize,
    loads: Loads,
    height_m: f64,
    limits: Limits,
    reliance: Reliance,
    report: TractionReport,
    slips: [bool; MAX_WHEELS],
}

impl Traction {
    pub(crate) fn new(plan: &RobotPlan) -> Self {
        let kinematics = &plan.kinematics;
        let mut traction = Traction {
            per_wrench: [[0.0; 3]; MAX_WHEELS],
            radius_m: [1.0; MAX_WHEELS],
            wheels: kinematics.wheel_count(),
            loads: Loads::new(kinematics),
            height_m: plan.grip.height_m,
            limits: plan.limits,
            reliance: Reliance::new(&plan.grip),
            report: TractionReport::default(),
            slips: [false; MAX_WHEELS],
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
        self.slips = grip.slipped_m.map(|way_m| way_m > 0.0);
        let friction = self.reliance.friction();
        let share = friction.map_or(1.0, |friction| self.share(PLANNED * friction, grip));
        self.report = TractionReport { friction, share, factor: 1.0 };
        self.report
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
        let of_wheel = |wheel: usize| {
            let [x, y, turn] = self.per_wrench[wheel];
            // The rim's force, and by how much it becomes lighter, for an acceleration of 1 m/s² along x and y.
            let force = [dynamics.mass_kg * x - along_y * turn, dynamics.mass_kg * y + along_x * turn];
            let lighter =
                self.loads.shift(wheel).map(|shift| friction * mean_n * shift * self.height_m / GRAVITY_M_S2);
            let worst = |sign: f64| (sign * force[0] + lighter[0]).hypot(sign * force[1] + lighter[1]);
            let turning = dynamics.inertia_kg_m2 * turn - along_y * x + along_x * y;
            let needed_n =
                acceleration_m_s2 * worst(1.0).max(worst(-1.0)) + turn_acceleration_rad_s2 * turning.abs();
            friction * mean_n * self.loads.of(wheel, dynamics.centre_m()) / needed_n
        };
        let share = (0..self.wheels).map(of_wheel).fold(1.0, f64::min);
        // Before anything is known of a mass there is nothing to bound.
        if share.is_nan() { 1.0 } else { share.max(LEAST_SHARE) }
    }

    fn mean_n(&self, grip: &GripReport) -> f64 {
        grip.dynamics.mass_kg * GRAVITY_M_S2 / self.wheels as f64
    }

    /// Torques that the floor carries: all scaled alike where a wheel would spin.
    pub(crate) fn cap(&mut self, wished: Commands, (setpoint, grip): (&Setpoint, &GripReport)) -> Commands {
        let Some(friction) = self.report.friction.filter(|_| wished.quantity == Quantity::Torque) else {
            return wished;
        };
        let acceleration = setpoint.acceleration_in_odom.rotated(-setpoint.odom_from_body.heading_rad);
        let leans_m = self.height_m / GRAVITY_M_S2;
        let [x, y] = grip.dynamics.centre_m();
        // Where weight and inertia together press.
        let pressed = [x - leans_m * acceleration.vx_m_s, y - leans_m * acceleration.vy_m_s];
        let (mean_n, [spin_n, _]) = (self.mean_n(grip), grip.dynamics.friction_n);
        let factor = (0..self.wheels).fold(1.0_f64, |factor, wheel| {
            let load = self.loads.of(wheel, pressed);
            let part = if self.slips[wheel] { SLIPPING } else { 1.0 };
            // What the wheel's own bearing takes never reaches the floor.
            let most_nm = self.radius_m[wheel] * load * (part * friction * mean_n + spin_n);
            let size = wished.values[wheel].abs();
            if size > most_nm { factor.min(most_nm / size) } else { factor }
        });
        self.report.factor = factor;
        let values = wished.values.map(|value| factor * value);
        Commands { values, saturation: factor * wished.saturation, ..wished }
    }
}
