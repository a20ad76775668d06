//! Speed, acceleration and jerk of a commanded twist, held in every cycle.
//!
//! # How
//! The output is a sequence of velocities v with a = Δv/T and j = Δa/T, so that the limits hold for exactly what
//! leaves. Translation is one vector with one limit each for |v|, |a| and |j|; rotation is a vector of one number.
//!
//! Braking an acceleration along its own direction with the full jerk ends at v + g(a), where g(a) = â·D(|a|) and
//! D(α) = T·Σ max(α − i·J·T, 0). A state is *safe* if |a| <= A and both v and v + g(a) lie in the disc |v| <= V:
//! the way between them is straight and the disc is convex, so braking never leaves it, and every state on that way
//! is safe again. Each cycle chooses a next state that is safe, so the limits hold for ever, by induction.
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

use omnibase_platform::Twist2;

use crate::limits::{Limits, LimitsError};

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
        let twist_in_odom = Twist2::new(translation.speed[0], translation.speed[1], rotation.speed[0]);
        LimitedTwist {
            twist_in_odom,
            acceleration_in_odom: Twist2::new(
                translation.acceleration[0],
                translation.acceleration[1],
                rotation.acceleration[0],
            ),
            outcome: match (finite, twist_in_odom == command) {
                (false, _) => Outcome::NotFinite,
                (true, true) => Outcome::Passed,
                (true, false) => Outcome::Limited,
            },
        }
    }
}

type Vector = [f64; 2];

fn plus(a: Vector, b: Vector, factor: f64) -> Vector {
    [a[0] + b[0] * factor, a[1] + b[1] * factor]
}

fn length(a: Vector) -> f64 {
    // A straight command along an axis shall not suffer from the rounding of a root.
    if a[1] == 0.0 { a[0].abs() } else { a[0].hypot(a[1]) }
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// `a` shortened to `most`.
fn clipped(a: Vector, most: f64) -> Vector {
    let long = length(a);
    if long > most { [a[0] * (most / long), a[1] * (most / long)] } else { a }
}

/// What rounding may add to a comparison with a limit; a thousandth of what the limits promise.
const ROUNDING: f64 = 1.0 + 1e-12;
/// Beyond this a state is outside of limits that were lowered; below, rounding.
const OUTSIDE: f64 = 1.0 + 1e-10;
/// A rate lasts if it changes by less than this part from one cycle to the next.
const LASTING: f64 = 0.1;
/// The part of the acceleration and jerk with which a fast turn is followed; the rest is left for catching up.
const RESERVE: f64 = 0.9;
/// Halvings between a cautious and the wished acceleration: a sixty-thousandth is left.
const HALVINGS: u32 = 16;

/// The acceleration at the largest part of 1 that is found safe by halving; `None` if none is.
fn halved(at: impl Fn(f64) -> Vector, safe: impl Fn(Vector) -> bool) -> Option<Vector> {
    let (mut good, mut bad) = (0.0, 1.0);
    let mut best = Some(at(good)).filter(|acceleration| safe(*acceleration));
    for _ in 0..HALVINGS {
        let middle = (good + bad) / 2.0;
        let acceleration = at(middle);
        if safe(acceleration) {
            (good, best) = (middle, Some(acceleration));
        } else {
            bad = middle;
        }
    }
    best
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    pub(crate) speed: f64,
    pub(crate) acceleration: f64,
    pub(crate) jerk: f64,
    pub(crate) period_s: f64,
}

impl Bounds {
    fn of(limits: &Limits, period_s: f64) -> [Bounds; 2] {
        [
            Bounds {
                speed: limits.speed_m_s,
                acceleration: limits.acceleration_m_s2,
                jerk: limits.jerk_m_s3,
                period_s,
            },
            Bounds {
                speed: limits.rate_rad_s,
                acceleration: limits.angular_acceleration_rad_s2,
                jerk: limits.angular_jerk_rad_s3,
                period_s,
            },
        ]
    }

    /// By how much the acceleration can change in one cycle.
    fn jerk_step(&self) -> f64 {
        self.jerk * self.period_s
    }

    /// D: by how much the speed still changes while an acceleration of this size is braked.
    fn braking(&self, acceleration: f64) -> f64 {
        let step = self.jerk_step();
        let cycles = (acceleration / step).floor();
        self.period_s * (cycles * acceleration - step * cycles * (cycles + 1.0) / 2.0)
    }

    /// The largest acceleration of the next cycle from which a speed difference is met without overshoot.
    ///
    /// Solves α·T + D(α) = `difference`: between m and m+1 jerk steps the left side is T·((m+1)α − J·T·m(m+1)/2).
    fn approach(&self, difference: f64) -> f64 {
        let unit = self.jerk_step() * self.period_s;
        let m = (((1.0 + 8.0 * difference / unit).sqrt() - 1.0) / 2.0).floor();
        (difference / self.period_s + self.jerk_step() * m * (m + 1.0) / 2.0) / (m + 1.0)
    }
}

/// One vector with limits for its length, its rate and the rate of that.
#[derive(Clone, Debug)]
pub(crate) struct VectorLimiter {
    pub(crate) bounds: Bounds,
    pub(crate) speed: Vector,
    pub(crate) acceleration: Vector,
    last_command: Vector,
    last_change: Vector,
}

/// One cycle's result.
pub(crate) struct Limited {
    pub(crate) speed: Vector,
    pub(crate) acceleration: Vector,
}

impl VectorLimiter {
    pub(crate) fn new(bounds: Bounds) -> VectorLimiter {
        VectorLimiter {
            bounds,
            speed: [0.0; 2],
            acceleration: [0.0; 2],
            last_command: [0.0; 2],
            last_change: [0.0; 2],
        }
    }

    pub(crate) fn restart(&mut self, speed: Vector) {
        (self.speed, self.acceleration) = (speed, [0.0; 2]);
        (self.last_command, self.last_change) = (speed, [0.0; 2]);
    }

    /// Where the speed ends if the acceleration is braked from now on.
    fn braked(&self, speed: Vector, acceleration: Vector) -> Vector {
        let size = length(acceleration);
        if size == 0.0 { speed } else { plus(speed, acceleration, self.bounds.braking(size) / size) }
    }

    pub(crate) fn step(&mut self, command: Vector) -> Limited {
        let bounds = self.bounds;
        let (period_s, jerk_step) = (bounds.period_s, bounds.jerk_step());
        // After the limits were lowered the present state may lie outside: it may stay there, but not go further.
        let outmost = length(self.speed).max(length(self.braked(self.speed, self.acceleration)));
        let most_speed = if outmost > bounds.speed * OUTSIDE { outmost } else { bounds.speed * ROUNDING };

        let wished = clipped(command, bounds.speed);
        let (wished, rate) = self.followable(wished);
        let target = self.slowed(wished, rate);

        let safe = |limiter: &VectorLimiter, acceleration: Vector| {
            let speed = plus(limiter.speed, acceleration, period_s);
            length(speed) <= most_speed && length(limiter.braked(speed, acceleration)) <= most_speed
        };
        let difference = plus(target, self.speed, -1.0);
        let direct = [difference[0] / period_s, difference[1] / period_s];
        if length(direct) <= bounds.acceleration * ROUNDING
            && length(plus(direct, self.acceleration, -1.0)) <= jerk_step * ROUNDING
            && length(plus(direct, rate, -1.0)) <= jerk_step * ROUNDING
            && safe(self, direct)
        {
            self.speed = target;
            self.acceleration = direct;
        } else {
            let towards = |part: f64| {
                let shortened = [target[0] * part, target[1] * part];
                self.towards(plus(plus(shortened, self.speed, -1.0), rate, -period_s * part), rate)
            };
            let braking = plus(self.acceleration, clipped(self.acceleration, jerk_step), -1.0);
            let wish = towards(1.0);
            let acceleration = if safe(self, wish) {
                wish
            } else {
                // Slower in the command's direction is better than as fast in another one.
                halved(towards, |acceleration| safe(self, acceleration))
                    .or_else(|| {
                        let way = plus(wish, braking, -1.0);
                        halved(|part| plus(braking, way, part), |acceleration| safe(self, acceleration))
                    })
                    .unwrap_or(braking)
            };
            self.speed = plus(self.speed, acceleration, period_s);
            self.acceleration = acceleration;
        }
        Limited { speed: self.speed, acceleration: self.acceleration }
    }

    /// A command and its own rate, shortened alike where it turns faster than the limits can follow.
    ///
    /// A lone jump has no rate. A rate that lasts is followed slower, in the command's direction.
    fn followable(&mut self, wished: Vector) -> (Vector, Vector) {
        let Bounds { period_s, acceleration: most, .. } = self.bounds;
        let change = plus(wished, self.last_command, -1.0);
        let bend = length(plus(change, self.last_change, -1.0));
        (self.last_command, self.last_change) = (wished, change);
        let rate = [change[0] / period_s, change[1] / period_s];
        if length(rate) <= most * ROUNDING {
            return (wished, rate);
        }
        if bend > LASTING * length(change) {
            return (wished, [0.0; 2]);
        }
        let factor = (RESERVE * most / length(rate)).min(RESERVE * self.bounds.jerk_step() * period_s / bend);
        let factor = factor.min(1.0);
        ([wished[0] * factor, wished[1] * factor], [rate[0] * factor, rate[1] * factor])
    }

    /// The command shortened, its direction kept, until braking its own rate from there stays inside the disc.
    fn slowed(&self, wished: Vector, rate: Vector) -> Vector {
        let overshoot = plus(self.braked(wished, rate), wished, -1.0);
        let (a, b, c) = (
            dot(wished, wished),
            dot(wished, overshoot),
            dot(overshoot, overshoot) - self.bounds.speed * self.bounds.speed,
        );
        if a + 2.0 * b + c <= 0.0 || a == 0.0 {
            return wished;
        }
        let factor = ((b * b - a * c).max(0.0).sqrt() - b) / a;
        let factor = factor.clamp(0.0, 1.0);
        [wished[0] * factor, wished[1] * factor]
    }

    /// The next acceleration on the fastest way to a target at `difference`, moving at `rate`.
    fn towards(&self, difference: Vector, rate: Vector) -> Vector {
        let jerk_step = self.bounds.jerk_step();
        let distance = length(difference);
        let wish = if distance > 0.0 {
            plus(rate, difference, self.bounds.approach(distance) / distance)
        } else {
            rate
        };
        let change = plus(clipped(wish, self.bounds.acceleration), self.acceleration, -1.0);
        plus(self.acceleration, clipped(change, jerk_step), 1.0)
    }
}
