//! How a platform's wheels stand on the floor: what each pushes for an acceleration, and what the floor gives it.

use omnibase_platform::{Kinematics, MAX_WHEELS, Wrench2, axes, length};
use omnibase_trajectory::reach::resisting;

use crate::grip::GRAVITY_M_S2;
use crate::grip::friction::WheelFriction;
use crate::grip::loads::Loads;
use crate::signals::{Dynamics, Setpoint};

/// What rollers take of what wheels push, over a wheel's load, before more is learnt; and of what the floor gives at most.
const ROLLERS: f64 = 0.03;
const MOST_ROLLERS: f64 = 0.5;
/// No wheel is taken to bear less, N.
const LEAST_N: f64 = 1e-3;
/// A wheel bears this part of the mean load at least at rest: where a slope is taken for a centre of mass near one side, the wheels
/// beyond it would hold back all others until none brakes.
pub(super) const LEAST_LOAD: f64 = 0.5;

/// The wheels.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Footing {
    /// The force at each rim for 1 N along x and y, and 1 N·m.
    per_wrench: [[f64; 3]; MAX_WHEELS],
    /// The most that each wheel pushes against rollers that take 1 N each.
    per_roller: [f64; MAX_WHEELS],
    /// The wrench of 1 N against the rollers of each wheel.
    rollers: Vec<[f64; 3]>,
    pub(super) radius_m: [f64; MAX_WHEELS],
    /// The part of a wheel's force on the floor that its rim feels.
    pub(super) rim_share: [f64; MAX_WHEELS],
    pub(super) wheels: usize,
    pub(super) loads: Loads,
    pub(super) height_m: f64,
}

/// What a moment of a motion asks of the wheel that it asks most of.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Needs {
    /// The friction on which it grips.
    pub(crate) friction: f64,
    /// Its torque, N·m.
    pub(crate) torque_nm: f64,
}

/// What a wheel pushes for an acceleration in base_link (m/s², m/s², rad/s²), and what it may.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Push {
    /// Its force at the rim, by the acceleration, N.
    pub(crate) force: [f64; 3],
    /// By how much the floor gives it less, by the acceleration along x and y, N.
    pub(crate) lighter: [f64; 2],
    /// How much of what a unit of each axis of a wrench against the motion takes its rim pushes, N.
    pub(crate) resisted: [f64; 3],
    /// What the floor gives it at rest; and beyond what rollers take, N.
    pub(crate) given_n: f64,
    pub(crate) left_n: f64,
}

impl Footing {
    /// A centre of mass stands at a height over the floor, m.
    pub(crate) fn new(kinematics: &Kinematics, height_m: f64) -> Self {
        let mut footing = Footing {
            per_wrench: [[0.0; 3]; MAX_WHEELS],
            per_roller: [0.0; MAX_WHEELS],
            rollers: WheelFriction::new(kinematics).rollers().to_vec(),
            radius_m: [1.0; MAX_WHEELS],
            rim_share: [1.0; MAX_WHEELS],
            wheels: kinematics.wheel_count(),
            loads: Loads::new(kinematics),
            height_m,
        };
        let units = [Wrench2::new(1.0, 0.0, 0.0), Wrench2::new(0.0, 1.0, 0.0), Wrench2::new(0.0, 0.0, 1.0)];
        for (axis, unit) in units.into_iter().enumerate() {
            let torques_nm = kinematics.wheel_torques_nm(unit);
            let rims = footing.per_wrench.iter_mut().zip(&mut footing.radius_m).zip(kinematics.wheels());
            for (((row, radius_m), wheel), torque_nm) in rims.zip(torques_nm.iter()) {
                *radius_m = wheel.radius_m;
                row[axis] = torque_nm / wheel.radius_m;
            }
        }
        for (rim_share, wheel) in footing.rim_share.iter_mut().zip(kinematics.wheels()) {
            *rim_share = wheel.rim_share();
        }
        let friction = WheelFriction::new(kinematics);
        for (per_roller, row) in footing.per_roller.iter_mut().zip(&footing.per_wrench) {
            let pushed =
                |roller: &[f64; 3]| row.iter().zip(roller).map(|(row, part)| row * part).sum::<f64>().abs();
            *per_roller = friction.rollers().iter().map(pushed).sum();
        }
        footing
    }

    pub(crate) fn wheel_count(&self) -> usize {
        self.wheels
    }

    /// The wrench of each wheel's rollers over the direction of a motion.
    pub(crate) fn roller_wrenches(&self, dynamics: &Dynamics) -> Vec<[f64; 3]> {
        let roller_n = self.roller_n(dynamics);
        self.rollers.iter().map(|roller| roller.map(|part| roller_n * part)).collect()
    }

    /// What a moment of a motion asks of the wheels, of a platform that a slope pulls so in its axes, m/s².
    pub(crate) fn needs(
        &self,
        setpoint: &Setpoint,
        dynamics: &Dynamics,
        [pull_x, pull_y]: [f64; 2],
    ) -> Needs {
        let turn_rad = -setpoint.odom_from_body.heading_rad;
        let [twist, [x, y, turn]] = [setpoint.twist_in_odom, setpoint.acceleration_in_odom]
            .map(|twist| axes(&twist.rotated(turn_rad)));
        // Who is held on a slope pushes, and leans, as who speeds up against it.
        let [x, y] = [x - pull_x, y - pull_y];
        let roller_n = self.roller_n(dynamics);
        let mut rollers = [[0.0; 3]; MAX_WHEELS];
        for (row, roller) in rollers.iter_mut().zip(&self.rollers) {
            *row = roller.map(|part| roller_n * part);
        }
        let resistance = resisting(&rollers[..self.rollers.len()], &twist);
        let mut needs = Needs::default();
        for wheel in 0..self.wheels {
            let push = self.push(wheel, 1.0, dynamics);
            let resisted: f64 = push.resisted.iter().zip(resistance).map(|(part, of)| part * of).sum();
            let force_n = push.force[0] * x + push.force[1] * y + push.force[2] * turn;
            let load_n = push.given_n - push.lighter[0] * x - push.lighter[1] * y;
            // What resists helps to brake, but isn't counted on.
            let needed_n = force_n.abs() + (resisted * force_n.signum()).max(0.0);
            needs.friction = needs.friction.max(needed_n / load_n.max(LEAST_N));
            needs.torque_nm = needs.torque_nm.max(self.radius_m[wheel] * force_n.abs());
        }
        needs
    }

    /// The friction by which every wheel grips that holds its part of a platform on a slope of such a pull, m/s².
    pub(crate) fn slope_friction(&self, dynamics: &Dynamics, pull_m_s2: f64) -> f64 {
        let of_wheel = |wheel: usize| {
            let Push { force: [x, y, _], lighter, given_n, .. } = self.push(wheel, 1.0, dynamics);
            let load_n = given_n - pull_m_s2 * length(lighter);
            pull_m_s2 * length([x, y]) / load_n.max(LEAST_N)
        };
        if pull_m_s2 == 0.0 { 0.0 } else { (0..self.wheels).map(of_wheel).fold(0.0, f64::max) }
    }

    /// What a wheel's rollers take, N.
    fn roller_n(&self, dynamics: &Dynamics) -> f64 {
        let [_, roller_n] = dynamics.friction_n;
        roller_n.max(ROLLERS * self.mean_n(dynamics.mass_kg))
    }

    /// Mean load of a wheel, N.
    pub(crate) fn mean_n(&self, mass_kg: f64) -> f64 {
        mass_kg * GRAVITY_M_S2 / self.wheels as f64
    }

    /// What a wheel pushes on a floor of a friction.
    pub(crate) fn push(&self, wheel: usize, friction: f64, dynamics: &Dynamics) -> Push {
        let [along_x, along_y] = dynamics.mass_moment_kg_m;
        let mean_n = self.mean_n(dynamics.mass_kg);
        let roller_n = self.roller_n(dynamics);
        let [x, y, turn] = self.per_wrench[wheel];
        let friction = friction * self.rim_share[wheel];
        let given_n = friction * mean_n * self.loads.of(wheel, dynamics.centre_m()).max(LEAST_LOAD);
        Push {
            force: [
                dynamics.mass_kg * x - along_y * turn,
                dynamics.mass_kg * y + along_x * turn,
                dynamics.inertia_kg_m2 * turn - along_y * x + along_x * y,
            ],
            lighter: self
                .loads
                .shift(wheel)
                .map(|shift| friction * mean_n * shift * self.height_m / GRAVITY_M_S2),
            resisted: self.per_wrench[wheel],
            given_n,
            left_n: given_n - (self.per_roller[wheel] * roller_n).min(MOST_ROLLERS * given_n),
        }
    }
}
