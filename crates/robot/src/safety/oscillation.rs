//! Whether a wheel's torque swings to and fro, fast and strongly: a control loop that rings, on a tread that gives way or
//! on a floor that doesn't hold it.

use crate::config::{RobotPlan, rated_nm};
use crate::decay::Decay;
use crate::signals::{Exchange, MAX_WHEELS};
use crate::stages::SafetyView;
use crate::swing::{AVERAGED, NOISE_OF_RATED, Swing};

/// So many in a row are no jerk that a tread gives back, and no corner.
const HALF_SWINGS: u32 = 5;

/// The swings of each wheel's measured torque about what it is on average.
#[derive(Clone, Debug)]
pub(super) struct OscillationWatch {
    /// How far a swing reaches at least to each side, as a part of the wheels' torque limit.
    share: f64,
    /// Rated torques at the wheels, N·m.
    rated_nm: [f64; MAX_WHEELS],
    averaged: Decay,
    wheels: [Swing; MAX_WHEELS],
}

impl OscillationWatch {
    pub(super) fn new(plan: &RobotPlan) -> Self {
        OscillationWatch {
            share: plan.safety.oscillation_share,
            rated_nm: rated_nm(plan),
            averaged: AVERAGED,
            wheels: [Swing::default(); MAX_WHEELS],
        }
    }

    /// Nothing was measured yet.
    pub(super) fn reset(&mut self) {
        self.wheels = [Swing::default(); MAX_WHEELS];
    }

    /// Takes in what was measured, once a cycle; without a complete exchange there is nothing new.
    pub(super) fn look(&mut self, view: &SafetyView<'_>) {
        if !matches!(view.exchange, Exchange::Complete) {
            return;
        }
        let least_nm =
            if self.share < 1.0 { self.share * view.wheel_limits.torque_nm } else { f64::INFINITY };
        let taken = 1.0 - self.averaged.kept(view.time.period_s());
        let drives = view.measurements.present().iter().zip(&self.rated_nm);
        for (wheel, (drive, rated_nm)) in self.wheels.iter_mut().zip(drives) {
            wheel.see(drive.torque_nm, least_nm.max(NOISE_OF_RATED * rated_nm), view.time.now_ns, taken);
        }
    }

    /// The first wheel whose torque swings.
    pub(super) fn swings(&self) -> Option<usize> {
        self.wheels.iter().position(|wheel| wheel.half_swings >= HALF_SWINGS)
    }
}
