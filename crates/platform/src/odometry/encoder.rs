//! From raw encoder counts to wheel angles.

use crate::wheel::PerWheel;

/// Turns raw 32-bit counts into increments; the first sample is the origin.
#[derive(Clone, Debug)]
pub(super) struct Encoders {
    rad_per_count: PerWheel,
    last: Option<PerWheel<i32>>,
}

impl Encoders {
    pub(super) fn new(rad_per_count: PerWheel) -> Encoders {
        Encoders { rad_per_count, last: None }
    }

    /// The next sample is an origin again.
    pub(super) fn resync(&mut self) {
        self.last = None;
    }

    /// The angles turned since the sample before, in rad; zero for the first sample.
    ///
    /// A difference of 32-bit numbers is right across the wrap, for less than 2^31 counts (2048 turns of a
    /// 20-bit encoder) between two samples.
    pub(super) fn increments_rad(&mut self, counts: &PerWheel<i32>) -> PerWheel {
        let last = self.last.replace(*counts).unwrap_or(*counts);
        PerWheel::from_fn(counts.len(), |at| {
            f64::from(counts[at].wrapping_sub(last[at])) * self.rad_per_count[at]
        })
    }
}
