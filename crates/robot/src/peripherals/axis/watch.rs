//! What an axis must not do, whoever moves it.

use std::fmt::{self, Write};

use crate::config::AxisPlan;
use crate::signals::CycleTime;

/// A measured speed or torque may lie so far above its limit: commands are held to the limit itself.
const MARGIN: f64 = 1.1;
/// A share of the rated torque that counts as nothing.
const TORQUE_MARGIN: f64 = 0.05;
/// For how long a torque may lie above, ns.
const TORQUE_NS: u64 = 50_000_000;

/// What is wrong with an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Wrong {
    /// So far from its set point.
    Lags(f64),
    /// So fast.
    TooFast(f64),
    /// So much torque, N·m.
    TooStrong(f64),
    /// It moves further out of its limits, and is here.
    Outside(f64),
    /// The drive doesn't acknowledge a set point.
    NotAcknowledged,
    /// The drive doesn't stop when it is told to.
    DoesntHalt,
}

impl Wrong {
    /// In words.
    pub(super) fn tell(self, plan: &AxisPlan, words: &mut dyn Write) -> fmt::Result {
        let (limits, unit) = (&plan.limits, plan.unit.name());
        match self {
            Wrong::Lags(found) => {
                let most = limits.following_error;
                write!(words, "it was {found:.4} {unit} from its set point, at most {most} {unit}")
            }
            Wrong::TooFast(found) => {
                write!(words, "its speed was {found:.4} {unit}/s, at most {} {unit}/s", limits.speed)
            }
            Wrong::TooStrong(found) => {
                write!(words, "its torque was {found:.3} N·m, at most {} N·m", limits.torque_nm)
            }
            Wrong::Outside(found) => {
                let [least, greatest] = limits.position;
                let limits = format_args!("its limits are {least} to {greatest} {unit}");
                write!(words, "it moved outwards at {found:.4} {unit}, {limits}")
            }
            Wrong::NotAcknowledged => {
                words.write_str("its drive doesn't acknowledge the set point (pp, bit 12)")
            }
            Wrong::DoesntHalt => words.write_str("its drive doesn't halt (bit 8)"),
        }
    }
}

/// What was measured.
pub(super) struct AxisMeasurement {
    /// `None` where nobody knows it, or the drive looks for its home.
    pub(super) position: Option<f64>,
    /// How far it is from where it shall be.
    pub(super) lag: f64,
    pub(super) speed: f64,
    pub(super) torque_nm: f64,
}

/// Looks at an axis in every cycle; the first thing that was wrong stays.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Watch {
    wrong: Option<Wrong>,
    strong_since_ns: Option<u64>,
}

impl Watch {
    pub(super) fn wrong(&self) -> Option<Wrong> {
        self.wrong
    }

    pub(super) fn reset(&mut self) {
        *self = Watch::default();
    }

    pub(super) fn fail(&mut self, wrong: Wrong) {
        self.wrong = self.wrong.or(Some(wrong));
    }

    pub(super) fn look(&mut self, time: &CycleTime, plan: &AxisPlan, seen: &AxisMeasurement) {
        let limits = &plan.limits;
        let most_nm = MARGIN * limits.torque_nm + TORQUE_MARGIN * plan.scale.rated_torque_nm;
        let is_strong = seen.torque_nm.abs() > most_nm;
        let since_ns = is_strong.then(|| self.strong_since_ns.unwrap_or(time.now_ns));
        self.strong_since_ns = since_ns;
        let [least, greatest] = limits.position;
        let is_outside = |position: f64| {
            let moves = seen.speed.abs() > (MARGIN - 1.0) * limits.speed;
            moves
                && (position > greatest + limits.following_error && seen.speed > 0.0
                    || position < least - limits.following_error && seen.speed < 0.0)
        };
        let wrong = if seen.lag.abs() > limits.following_error {
            Wrong::Lags(seen.lag.abs())
        } else if seen.speed.abs() > MARGIN * limits.speed {
            Wrong::TooFast(seen.speed.abs())
        } else if since_ns.is_some_and(|since_ns| time.now_ns.saturating_sub(since_ns) > TORQUE_NS) {
            Wrong::TooStrong(seen.torque_nm.abs())
        } else if let Some(position) = seen.position.filter(|position| is_outside(*position)) {
            Wrong::Outside(position)
        } else {
            return;
        };
        self.fail(wrong);
    }
}
