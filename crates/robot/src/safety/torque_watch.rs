//! Whether the torques that the drives measure keep their limit: a drive that doesn't obey it is found by that.

use crate::config::{RobotPlan, rated_nm};
use crate::signals::MAX_WHEELS;
use crate::stages::SafetyView;

/// How much of its limit a torque may lie above it by default.
const MARGIN_OF_LIMIT: f64 = 0.1;
/// And how much of the rated torque: what currents are measured by has noise however low the limit is.
const MARGIN_OF_RATED: f64 = 0.05;

/// How long each wheel's measured torque lay above its limit.
#[derive(Clone, Debug)]
pub(super) struct TorqueWatch {
    margin_nm: Option<f64>,
    tolerated_ns: u64,
    /// At the wheels, N·m.
    rated_nm: [f64; MAX_WHEELS],
    /// When was looked last, ns; `None` before the first look.
    last_ns: Option<u64>,
    wheels: [Wheel; MAX_WHEELS],
}

/// What is known of one wheel.
#[derive(Clone, Copy, Debug, Default)]
struct Wheel {
    /// Whether it was above when it was looked at last; it is taken to be so until the next look.
    is_above: bool,
    /// Time above the limit, ns; time below counts back.
    above_ns: u64,
}

impl TorqueWatch {
    pub(super) fn new(plan: &RobotPlan) -> Self {
        TorqueWatch {
            margin_nm: plan.safety.wheel_torque_margin_nm,
            tolerated_ns: plan.safety.wheel_torque_time_ns,
            rated_nm: rated_nm(plan),
            last_ns: None,
            wheels: [Wheel::default(); MAX_WHEELS],
        }
    }

    /// Nothing was measured yet.
    pub(super) fn reset(&mut self) {
        self.last_ns = None;
        self.wheels = [Wheel::default(); MAX_WHEELS];
    }

    /// Takes in what was measured, once a cycle; a measurement that a lost exchange left as it was goes on to count.
    pub(super) fn look(&mut self, view: &SafetyView<'_>) {
        let now_ns = view.time.now_ns;
        let elapsed_ns = now_ns.saturating_sub(self.last_ns.unwrap_or(now_ns));
        self.last_ns = Some(now_ns);
        let limit_nm = view.wheel_limits.torque_nm;
        let drives = view.measurements.present().iter().zip(&self.rated_nm);
        for (wheel, (drive, rated_nm)) in self.wheels.iter_mut().zip(drives) {
            let margin_nm = (MARGIN_OF_LIMIT * limit_nm).max(MARGIN_OF_RATED * rated_nm);
            let is_within = drive.torque_nm.abs() <= limit_nm + self.margin_nm.unwrap_or(margin_nm);
            wheel.above_ns = match wheel.is_above {
                true => wheel.above_ns.saturating_add(elapsed_ns),
                false => wheel.above_ns.saturating_sub(elapsed_ns),
            };
            // What is no number isn't within anything.
            wheel.is_above = !is_within;
        }
    }

    /// The first wheel whose torque lay above its limit for longer than is tolerated.
    pub(super) fn above(&self) -> Option<usize> {
        self.wheels.iter().position(|wheel| wheel.above_ns > self.tolerated_ns)
    }
}
