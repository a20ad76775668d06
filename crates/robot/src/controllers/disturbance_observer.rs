//! Control by torque with a disturbance observer: what torques and accelerations disagree by is taken back as a force.
//!
//! The law is that of `torque_law.rs`, with d̂' = g·(F_m − F_f − M·(Z̈ − Z̈r) − d̂), in the cycle after: F_m the wrench by the torques
//! that the drives measure, F_f what was fed forward when they were asked for it, M the first estimates of mass and inertia (K.
//! Ohnishi, M. Shibata and T. Murakami, *Motion control for advanced mechatronics*, IEEE/ASME Trans. Mechatronics 1, 1996).
//!
//! Both wrenches go through the filter of the measured speed, so that they are as old as it.
//! - M is never what is learnt, for it is a part of the loop's gain; a wrong one shows in accelerations beside the wished one alone;
//! - what the drives gave is counted, not what they were asked for: torques that were scaled down wind nothing up;
//! - at rest, while a wheel slips and while a limit or the floor holds torques back d̂ stays as it is;
//! - behind lost exchanges what was measured tells of all cycles since the last.

use omnibase_platform::{Kinematics, PerWheel, Wrench2};

use super::torque_design::SlowForce;
use super::torque_law::{Done, ForceBeside, TorqueLaw, keys, most};
use crate::config::{Problem, RobotPlan, find_object};
use crate::decay::Decay;
use crate::estimators::SPEED_FILTER_RAD_S;
use crate::registry::{Kind, Made, given, optional};
use crate::signals::Measurements;
use crate::torque_loop::TorqueDesign;

/// A torque is asked for so many cycles before it is measured: two until it acts, and at the end of the one for which it holds.
const DELAY_PERIODS: usize = 3;

/// Its name and keys.
pub(super) fn kind() -> Kind {
    Kind {
        name: "disturbance_observer",
        meaning: "Wheel torques; a force that no model tells is what torques and accelerations disagree by",
        keys: keys().chain([optional("observer_1_s")]).collect(),
    }
}

/// The controller.
pub type DisturbanceObserver = TorqueLaw<Observer>;

impl DisturbanceObserver {
    /// The controller as a plan says.
    ///
    /// # Errors
    /// Where a drive doesn't map its torque, and as [`TorqueDesign::new`].
    pub fn new(plan: &RobotPlan) -> Made<Self> {
        if let Some(drive) = plan.drives.iter().find(|drive| find_object(&drive.inputs, 0x6077, 0).is_none())
        {
            let reason = format!(
                "an observer compares torques: {} must map its own (0x6077) among `inputs`",
                drive.name
            );
            return Err(Problem {
                value: Some("disturbance_observer".into()),
                ..Problem::refused("kind", reason)
            }
            .into());
        }
        let table = &plan.controller;
        let body = [given(table.mass_kg, "mass_kg")?, given(table.inertia_kg_m2, "inertia_kg_m2")?];
        let beside = Observer {
            body: [body[0], body[0], body[1]],
            most: most(plan),
            filter: Decay::new(plan.estimator.speed_filter_1_s.unwrap_or(SPEED_FILTER_RAD_S)),
            measured: None,
            fed: [Wrench2::default(); DELAY_PERIODS],
            beside_model: [0.0; 3],
            before: None,
            periods: 0,
            force: [0.0; 3],
        };
        TorqueLaw::with(plan, TorqueDesign::new(plan, SlowForce::Observer)?, beside)
    }
}

/// What torques and accelerations disagree by.
#[derive(Clone, Debug)]
pub struct Observer {
    /// Mass, mass and moment of inertia.
    body: [f64; 3],
    /// N, N and N·m.
    most: [f64; 3],
    filter: Decay,
    /// The wrench that the drives gave, in body axes; `None` in a cycle in which not all were heard.
    measured: Option<Wrench2>,
    /// What was fed forward in the cycles before, the oldest first.
    fed: [Wrench2; DELAY_PERIODS],
    /// What the drives gave beside that, in odom, behind the filter.
    beside_model: [f64; 3],
    /// By how much the platform was faster than the setpoint when all drives were heard last; `None` before that.
    before: Option<[f64; 3]>,
    /// Periods since then.
    periods: u32,
    force: [f64; 3],
}

impl ForceBeside for Observer {
    fn reset(&mut self) {
        (self.fed, self.beside_model) = ([Wrench2::default(); DELAY_PERIODS], [0.0; 3]);
        (self.measured, self.before, self.periods, self.force) = (None, None, 0, [0.0; 3]);
    }

    fn force(&self) -> [f64; 3] {
        self.force
    }

    fn feel(&mut self, kinematics: &Kinematics, measurements: &Measurements) {
        let present = measurements.present();
        let torques_nm = PerWheel::from_fn(present.len(), |wheel| present[wheel].torque_nm);
        self.measured = Some(kinematics.wrench(&torques_nm));
    }

    fn follow(&mut self, done: &Done<'_>) {
        let fed = self.fed[0];
        self.fed.rotate_left(1);
        self.fed[DELAY_PERIODS - 1] = done.fed;
        self.periods = self.periods.saturating_add(1);
        let Some(measured) = self.measured.take() else { return };
        let span_s = f64::from(std::mem::take(&mut self.periods)) * done.period_s;
        let beside = Wrench2::new(
            measured.fx_n - fed.fx_n,
            measured.fy_n - fed.fy_n,
            measured.torque_nm - fed.torque_nm,
        );
        let Wrench2 { fx_n, fy_n, torque_nm } = beside.rotated(done.heading_rad);
        let keep = self.filter.kept(span_s);
        for (held, now) in self.beside_model.iter_mut().zip([fx_n, fy_n, torque_nm]) {
            *held = keep * *held + (1.0 - keep) * now;
        }
        let Some(before) = self.before.replace(done.faster) else { return };
        if !done.moves || done.is_held_back {
            return;
        }
        for (axis, force) in self.force.iter_mut().enumerate() {
            let gains_n = self.body[axis] * (done.faster[axis] - before[axis]) / span_s;
            let part = 1.0 - (-done.gains[axis].observer_1_s * span_s).exp();
            let off = self.beside_model[axis] - gains_n - *force;
            *force = (*force + part * off).clamp(-self.most[axis], self.most[axis]);
        }
    }
}
