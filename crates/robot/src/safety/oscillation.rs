//! Whether a wheel's torque swings to and fro, fast and strongly: a control loop that rings, on a tread that gives way or
//! on a floor that doesn't hold it.

use crate::config::RobotPlan;
use crate::signals::{Exchange, MAX_WHEELS};
use crate::stages::SafetyView;

use super::rated_nm;

/// What is slower than this is motion, rad/s (5 Hz).
const MOTION_RAD_S: f64 = 31.4;
/// The longest time from one end of a swing to the other, ns: swings above 20 Hz count.
const HALF_SWING_NS: u64 = 25_000_000;
/// So many in a row are no jerk that a tread gives back, and no corner.
const HALF_SWINGS: u32 = 5;
/// However low the limit is: what reaches less far than this part of a motor's rated torque may be noise, or cogging.
const NOISE_OF_RATED: f64 = 0.1;

/// The swings of each wheel's measured torque about what it is on average.
#[derive(Clone, Debug)]
pub(super) struct OscillationWatch {
    /// How far a swing reaches at least to each side, as a part of the wheels' torque limit.
    share: f64,
    /// How much of a new torque goes into its average, each cycle.
    taken: f64,
    /// Rated torques at the wheels, N·m.
    rated_nm: [f64; MAX_WHEELS],
    wheels: [Wheel; MAX_WHEELS],
}

/// What is known of one wheel.
#[derive(Clone, Copy, Debug, Default)]
struct Wheel {
    /// N·m; `None` before the first measurement.
    average_nm: Option<f64>,
    /// The side on which the torque was last, and when it came there, ns.
    side: f64,
    since_ns: u64,
    half_swings: u32,
}

impl OscillationWatch {
    pub(super) fn new(plan: &RobotPlan) -> Self {
        let period_s = plan.bus.cycle_ns as f64 * 1e-9;
        OscillationWatch {
            share: plan.safety.oscillation_share,
            taken: 1.0 - (-MOTION_RAD_S * period_s).exp(),
            rated_nm: rated_nm(plan),
            wheels: [Wheel::default(); MAX_WHEELS],
        }
    }

    /// Nothing was measured yet.
    pub(super) fn reset(&mut self) {
        self.wheels = [Wheel::default(); MAX_WHEELS];
    }

    /// Takes in what was measured, once a cycle; without a complete exchange there is nothing new.
    pub(super) fn look(&mut self, view: &SafetyView<'_>) {
        if !matches!(view.exchange, Exchange::Complete) {
            return;
        }
        let least_nm =
            if self.share < 1.0 { self.share * view.wheel_limits.torque_nm } else { f64::INFINITY };
        let drives = view.measurements.present().iter().zip(&self.rated_nm);
        for (wheel, (drive, rated_nm)) in self.wheels.iter_mut().zip(drives) {
            let average_nm = wheel.average_nm.get_or_insert(drive.torque_nm);
            *average_nm += self.taken * (drive.torque_nm - *average_nm);
            let off_nm = drive.torque_nm - *average_nm;
            wheel.swing(off_nm, least_nm.max(NOISE_OF_RATED * rated_nm), view.time.now_ns);
        }
    }

    /// The first wheel whose torque swings.
    pub(super) fn swings(&self) -> Option<usize> {
        self.wheels.iter().position(|wheel| wheel.half_swings >= HALF_SWINGS)
    }
}

impl Wheel {
    /// The torque is so far from its average.
    fn swing(&mut self, off_nm: f64, least_nm: f64, now_ns: u64) {
        let is_over = now_ns.saturating_sub(self.since_ns) > HALF_SWING_NS;
        if is_over {
            self.half_swings = 0;
        }
        // What is no number reaches nowhere: another check finds it.
        if off_nm.abs() >= least_nm && off_nm * self.side <= 0.0 {
            if self.side != 0.0 && !is_over {
                self.half_swings += 1;
            }
            (self.side, self.since_ns) = (off_nm.signum(), now_ns);
        }
    }
}
