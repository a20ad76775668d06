//! A pose whose instant isn't known exactly, of a platform that moves.

use omnibase_platform::wrap_angle_rad;
use omnibase_robot::signals::Heard;

use crate::clock::Mapped;

/// Between two poses that say how fast the platform is, ns at most.
const YOUNG_NS: u64 = 500_000_000;

/// The last pose, for the speed from it to the next.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Moving(Option<(u64, [f64; 3])>);

impl Moving {
    /// What a pose source says: x, y in m and heading in rad, and their covariance (xx, xy, xh, yy, yh, hh).
    ///
    /// An instant that may be off by ±b, all of it equally likely, is a pose that is off by the speed times that: the
    /// covariance grows by v·vᵀ·b²/3. Where the bound is known from one side alone nothing is added.
    pub(crate) fn heard(&mut self, mapped: Mapped, pose: [f64; 3], mut covariance: [f64; 6]) -> Heard {
        let last = self.0.replace((mapped.ours_ns, pose));
        let bound_s = mapped.bound_ns.unwrap_or(0) as f64 * 1e-9;
        if let Some((last_ns, last)) = last
            && let Some(between_ns) =
                mapped.ours_ns.checked_sub(last_ns).filter(|ns| (1..YOUNG_NS).contains(ns))
        {
            let per_s = 1e9 / between_ns as f64;
            let turn_rad = wrap_angle_rad(pose[2] - last[2]);
            let speed = [(pose[0] - last[0]) * per_s, (pose[1] - last[1]) * per_s, turn_rad * per_s];
            for (place, (i, j)) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].into_iter().enumerate() {
                covariance[place] += speed[i] * speed[j] * bound_s * bound_s / 3.0;
            }
        }
        let mut heard = Heard { instant_ns: mapped.ours_ns, ..Heard::NOTHING };
        heard.values[..3].copy_from_slice(&pose);
        heard.values[3..9].copy_from_slice(&covariance);
        heard
    }
}
