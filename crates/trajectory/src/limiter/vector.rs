//! One vector whose length, rate and rate of rate have limits; see [`super`] for how.

use super::turning::Turning;
use crate::limits::Limits;

pub(super) type Vector = [f64; 2];

pub(super) fn plus(a: Vector, b: Vector, factor: f64) -> Vector {
    [a[0] + b[0] * factor, a[1] + b[1] * factor]
}

pub(super) fn length(a: Vector) -> f64 {
    // A straight command along an axis shall not suffer from the rounding of a root.
    if a[1] == 0.0 { a[0].abs() } else { omnibase_platform::length(a) }
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// `a` shortened to `most`, unless only rounding made it longer.
fn clipped(a: Vector, most: f64) -> Vector {
    let long = length(a);
    if long > most * ROUNDING { [a[0] * (most / long), a[1] * (most / long)] } else { a }
}

/// What rounding may add to a comparison with a limit; a thousandth of what the limits promise.
pub(super) const ROUNDING: f64 = 1.0 + 1e-12;
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
    pub(crate) fn of(limits: &Limits, period_s: f64) -> [Bounds; 2] {
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
    pub(super) fn jerk_step(&self) -> f64 {
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
    /// The speed of the cycle before.
    last_speed: Vector,
    last_command: Vector,
    last_change: Vector,
    /// Braking along the speed has begun, so that it goes on.
    brakes_straight: bool,
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
            last_speed: [0.0; 2],
            last_command: [0.0; 2],
            last_change: [0.0; 2],
            brakes_straight: false,
        }
    }

    pub(crate) fn restart(&mut self, speed: Vector) {
        (self.speed, self.last_speed, self.acceleration) = (speed, speed, [0.0; 2]);
        (self.last_command, self.last_change) = (speed, [0.0; 2]);
        self.brakes_straight = false;
    }

    /// Where the speed ends if the acceleration is braked from now on.
    fn braked(&self, speed: Vector, acceleration: Vector) -> Vector {
        let size = length(acceleration);
        if size == 0.0 { speed } else { plus(speed, acceleration, self.bounds.braking(size) / size) }
    }

    /// One cycle of the stop that can be foreseen: the acceleration ends along its own direction, then the speed
    /// along its own.
    pub(crate) fn brake(&mut self) -> Limited {
        let jerk_step = self.bounds.jerk_step();
        if !self.brakes_straight && length(self.acceleration) > 0.0 {
            let acceleration = plus(self.acceleration, clipped(self.acceleration, jerk_step), -1.0);
            self.last_speed = self.speed;
            self.speed = plus(self.speed, acceleration, self.bounds.period_s);
            self.acceleration = acceleration;
            (self.last_command, self.last_change) = ([0.0; 2], [0.0; 2]);
            return Limited { speed: self.speed, acceleration };
        }
        (self.last_command, self.last_change) = ([0.0; 2], [0.0; 2]);
        let limited = self.step([0.0; 2]);
        self.brakes_straight = true;
        limited
    }

    /// Whether a command asks for just what is done since the cycle before last: a cycle more of it changes nothing, to the bit.
    fn lasts(&self, command: Vector) -> bool {
        let bits = |vector: Vector| vector.map(f64::to_bits);
        let same = |vector: Vector| bits(vector) == bits(command);
        same(self.speed)
            && same(self.last_speed)
            && same(self.last_command)
            && bits(self.acceleration) == [0; 2]
            && bits(self.last_change) == [0; 2]
            && length(command) <= self.bounds.speed
    }

    pub(crate) fn step(&mut self, command: Vector) -> Limited {
        self.brakes_straight = false;
        if self.lasts(command) {
            return Limited { speed: self.speed, acceleration: self.acceleration };
        }
        self.next(command)
    }

    fn next(&mut self, command: Vector) -> Limited {
        let bounds = self.bounds;
        let (period_s, jerk_step) = (bounds.period_s, bounds.jerk_step());
        let turning = Turning::of(self.last_speed, self.speed);
        let braked = length(self.braked(self.speed, self.acceleration));
        // After the limits were lowered the present state may lie outside: it may stay there, but not go further.
        let within = bounds.speed * OUTSIDE;
        let brakes = braked <= within;
        let turns = turning.filter(|turning| !brakes && turning.is_safe(&bounds, within));
        let most_speed = if length(self.speed) <= within && (brakes || turns.is_some()) {
            bounds.speed * ROUNDING
        } else {
            length(self.speed).max(braked)
        };

        let wished = clipped(command, bounds.speed);
        let (wished, rate) = self.followable(wished);
        let target = self.slowed(wished, rate);

        let safe = |limiter: &VectorLimiter, acceleration: Vector| {
            let speed = plus(limiter.speed, acceleration, period_s);
            length(speed) <= most_speed
                && (length(limiter.braked(speed, acceleration)) <= most_speed
                    || Turning::of(limiter.speed, speed)
                        .is_some_and(|turning| turning.is_safe(&bounds, most_speed)))
        };
        let difference = plus(target, self.speed, -1.0);
        let direct = [difference[0] / period_s, difference[1] / period_s];
        if length(direct) <= bounds.acceleration * ROUNDING
            && length(plus(direct, self.acceleration, -1.0)) <= jerk_step * ROUNDING
            && length(plus(direct, rate, -1.0)) <= jerk_step * ROUNDING
            && safe(self, direct)
        {
            self.last_speed = self.speed;
            self.speed = target;
            self.acceleration = direct;
        } else {
            let towards = |part: f64| {
                let shortened = [target[0] * part, target[1] * part];
                self.towards(plus(plus(shortened, self.speed, -1.0), rate, -period_s * part), rate)
            };
            let braking = match turns {
                Some(turning) => turning.next_acceleration(&bounds),
                None => plus(self.acceleration, clipped(self.acceleration, jerk_step), -1.0),
            };
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
            self.last_speed = self.speed;
            self.speed = plus(self.speed, acceleration, period_s);
            self.acceleration = acceleration;
        }
        Limited { speed: self.speed, acceleration: self.acceleration }
    }

    /// A command and its own rate, shortened alike where it turns faster than the limits can follow.
    ///
    /// A jump counts as the greatest rate that can be followed. A turn that lasts is followed slower, in the command's direction; a command that only speeds up
    /// faster is followed as it is, later.
    fn followable(&mut self, wished: Vector) -> (Vector, Vector) {
        let Bounds { period_s, acceleration: most, jerk, .. } = self.bounds;
        let change = plus(wished, self.last_command, -1.0);
        let bend = length(plus(change, self.last_change, -1.0));
        (self.last_command, self.last_change) = (wished, change);
        let rate = [change[0] / period_s, change[1] / period_s];
        if length(rate) <= most * ROUNDING {
            return (wished, rate);
        }
        let speed = length(wished);
        if bend > LASTING * length(change) || speed == 0.0 {
            return (wished, clipped(rate, most));
        }
        // What turns the command at the rate ω: v·ω, and v·ω² is that turning.
        let across = (wished[0] * rate[1] - wished[1] * rate[0]).abs() / speed;
        let turning = across * across / speed;
        let factor = (RESERVE * most / across).min(RESERVE * jerk / turning).min(1.0);
        ([wished[0] * factor, wished[1] * factor], [rate[0] * factor, rate[1] * factor])
    }

    /// The command shortened, its direction kept, until braking its own rate from there stays inside the disc.
    fn slowed(&self, wished: Vector, rate: Vector) -> Vector {
        let before = plus(wished, rate, -self.bounds.period_s);
        let within = self.bounds.speed * ROUNDING;
        if Turning::of(before, wished).is_some_and(|turning| turning.is_safe(&self.bounds, within)) {
            return wished;
        }
        let overshoot = plus(self.braked(wished, rate), wished, -1.0);
        let (a, b, c) =
            (dot(wished, wished), dot(wished, overshoot), dot(overshoot, overshoot) - within * within);
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Commands that stay for a while, at rest, at the limit and beyond it: what passes at once is what would be computed.
    #[test]
    fn a_command_that_lasts_passes_with_the_bits_that_would_be_computed() {
        let bounds = Bounds { speed: 0.6, acceleration: 0.5, jerk: 5.0, period_s: 0.001 };
        let (mut quick, mut slow) = (VectorLimiter::new(bounds), VectorLimiter::new(bounds));
        let commands = [[0.0, 0.0], [0.3, 0.1], [0.6, 0.0], [0.5, -0.7], [-0.0, 0.0], [0.1, 0.0], [0.0, 0.0]];
        let (mut lasting, mut bound) = (0, 0);
        for (number, command) in commands.into_iter().enumerate() {
            for cycle in 0..3000 {
                if number == 2 && cycle == 2500 {
                    // What lasted lies beyond lower limits.
                    (quick.bounds.speed, slow.bounds.speed) = (0.4, 0.4);
                    bound += usize::from(!quick.lasts(command));
                }
                lasting += usize::from(quick.lasts(command));
                slow.brakes_straight = false;
                let (one, other) = (quick.step(command), slow.next(command));
                let bits =
                    |limited: &Limited| [limited.speed, limited.acceleration].map(|v| v.map(f64::to_bits));
                assert_eq!(bits(&one), bits(&other), "{command:?} {cycle}");
            }
        }
        assert!(lasting > 4000 && bound == 1, "{lasting} {bound}");
    }
}
