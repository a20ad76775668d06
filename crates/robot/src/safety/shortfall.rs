//! Whether a motor gives less torque than it is asked for: weaker than the robot's file says, too hot, or out of voltage.
//!
//! A law of torques asks in numbers. Under a law of speeds the drive asks, and says so: a limit of its own is active
//! (bit 11 of the status word) at less torque than it is allowed, and its wheel falls behind.

use crate::config::{RobotPlan, rated_nm};
use crate::signals::{Commands, Exchange, MAX_WHEELS, Quantity};
use crate::stages::SafetyView;

/// How much of what is asked for may be missing: of the wheel's torque limit, and of the rated torque.
const MARGIN_OF_LIMIT: f64 = 0.1;
const MARGIN_OF_RATED: f64 = 0.1;
/// For how long, ns: a motor takes a moment, and a tread gives back.
const LASTING_NS: u64 = 100_000_000;
/// By so much of its speed limit a wheel that falls behind is slower than it is asked to be.
const BEHIND_SHARE: f64 = 0.1;

/// How long each motor gave too little.
#[derive(Clone, Debug)]
pub(super) struct ShortfallWatch {
    /// At the wheels, N·m.
    rated_nm: [f64; MAX_WHEELS],
    /// What was asked for lately, and the place of the oldest: it is measured two cycles later.
    asked: [Commands; 3],
    oldest: usize,
    short_ns: [u64; MAX_WHEELS],
}

impl ShortfallWatch {
    pub(super) fn new(plan: &RobotPlan) -> Self {
        let asked = [Commands::default(); 3];
        ShortfallWatch { rated_nm: rated_nm(plan), asked, oldest: 0, short_ns: [0; MAX_WHEELS] }
    }

    /// Nothing was asked for yet.
    pub(super) fn reset(&mut self) {
        (self.asked, self.short_ns) = ([Commands::default(); 3], [0; MAX_WHEELS]);
    }

    /// Takes in what was measured, once a cycle, and what was allowed in the one before.
    pub(super) fn look(&mut self, view: &SafetyView<'_>) {
        let asked = &self.asked[self.oldest];
        let (limit_nm, limit_rad_s) = (view.wheel_limits.torque_nm, view.wheel_limits.speed_rad_s);
        let period_ns = (view.time.period_s() * 1e9) as u64;
        for (wheel, drive) in view.measurements.present().iter().enumerate() {
            let margin_nm = (MARGIN_OF_LIMIT * limit_nm).max(MARGIN_OF_RATED * self.rated_nm[wheel]);
            let (torque_nm, asked) = (drive.torque_nm, (asked.quantity, asked.values[wheel]));
            let is_short = match asked {
                (Quantity::Nothing, _) => false,
                (Quantity::Torque, asked_nm) => {
                    asked_nm.signum() * torque_nm < asked_nm.abs().min(limit_nm) - margin_nm
                }
                (Quantity::Speed, asked_rad_s) => {
                    let behind_rad_s = torque_nm.signum() * (asked_rad_s - drive.speed_rad_s);
                    let is_behind = behind_rad_s > BEHIND_SHARE * limit_rad_s;
                    drive.is_held_back() && torque_nm.abs() < limit_nm - margin_nm && is_behind
                }
            };
            let counts = is_short && view.exchange == Exchange::Complete && !view.has_torque_drives;
            self.short_ns[wheel] = if counts { self.short_ns[wheel] + period_ns } else { 0 };
        }
    }

    /// What goes out in this cycle.
    pub(super) fn allowed(&mut self, commands: Commands) {
        self.asked[self.oldest] = commands;
        self.oldest = (self.oldest + 1) % self.asked.len();
    }

    /// The first wheel whose motor gives too little.
    pub(super) fn short(&self) -> Option<usize> {
        self.short_ns.iter().position(|short_ns| *short_ns >= LASTING_NS)
    }
}
