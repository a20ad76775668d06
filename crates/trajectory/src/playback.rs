//! Pausing, resuming and reversing a trajectory on its own path.
//!
//! The trajectory is sampled at σ(t) instead of t, where the rate r = σ̇ goes from −1 (backwards) over 0 (paused)
//! to 1. With v, a, j of the trajectory the motion becomes v·r, a·r² + v·ṙ and j·r³ + 3a·r·ṙ + v·r̈, so from what
//! the limits leave beside the trajectory's own peaks follow bounds for ṙ and r̈ that hold everywhere on it.
//!
//! The path itself is kept exactly. What is left decides how quickly: a trajectory planned at 90 % of the
//! limits pauses well, one at its limits is refused.

use omnibase_platform::Twist2;

use crate::limiter::{Bounds, VectorLimiter};
use crate::limits::{Limits, Peaks, Quantity};
use crate::trajectory::{Setpoint, Trajectory};

/// Why a trajectory cannot be paused within limits.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PlaybackError {
    /// The period is no positive number.
    #[error("period_s is {0}, expected a positive number")]
    Period(f64),
    /// The trajectory leaves nothing of a limit for pausing it.
    #[error(
        "the trajectory needs {found:.4} of {limit} {}: nothing is left for pausing it; slow it by {MIN_SHARE_PERCENT} % \
         or more", .quantity.name_and_unit().1
    )]
    NothingLeft {
        /// Which limit.
        quantity: Quantity,
        /// What the trajectory needs.
        found: f64,
        /// The limit.
        limit: f64,
    },
}

/// How much of each limit a trajectory must leave, in percent.
const MIN_SHARE_PERCENT: f64 = 1.0;

/// Plays a trajectory at a rate that may change; one call per cycle.
#[derive(Clone, Debug)]
pub struct Playback<T> {
    trajectory: T,
    rate: VectorLimiter,
    position_s: f64,
}

impl<T: Trajectory> Playback<T> {
    /// Stands at the trajectory's beginning.
    pub fn new(trajectory: T, limits: &Limits, period_s: f64) -> Result<Playback<T>, PlaybackError> {
        if !(period_s.is_finite() && period_s > 0.0) {
            return Err(PlaybackError::Period(period_s));
        }
        let peaks = Peaks::of(&trajectory);
        // Where nothing moves, nothing bounds the rate: one second from 0 to 1.
        let mut bounds = Bounds { speed: 1.0, acceleration: 1.0, jerk: 10.0, period_s };
        for [first, second, third] in [
            [Quantity::Speed, Quantity::Acceleration, Quantity::Jerk],
            [Quantity::Rate, Quantity::AngularAcceleration, Quantity::AngularJerk],
        ] {
            let [v, a, j] = [first, second, third].map(|quantity| peaks.peak(quantity).value);
            let left = |quantity: Quantity, found: f64| {
                let limit = limits.of(quantity);
                let left = limit - found;
                if left >= limit * MIN_SHARE_PERCENT / 100.0 {
                    Ok(left)
                } else {
                    Err(PlaybackError::NothingLeft { quantity, found, limit })
                }
            };
            if v == 0.0 {
                continue;
            }
            let (of_acceleration, of_jerk) = (left(second, a)?, left(third, j)?);
            // Half of what the jerk leaves goes to 3a·ṙ, half to v·r̈.
            bounds.acceleration = bounds.acceleration.min(of_acceleration / v);
            if a > 0.0 {
                bounds.acceleration = bounds.acceleration.min(of_jerk / (6.0 * a));
            }
            bounds.jerk = bounds.jerk.min(of_jerk / (2.0 * v));
        }
        Ok(Playback { trajectory, rate: VectorLimiter::new(bounds), position_s: 0.0 })
    }

    /// The trajectory.
    pub fn trajectory(&self) -> &T {
        &self.trajectory
    }

    /// The trajectory's own time at which it is, in s.
    pub fn position_s(&self) -> f64 {
        self.position_s
    }

    /// The present rate.
    pub fn rate(&self) -> f64 {
        self.rate.speed[0]
    }

    /// Whether the end is reached, or (backwards) the beginning, and nothing moves.
    pub fn is_at_an_end(&self) -> bool {
        self.position_s <= 0.0 || self.position_s >= self.trajectory.duration_s()
    }

    /// One cycle: the setpoint, for a wished rate from −1 (backwards) over 0 (pause) to 1. NaN counts as 0.
    ///
    /// At the ends the trajectory itself is at rest, so there the rate is the wished one at once.
    pub fn step(&mut self, wished_rate: f64) -> Setpoint {
        let wished = if wished_rate.is_finite() { wished_rate.clamp(-1.0, 1.0) } else { 0.0 };
        if self.is_at_an_end() {
            self.rate.restart([wished, 0.0]);
        }
        let before = self.rate.acceleration[0];
        let period_s = self.rate.bounds.period_s;
        let limited = self.rate.step([wished, 0.0]);
        let (rate, change) = (limited.speed[0], limited.acceleration[0]);
        let bend = (change - before) / period_s;
        self.position_s = (self.position_s + rate * period_s).clamp(0.0, self.trajectory.duration_s());
        let own = self.trajectory.sample(self.position_s);
        if self.is_at_an_end() {
            return Setpoint::at_rest(own.odom_from_base);
        }
        let (v, a, j) = (own.twist_in_odom, own.acceleration_in_odom, own.jerk_in_odom);
        Setpoint {
            odom_from_base: own.odom_from_base,
            twist_in_odom: v.scaled(rate),
            acceleration_in_odom: sum(a.scaled(rate * rate), v.scaled(change)),
            jerk_in_odom: sum(
                sum(j.scaled(rate * rate * rate), a.scaled(3.0 * rate * change)),
                v.scaled(bend),
            ),
        }
    }
}

fn sum(a: Twist2, b: Twist2) -> Twist2 {
    Twist2::new(a.vx_m_s + b.vx_m_s, a.vy_m_s + b.vy_m_s, a.w_rad_s + b.w_rad_s)
}
