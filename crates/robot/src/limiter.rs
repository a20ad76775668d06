//! The platform's limits on speed, acceleration and jerk, held in every cycle whatever is wished.
//!
//! A wish that keeps the limits passes as it is; else the setpoint lags behind its pose and catches up within them.

use omnibase_platform::{Pose2, Twist2, pose_error};
use omnibase_trajectory::{LimitedTwist, LimitsError, TwistLimiter};

use crate::config::{Limits, motion_limits};
use crate::signals::{PlatformState, Setpoint};

/// Greatest speeds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SpeedBound {
    pub(crate) speed_m_s: f64,
    pub(crate) turn_speed_rad_s: f64,
}

impl SpeedBound {
    /// The speeds of a twist.
    pub(crate) fn of(twist: &Twist2) -> Self {
        SpeedBound { speed_m_s: twist.speed_m_s(), turn_speed_rad_s: twist.w_rad_s.abs() }
    }

    /// A twist with no more than these speeds, its direction kept.
    pub(crate) fn hold(&self, twist: Twist2) -> Twist2 {
        let speed = twist.speed_m_s();
        let part = if speed > self.speed_m_s { self.speed_m_s / speed } else { 1.0 };
        let turn = self.turn_speed_rad_s;
        Twist2::new(twist.vx_m_s * part, twist.vy_m_s * part, twist.w_rad_s.clamp(-turn, turn))
    }

    /// The greater of both.
    pub(crate) fn greater(&self, other: &SpeedBound) -> SpeedBound {
        SpeedBound {
            speed_m_s: self.speed_m_s.max(other.speed_m_s),
            turn_speed_rad_s: self.turn_speed_rad_s.max(other.turn_speed_rad_s),
        }
    }
}

/// How fast a lag behind the wished pose is caught up, 1/s.
const CATCH_UP_1_S: f64 = 5.0;
/// Nearer than this a pose counts as reached, m and rad.
const REACHED: f64 = 1e-6;
/// Slower than this a reached pose counts as held, m/s and rad/s.
const RESTING: f64 = 1e-5;

/// So far from its setpoint a platform was left behind by it, m and rad: plans that are caught up with leave 0.06 m.
const LEFT_BEHIND_M: f64 = 0.1;
const LEFT_BEHIND_RAD: f64 = 0.1;
/// Slower than this it stands, m/s and rad/s.
const STANDS: f64 = 0.02;

/// What lets a wished motion through as far as the platform's limits allow.
#[derive(Clone, Debug)]
pub struct Limiter {
    twist: TwistLimiter,
    limits: omnibase_trajectory::Limits,
    period_s: f64,
    setpoint: Setpoint,
}

impl Limiter {
    /// A limiter at rest at the origin.
    pub fn new(limits: &Limits, period_s: f64) -> Result<Self, LimitsError> {
        Ok(Limiter {
            twist: TwistLimiter::new(&motion_limits(limits), period_s)?,
            limits: motion_limits(limits),
            period_s,
            setpoint: Setpoint::default(),
        })
    }

    /// Other limits from now on, while moving too: what lies beyond them is brought inside by braking. Impossible ones change
    /// nothing.
    pub(crate) fn set_limits(&mut self, limits: &Limits) {
        let limits = motion_limits(limits);
        if limits != self.limits && self.twist.set_limits(&limits).is_ok() {
            self.limits = limits;
        }
    }

    /// Begins anew, at rest at a pose.
    pub fn reset(&mut self, pose: Pose2) {
        self.twist.restart(Twist2::default());
        self.setpoint = Setpoint::at_rest(pose);
    }

    /// A stop begins: who stands, left far behind, stays there, and doesn't drive after a setpoint that brakes.
    pub(crate) fn stop_with(&mut self, state: &PlatformState) {
        let [x, y, turn] = pose_error(&self.setpoint.odom_from_body, &state.odom_from_body);
        let is_behind = x.hypot(y) > LEFT_BEHIND_M || turn.abs() > LEFT_BEHIND_RAD;
        let Twist2 { w_rad_s, .. } = state.twist_in_body;
        let stands = state.twist_in_body.speed_m_s() < STANDS && w_rad_s.abs() < STANDS;
        if is_behind && stands && state.pose_known && state.is_finite() {
            self.reset(state.odom_from_body);
        }
    }

    /// Where the limiter is.
    pub fn setpoint(&self) -> Setpoint {
        self.setpoint
    }

    /// Whether speed and acceleration are zero.
    pub fn is_at_rest(&self) -> bool {
        let zero = Twist2::default();
        self.setpoint.twist_in_odom == zero && self.setpoint.acceleration_in_odom == zero
    }

    /// Whether a pose is reached and held.
    pub fn has_reached(&self, pose: &Pose2) -> bool {
        let (here, twist) = (self.setpoint.odom_from_body, self.setpoint.twist_in_odom);
        here.distance_m(*pose) < REACHED
            && (here.heading_rad - pose.heading_rad).abs() < REACHED
            && twist.speed_m_s() < RESTING
            && twist.w_rad_s.abs() < RESTING
    }

    /// One period towards a wished motion: its speed, and its pose as far as that alone doesn't lead there.
    pub fn follow(&mut self, wished: &Setpoint) -> Setpoint {
        self.toward(self.leading_to(wished))
    }

    /// The speed that leads to a wished motion, before any limit: its own, and what catches up with its pose.
    pub fn leading_to(&self, wished: &Setpoint) -> Twist2 {
        let (here, now, twist) =
            (self.setpoint.odom_from_body, self.setpoint.twist_in_odom, wished.twist_in_odom);
        // What will still be missing after this period at the wished speed.
        let missing = |wished: f64, here: f64, speeds: f64| wished - here - 0.5 * speeds * self.period_s;
        let pose = wished.odom_from_body;
        let lag = Twist2::new(
            missing(pose.x_m, here.x_m, now.vx_m_s + twist.vx_m_s),
            missing(pose.y_m, here.y_m, now.vy_m_s + twist.vy_m_s),
            missing(pose.heading_rad, here.heading_rad, now.w_rad_s + twist.w_rad_s),
        )
        .scaled(CATCH_UP_1_S);
        Twist2::new(twist.vx_m_s + lag.vx_m_s, twist.vy_m_s + lag.vy_m_s, twist.w_rad_s + lag.w_rad_s)
    }

    /// One period towards a speed, in odom.
    pub fn toward(&mut self, twist_in_odom: Twist2) -> Setpoint {
        let limited = self.twist.step(twist_in_odom);
        self.advance(&limited)
    }

    /// One period of the stop whose way is known beforehand.
    pub fn brake(&mut self) -> Setpoint {
        let limited = self.twist.brake();
        self.advance(&limited)
    }

    fn advance(&mut self, limited: &LimitedTwist) -> Setpoint {
        let before = self.setpoint.twist_in_odom;
        let (after, half_s) = (limited.twist_in_odom, 0.5 * self.period_s);
        let pose = &mut self.setpoint.odom_from_body;
        pose.x_m += half_s * (before.vx_m_s + after.vx_m_s);
        pose.y_m += half_s * (before.vy_m_s + after.vy_m_s);
        pose.heading_rad += half_s * (before.w_rad_s + after.w_rad_s);
        self.setpoint.twist_in_odom = after;
        self.setpoint.acceleration_in_odom = limited.acceleration_in_odom;
        self.setpoint
    }
}
