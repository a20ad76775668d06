//! Control by torque that learns mass, inertia, friction and a slow force, with a loop that has margins on every tread.
//!
//! The law is that of `torque_law.rs`, with a slow force d̂' = −i·K·low-pass(η). d̂ learns nothing at rest, while a wheel slips or torques
//! are saturated, here or by a drive, nor from an η within the measurement's noise, and stays within its bounds.

use super::torque_design::{INTEGRAL_1_S, SlowForce};
use super::torque_law::{Done, ForceBeside, TorqueLaw, keys, lever_m, most};
use crate::config::RobotPlan;
use crate::registry::{Kind, Made};
use crate::torque_loop::TorqueDesign;

/// η below this is noise and says nothing, m/s (as a surface speed about the vertical axis): some counts of a 20-bit
/// encoder over the speed filter's time.
const NOISE_M_S: f64 = 1e-4;

/// Its name and keys.
pub(super) fn kind() -> Kind {
    Kind {
        name: "adaptive_torque",
        meaning: "Wheel torques; mass, inertia and friction are learnt while tracking",
        keys: keys().collect(),
    }
}

/// The controller.
pub type AdaptiveTorque = TorqueLaw<AddedUp>;

impl AdaptiveTorque {
    /// The controller as a plan says.
    pub fn new(plan: &RobotPlan) -> Made<Self> {
        let beside = AddedUp { most: most(plan), lever_m: lever_m(plan), force: [0.0; 3] };
        TorqueLaw::with(plan, TorqueDesign::new(plan, SlowForce::Integral)?, beside)
    }
}

/// What the law's error asked for, added up.
#[derive(Clone, Debug)]
pub struct AddedUp {
    /// N, N and N·m.
    most: [f64; 3],
    /// By what a force becomes a moment, m.
    lever_m: f64,
    force: [f64; 3],
}

impl ForceBeside for AddedUp {
    fn reset(&mut self) {
        self.force = [0.0; 3];
    }

    fn force(&self) -> [f64; 3] {
        self.force
    }

    fn follow(&mut self, done: &Done<'_>) {
        let [x, y, turn] = done.eta;
        let says = [x, y, turn * self.lever_m].iter().any(|eta| eta.abs() > NOISE_M_S);
        if !done.moves || !done.is_whole || done.is_held_back || !says {
            return;
        }
        for (axis, force) in self.force.iter_mut().enumerate() {
            let rate = -INTEGRAL_1_S * done.gains[axis].damping * done.eta[axis];
            *force = (*force + done.period_s * rate).clamp(-self.most[axis], self.most[axis]);
        }
    }
}
