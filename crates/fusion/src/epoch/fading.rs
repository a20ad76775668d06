//! What is left after a time of what is forgotten by and by.

use super::{SMOOTHED_S, flaws, lags};
use crate::belief::SLIP_TIME_S;

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
            lags: left(lags::MEMORY_S),
            flaws: flaws::MEMORY_S.map(left),
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
