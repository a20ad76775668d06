//! How far a platform still goes once it brakes, and how far it still turns: bounds that hold for every state.
//!
//! A stop is [`TwistLimiter::brake`](omnibase_trajectory::TwistLimiter::brake): the acceleration a ends along its own
//! direction at the full jerk J, then the speed along its own. With D = |a|²/2J, t₁ = |a|/J + T and v₁ = v + D·â:
//!
//! 1. While the acceleration ends the speed is v + s·â with 0 <= s <= D, so the way is t·v + g·â, g <= D·t: it lies
//!    within D·t₁ of the segment from 0 to t₁·v₁.
//! 2. Then the way is straight along v₁, by v₁²/2A + v₁·A/2J at most, or v₁·√(v₁/J) where v₁ < A²/J, and
//!    [`LATE_CYCLES`] cycles at v₁ for the steps of the cycle.
//!
//! So the whole way lies within D·t₁ of the segment from 0 to t₁·v₁ + d(v₁)·v̂₁. Turning is the same in one dimension.

use crate::config::Limits;
use crate::signals::Setpoint;

use super::shape::{Point, length, plus};

/// By how many cycles a stop in steps may be longer than the one in continuous time.
const LATE_CYCLES: f64 = 2.0;

/// Acceleration and jerk of a direction, and the cycle.
#[derive(Clone, Copy, Debug)]
struct Axis {
    acceleration: f64,
    jerk: f64,
    period_s: f64,
}

/// What a platform's limits say about its stops.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Braking {
    straight: Axis,
    turning: Axis,
}

/// Where the rest of a motion lies, seen from where it is now, if the platform brakes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sweep {
    /// The platform's way lies along this segment ...
    pub(crate) way: Point,
    /// ... within this distance, m.
    pub(crate) bend_m: f64,
    /// Its heading lies between these two, rad from now.
    pub(crate) turn_rad: [f64; 2],
    /// It stands after this time, s.
    pub(crate) duration_s: f64,
    /// The speed never rises above this one or the present one, m/s.
    pub(crate) fastest_m_s: f64,
}

impl Axis {
    /// How long an acceleration takes to end, s, and by how much the speed changes meanwhile; the cycle's steps exactly.
    fn ending(&self, acceleration: f64) -> (f64, f64) {
        if acceleration == 0.0 {
            return (0.0, 0.0);
        }
        let step = self.jerk * self.period_s;
        let cycles = (acceleration / step).floor();
        let change = self.period_s * (cycles * acceleration - step * cycles * (cycles + 1.0) / 2.0);
        ((cycles + 1.0) * self.period_s, change)
    }

    /// Way and time from a speed without acceleration to rest.
    fn stop(&self, speed: f64) -> (f64, f64) {
        if speed == 0.0 {
            return (0.0, 0.0);
        }
        let Axis { acceleration, jerk, period_s } = *self;
        let (way, time_s) = if speed * jerk >= acceleration * acceleration {
            let ramp_s = acceleration / jerk;
            (speed * speed / (2.0 * acceleration) + speed * ramp_s / 2.0, speed / acceleration + ramp_s)
        } else {
            let half_s = (speed / jerk).sqrt();
            (speed * half_s, 2.0 * half_s)
        };
        (way + LATE_CYCLES * period_s * speed, time_s + 2.0 * LATE_CYCLES * period_s)
    }
}

impl Braking {
    pub(crate) fn new(limits: &Limits, period_s: f64) -> Self {
        let axis = |acceleration, jerk| Axis { acceleration, jerk, period_s };
        Braking {
            straight: axis(limits.acceleration_m_s2, limits.jerk_m_s3),
            turning: axis(limits.turn_acceleration_rad_s2, limits.turn_jerk_rad_s3),
        }
    }

    /// The rest of the motion from a state, if the platform brakes from now on.
    pub(crate) fn of(&self, state: &Setpoint) -> Sweep {
        let (twist, rate) = (&state.twist_in_odom, &state.acceleration_in_odom);
        let (speed, acceleration) = ([twist.vx_m_s, twist.vy_m_s], [rate.vx_m_s, rate.vy_m_s]);
        let size = length(acceleration);
        let (first_s, change) = self.straight.ending(size);
        let then = if size > 0.0 { plus(speed, acceleration, change / size) } else { speed };
        let fast = length(then);
        let (stop_m, stop_s) = self.straight.stop(fast);
        let stretch = if fast > 0.0 { first_s + stop_m / fast } else { first_s };

        let (turn_first_s, turn_change) = self.turning.ending(rate.w_rad_s.abs());
        let turn_then = twist.w_rad_s + turn_change * rate.w_rad_s.signum();
        let (turn_stop, turn_stop_s) = self.turning.stop(turn_then.abs());
        let ends = [twist.w_rad_s * turn_first_s, turn_then * turn_first_s];
        let far = ends.map(|end| end + turn_stop * turn_then.signum());
        let all = [0.0, ends[0], ends[1], far[0], far[1]];
        Sweep {
            way: [then[0] * stretch, then[1] * stretch],
            bend_m: change * first_s,
            turn_rad: [all.into_iter().fold(0.0, f64::min), all.into_iter().fold(0.0, f64::max)],
            fastest_m_s: fast,
            duration_s: (first_s + stop_s).max(turn_first_s + turn_stop_s),
        }
    }

    /// By how much a speed may change at most while an acceleration ends, m/s.
    pub(crate) fn greatest_change_m_s(&self) -> f64 {
        self.straight.ending(self.straight.acceleration).1
    }

    /// The way and the time from a speed to rest, m and s.
    pub(crate) fn stop(&self, speed_m_s: f64) -> (f64, f64) {
        self.straight.stop(speed_m_s)
    }

    /// The speed with which a place at a distance may be approached: with a part of the acceleration, and softly.
    ///
    /// Solves v²/2A' + τ·v = distance.
    pub(crate) fn approach_m_s(&self, distance_m: f64, radius_m: f64) -> f64 {
        if distance_m <= 0.0 {
            return 0.0;
        }
        let (most, soft_s) = self.approach(radius_m);
        most * ((soft_s * soft_s + 2.0 * distance_m / most).sqrt() - soft_s)
    }

    /// The distance from which on a place may be approached with a speed, m: the inverse of [`Self::approach_m_s`].
    pub(crate) fn approach_way_m(&self, speed_m_s: f64, radius_m: f64) -> f64 {
        let (most, soft_s) = self.approach(radius_m);
        speed_m_s * (speed_m_s / (2.0 * most) + soft_s)
    }

    /// A' and τ.
    fn approach(&self, radius_m: f64) -> (f64, f64) {
        let Axis { acceleration, jerk, period_s } = self.straight;
        let corner = self.turning.acceleration * radius_m;
        let most = SHARE * if corner > 0.0 { acceleration.min(corner) } else { acceleration };
        (most, 2.0 * acceleration / jerk + 5.0 * period_s + SOFT_S)
    }

    /// How far a state's way may lie off its segment at most, m: what room to a wall along which it slides costs.
    pub(crate) fn greatest_bend_m(&self) -> f64 {
        let (time_s, change) = self.straight.ending(self.straight.acceleration);
        time_s * change
    }
}

/// Part of the acceleration with which places are approached.
const SHARE: f64 = 0.6;
/// Time constant of the last part of an approach, s.
const SOFT_S: f64 = 0.05;
