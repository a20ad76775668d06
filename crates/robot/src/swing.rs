//! A torque that swings to and fro about what it is on average.

use crate::decay::Decay;

/// What is slower than this is motion, rad/s (5 Hz).
const MOTION_RAD_S: f64 = 31.4;
/// The longest time from one end of a swing to the other, ns: swings above 20 Hz count.
const HALF_SWING_NS: u64 = 25_000_000;
/// However low the limit is: what reaches less far than this part of a motor's rated torque may be noise, or cogging.
pub(crate) const NOISE_OF_RATED: f64 = 0.1;

/// What is known of one wheel's torque.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Swing {
    /// N·m; `None` before the first torque.
    average_nm: Option<f64>,
    /// The side on which the torque was last, and when it came there, ns.
    side: f64,
    since_ns: u64,
    /// How often in a row it came from one side of its average to the other.
    pub(crate) half_swings: u32,
}

/// How much of an average is kept where a new torque goes into it, once a period.
pub(crate) const AVERAGED: Decay = Decay::new(MOTION_RAD_S);

impl Swing {
    /// Takes in a torque, once a cycle; what is nearer to its average than `least_nm` reaches nowhere.
    pub(crate) fn see(&mut self, torque_nm: f64, least_nm: f64, now_ns: u64, taken: f64) {
        let average_nm = self.average_nm.get_or_insert(torque_nm);
        *average_nm += taken * (torque_nm - *average_nm);
        let off_nm = torque_nm - *average_nm;
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
