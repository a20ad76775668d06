//! Who leans: what a sensor tells is off a little and always to one side, each reading within its gate.
//!
//! Where all is as believed, what readings are off is white: its mean over some tenths of a second is small. A
//! sensor whose clock is off while the motion changes slowly leans, and so does one beside wheels that creep:
//! who of both is wrong nobody knows.
//!
//! What is told stays as it is; the covariance counts with what the mean is off. Where a sensor of poses leans
//! as well, it tells who is wrong: a gyro that turns too much is drawn back by poses, while one beside wheels
//! that turn too little is drawn on.

/// The mean of speeds is one of so long, and that of poses, s: these are as wrong as what was added up.
pub(super) const OF_SPEEDS_S: f64 = 0.5;
pub(super) const OF_POSES_S: f64 = 1.5;
/// Beyond so many standard deviations of the mean it leans: one in a thousand does by chance.
const LEANS_SIGMAS: f64 = 3.3;

/// What a sensor was off lately, in its own axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lean {
    /// In standard deviations of a reading.
    sigmas: [f64; 3],
    /// And from what the others say without it, m and rad, or m/s and rad/s.
    off: [f64; 3],
    /// Variance of the mean, where a reading's is 1.
    of_mean: f64,
}

/// The share of what lasted a time in a mean of such a length, both in s.
pub(super) fn share_of(time_s: f64, mean_s: f64) -> f64 {
    1.0 - (-time_s / mean_s).exp()
}

impl Lean {
    /// Takes in, as such a share of the mean, what a reading is off, what the squares of that were expected to be, and what it is
    /// off from what the others say without it.
    pub(super) fn take(&mut self, share: f64, off: &[f64], expected: &[f64], off_others: &[f64]) {
        self.of_mean += share * (share - (2.0 - share) * self.of_mean);
        for n in 0..off.len() {
            self.sigmas[n] += share * (off[n] / expected[n].sqrt() - self.sigmas[n]);
            self.off[n] += share * (off_others[n] - self.off[n]);
        }
    }

    /// By how much it leans, along each of its axes; `None` where it doesn't.
    pub(super) fn by(&self) -> Option<[f64; 3]> {
        let greatest = self.sigmas.iter().fold(0.0_f64, |greatest, sigmas| greatest.max(sigmas.abs()));
        (greatest > LEANS_SIGMAS * self.of_mean.sqrt()).then_some(self.off)
    }
}
