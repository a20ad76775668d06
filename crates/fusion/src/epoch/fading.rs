//! What is left after a time of what is forgotten by and by.

use super::SMOOTHED_S;
use crate::belief::SLIP_TIME_S;

/// The regression remembers so long, s.
const LAGS_MEMORY_S: f64 = 0.2;
/// What was seen of flaws is remembered so long, kind by kind, s. In even motion nothing is seen of a clock, but poses stay as wrong by it.
const FLAWS_MEMORY_S: [f64; 3] = [1.0, 8.0, 20.0];

/// The shares that are left after a time.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Fading {
    pub(super) time_s: f64,
    /// Of slip.
    pub(super) slip: f64,
    /// Of how far the twist is off what it was lately.
    pub(super) smoothed: f64,
    /// Of what sensors were off from wheels.
    pub(super) lags: f64,
    /// Of what was seen of flaws, kind by kind.
    pub(super) flaws: [f64; 3],
}

impl Fading {
    fn over(time_s: f64) -> Fading {
        let left = |memory_s: f64| (-time_s / memory_s).exp();
        Fading {
            time_s,
            slip: left(SLIP_TIME_S),
            smoothed: left(SMOOTHED_S),
            lags: left(LAGS_MEMORY_S),
            flaws: FLAWS_MEMORY_S.map(left),
        }
    }

    /// That of a time, s: epochs take the same one again and again.
    pub(crate) fn of(&mut self, time_s: f64) -> Fading {
        if self.time_s != time_s {
            *self = Fading::over(time_s);
        }
        *self
    }
}
