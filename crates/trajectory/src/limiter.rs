//! Speed, acceleration and jerk of a commanded twist, held in every cycle.
//!
//! # How
//! The output is a sequence of velocities v with a = Δv/T and j = Δa/T, so that the limits hold for exactly what
//! leaves. Translation is one vector with one limit each for |v|, |a| and |j|; rotation is a vector of one number.
//!
//! Braking an acceleration along its own direction with the full jerk ends at v + g(a), where g(a) = â·D(|a|)
//! and D(α) = T·Σ max(α − i·J·T, 0).
//!
//! A state is *safe* if |a| <= A and both v and v + g(a) lie in the disc |v| <= V: the way between them is
//! straight and the disc is convex, so braking never leaves it, and every state on that way is safe again.
//!
//! A second kind of safe states are those that go on turning (`limiter/turning.rs`): a circle at full speed.
//! Each cycle chooses a next state that is safe, so the limits hold for ever, by induction.
//!
//! Among the safe states it takes, in this order:
//! 1. the command itself, if one cycle reaches it and its motion can be followed further: within its limits a
//!    trajectory passes unchanged, not even delayed;
//! 2. the one on the fastest way there: accelerating towards the command with the largest acceleration from which it
//!    can still be met without overshoot (α·T + D(α) = distance), relative to the command's own motion;
//! 3. the same for a command shortened until that is safe, so that the direction is kept and the speed is not; at
//!    last something between the fastest way and braking.
//!
//! Before that, a command is shortened, its direction kept, to the allowed speed, and to the speed at which its own
//! turning can be followed (v = A/ω).
//!
//! A command along the present direction of motion (start, stop, reversal, more than is allowed) keeps all vectors
//! collinear: the path stays straight.
//!
//! An existing planner of jerk-limited profiles (Ruckig) limits each axis for itself: two axes together exceed |a|
//! by √2, or bend a straight command.

mod turning;
mod vector;

use omnibase_platform::Twist2;

use crate::limits::{Limits, LimitsError};
pub(crate) use vector::{Bounds, Limited, VectorLimiter};

/// A twist within the limits, with its rates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LimitedTwist {
    /// The twist.
    pub twist_in_odom: Twist2,
    /// Its change since the last cycle, per second.
    pub acceleration_in_odom: Twist2,
    /// Whether the twist differs from the command.
    pub outcome: Outcome,
}

/// Whether a command passed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Outcome {
    /// The command passed unchanged.
    #[default]
    Passed,
    /// A limit held it back.
    Limited,
    /// It was no number; the platform is being stopped.
    NotFinite,
}

/// Limits a twist, one call per cycle. The twist must be in a frame that does not turn (odom).
#[derive(Clone, Debug)]
pub struct TwistLimiter {
    translation: VectorLimiter,
    rotation: VectorLimiter,
}

impl TwistLimiter {
    /// A limiter at rest, for cycles of `period_s`.
    pub fn new(limits: &Limits, period_s: f64) -> Result<TwistLimiter, LimitsError> {
        limits.check()?;
        if !(period_s.is_finite() && period_s > 0.0) {
            return Err(LimitsError::Setting { setting: "period_s", found: period_s });
        }
        let [translation, rotation] = Bounds::of(limits, period_s);
        Ok(TwistLimiter {
            translation: VectorLimiter::new(translation),
            rotation: VectorLimiter::new(rotation),
        })
    }

    /// Changes the limits while moving. A motion beyond the new ones is brought inside by braking, never by a jump.
    pub fn set_limits(&mut self, limits: &Limits) -> Result<(), LimitsError> {
        limits.check()?;
        [self.translation.bounds, self.rotation.bounds] =
            Bounds::of(limits, self.translation.bounds.period_s);
        Ok(())
    }

    /// Begins anew at a twist with constant speed: after standstill, or where the platform is moving already.
    pub fn restart(&mut self, twist_in_odom: Twist2) {
        let Twist2 { vx_m_s, vy_m_s, w_rad_s } = twist_in_odom;
        self.translation.restart([vx_m_s, vy_m_s]);
        self.rotation.restart([w_rad_s, 0.0]);
    }

    /// One cycle: the twist to send for a commanded one. A command that is not finite counts as zero.
    pub fn step(&mut self, command_in_odom: Twist2) -> LimitedTwist {
        let finite = command_in_odom.is_finite();
        let command = if finite { command_in_odom } else { Twist2::default() };
        let translation = self.translation.step([command.vx_m_s, command.vy_m_s]);
        let rotation = self.rotation.step([command.w_rad_s, 0.0]);
        let limited = joined(&translation, &rotation);
        let outcome = match (finite, limited.twist_in_odom == command) {
            (false, _) => Outcome::NotFinite,
            (true, true) => Outcome::Passed,
            (true, false) => Outcome::Limited,
        };
        LimitedTwist { outcome, ..limited }
    }

    /// One cycle of a stop whose way is known beforehand; called in every cycle until the platform stands.
    ///
    /// First the acceleration ends along its own direction, at the full jerk; then the speed along its own, so that
    /// the way is straight. From speed v and acceleration a the way lies in the convex hull that
    /// [`Limits`]'s figures give: see the safety manual.
    pub fn brake(&mut self) -> LimitedTwist {
        LimitedTwist {
            outcome: Outcome::Limited,
            ..joined(&self.translation.brake(), &self.rotation.brake())
        }
    }
}

fn joined(translation: &Limited, rotation: &Limited) -> LimitedTwist {
    let both = |[x, y]: [f64; 2], [w, _]: [f64; 2]| Twist2::new(x, y, w);
    LimitedTwist {
        twist_in_odom: both(translation.speed, rotation.speed),
        acceleration_in_odom: both(translation.acceleration, rotation.acceleration),
        outcome: Outcome::Passed,
    }
}
