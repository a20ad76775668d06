//! Whether a wheel is driven on beyond its speed limit by its own motor: no ramp of a law that does so would end.
//!
//! What turns a wheel from outside, a push or a slope, does it against the motor, or without it.

use crate::config::{RobotPlan, rated_nm};
use crate::signals::{Exchange, MAX_WHEELS, Quantity};
use crate::stages::SafetyView;

use super::WHEEL_SPEED_MARGIN;

/// For so long a law may take to turn its torque round, ns: delay, filter and drive; less would stop a wheel that slipped and is caught.
const DRIVEN_NS: u64 = 20_000_000;
/// Less than this part of the rated torque is noise.
const NOISE_OF_RATED: f64 = 0.05;

/// For how long each wheel was driven on, ns; time in which it wasn't counts back.
#[derive(Clone, Debug)]
pub(super) struct OverspeedWatch {
    /// At the wheels, N·m.
    rated_nm: [f64; MAX_WHEELS],
    /// Whether every drive tells its torque; else what a law of torques commands counts.
    is_told: bool,
    driven_ns: [u64; MAX_WHEELS],
}

impl OverspeedWatch {
    pub(super) fn new(plan: &RobotPlan) -> Self {
        OverspeedWatch { rated_nm: rated_nm(plan), is_told: plan.tells_torques(), driven_ns: [0; MAX_WHEELS] }
    }

    /// Nothing was measured yet.
    pub(super) fn reset(&mut self) {
        self.driven_ns = [0; MAX_WHEELS];
    }

    /// Takes in what was measured, once a cycle; without a complete exchange there is nothing new.
    pub(super) fn look(&mut self, view: &SafetyView<'_>) {
        if view.exchange != Exchange::Complete {
            return;
        }
        let period_ns = (view.time.period_s() * 1e9) as u64;
        let limit_rad_s = WHEEL_SPEED_MARGIN * view.wheel_limits.speed_rad_s;
        let by_torque = view.commands.quantity == Quantity::Torque;
        let wheels = self.driven_ns.iter_mut().zip(self.rated_nm.iter().zip(&view.commands.values));
        for ((driven_ns, (rated_nm, told_nm)), drive) in wheels.zip(view.measurements.present()) {
            let torque_nm = match self.is_told {
                true => drive.torque_nm,
                false if by_torque => *told_nm,
                false => 0.0,
            };
            let driving_nm = torque_nm * drive.speed_rad_s.signum();
            let is_driven = drive.speed_rad_s.abs() > limit_rad_s && driving_nm > NOISE_OF_RATED * rated_nm;
            *driven_ns = match is_driven {
                true => driven_ns.saturating_add(period_ns),
                false => driven_ns.saturating_sub(period_ns),
            };
        }
    }

    /// The first wheel that is driven on.
    pub(super) fn driven(&self) -> Option<usize> {
        self.driven_ns.iter().position(|driven_ns| *driven_ns >= DRIVEN_NS)
    }
}
