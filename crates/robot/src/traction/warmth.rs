//! How warm motors are: the root of the mean square of their torques over the last seconds.

use omnibase_platform::MAX_WHEELS;

use crate::config::DrivePlan;
use crate::signals::{CycleTime, Measurements};

/// A motor bears its rated torque for ever; a motion may ask for this much of it, as the root of the mean square over a window, s.
pub(crate) const HEAT_WINDOW_S: f64 = 30.0;
/// Parts of the window: the oldest of them is forgotten as a whole.
const PARTS: usize = 30;
const PART_S: f64 = HEAT_WINDOW_S / PARTS as f64;

/// The motors.
#[derive(Clone, Debug)]
pub(super) struct Warmth {
    /// What each bears for ever, N·m at the wheel.
    rated_nm: [f64; MAX_WHEELS],
    wheels: usize,
    /// Integrals of the squares of their torques over what they bear, part by part of the window, s; the part of now is `at`.
    parts: [[f64; MAX_WHEELS]; PARTS],
    at: usize,
    lasted_s: f64,
    /// The sums of all parts, s.
    sums: [f64; MAX_WHEELS],
}

impl Warmth {
    /// Cold motors.
    pub(super) fn new(drives: &[DrivePlan]) -> Self {
        let mut rated_nm = [f64::INFINITY; MAX_WHEELS];
        for (rated_nm, drive) in rated_nm.iter_mut().zip(drives) {
            *rated_nm = drive.scale.rated_torque_nm * drive.scale.gear_ratio;
        }
        let none = [0.0; MAX_WHEELS];
        Warmth { rated_nm, wheels: drives.len(), parts: [none; PARTS], at: 0, lasted_s: 0.0, sums: none }
    }

    /// One cycle; a motor that isn't heard goes on as it did, and one whose torque is no number as it is rated.
    pub(super) fn take(&mut self, time: &CycleTime, measurements: &Measurements) {
        let period_s = time.period_s();
        self.lasted_s += period_s;
        if self.lasted_s >= PART_S {
            (self.at, self.lasted_s) = ((self.at + 1) % PARTS, 0.0);
            self.parts[self.at] = [0.0; MAX_WHEELS];
            self.sums = std::array::from_fn(|wheel| self.parts.iter().map(|part| part[wheel]).sum());
        }
        let drives = measurements.drives.iter().zip(&self.rated_nm).take(self.wheels);
        let parts = self.parts[self.at].iter_mut().zip(&mut self.sums);
        for ((part, sum), (drive, rated_nm)) in parts.zip(drives) {
            let load = drive.torque_nm / rated_nm;
            let heat_s = period_s * if load.is_finite() { load * load } else { 1.0 };
            (*part, *sum) = (*part + heat_s, *sum + heat_s);
        }
    }

    /// That of the warmest over what it bears for ever.
    pub(super) fn most(&self) -> f64 {
        (self.sums.iter().copied().fold(0.0, f64::max) / HEAT_WINDOW_S).sqrt()
    }
}
