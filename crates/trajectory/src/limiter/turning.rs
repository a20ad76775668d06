//! Going on turning: the second way in which a motion near the speed limit can stay within limits for ever.
//!
//! Braking an acceleration along its own direction would leave the disc |v| <= V where the speed only turns:
//! driving a circle at the full speed is possible for ever, though.
//!
//! With s the length of v, g = Δs and δ the angle by which v turned in the last cycle, going on means to turn
//! by δ in every cycle while g falls to 0 by c per cycle (a length that falls already goes on falling by its
//! ratio). From the cosine rule, exactly for the sequence:
//!
//! - |a|·T = √(g² + 2·s·s'·(1 − cos δ)), largest at the end of growth for lengths and at its beginning for g;
//! - |j|·T² <= √((c + 2·V·(1 − cos δ))² + (2·g·sin δ)²), which gives the largest c;
//! - the length ends at s + Σ max(g − i·c, 0).
//!
//! In the next cycle g is smaller, so c is not smaller and the end not greater: a safe state leads to a safe state.

use super::vector::{Bounds, ROUNDING, Vector, length, plus};

/// How a speed turned and grew in one cycle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turning {
    speed: Vector,
    length: f64,
    /// g, by how much the length grew.
    growth: f64,
    /// s divided by the length before.
    ratio: f64,
    cos: f64,
    sin: f64,
}

impl Turning {
    /// From one speed to the next; `None` where no angle exists or it is a right one or more.
    pub(super) fn of(before: Vector, speed: Vector) -> Option<Turning> {
        let (first, second) = (length(before), length(speed));
        let product = first * second;
        if product == 0.0 {
            return None;
        }
        let cos = (before[0] * speed[0] + before[1] * speed[1]) / product;
        let sin = (before[0] * speed[1] - before[1] * speed[0]) / product;
        let (length, growth, ratio) = (second, second - first, second / first);
        (cos > 0.0).then_some(Turning { speed, length, growth, ratio, cos, sin })
    }

    /// 1 − cos δ without the loss of digits at small angles.
    fn versine(&self) -> f64 {
        self.sin * self.sin / (1.0 + self.cos)
    }

    /// c, by how much the growth can fall in each cycle; `None` if the turn alone needs the jerk.
    fn fall(&self, bounds: &Bounds) -> Option<f64> {
        let most = bounds.jerk_step() * bounds.period_s;
        let along = 2.0 * self.growth * self.sin;
        let left = (most * most - along * along).max(0.0).sqrt() - 2.0 * bounds.speed * self.versine();
        (left > 0.0).then_some(left)
    }

    /// Whether going on turning keeps all limits for ever, with lengths up to `most_speed`.
    pub(super) fn is_safe(&self, bounds: &Bounds, most_speed: f64) -> bool {
        if self.length > most_speed {
            return false;
        }
        let most = bounds.acceleration * bounds.period_s * ROUNDING;
        if self.growth <= 0.0 {
            // v' = z·v with |z| <= 1: the change of a falls, too.
            let before = self.length / self.ratio;
            let change = |from: f64| {
                (self.growth / before * from).hypot(from * (2.0 * self.ratio * self.versine()).sqrt())
            };
            let step = change(before);
            let bend = change(step);
            return step <= most && bend <= bounds.jerk_step() * bounds.period_s * ROUNDING;
        }
        let Some(fall) = self.fall(bounds) else { return false };
        let cycles = (self.growth / fall).floor();
        let end = self.length + cycles * self.growth - fall * cycles * (cycles + 1.0) / 2.0;
        let square = self.growth * self.growth + 2.0 * end * end * self.versine();
        end <= most_speed && square <= most * most
    }

    /// The acceleration of the next cycle of going on.
    pub(super) fn next_acceleration(&self, bounds: &Bounds) -> Vector {
        let factor = if self.growth <= 0.0 {
            self.ratio.min(1.0)
        } else {
            let growth = self.fall(bounds).map_or(0.0, |fall| (self.growth - fall).max(0.0));
            (self.length + growth) / self.length
        };
        let [x, y] = self.speed;
        let next = [factor * (self.cos * x - self.sin * y), factor * (self.sin * x + self.cos * y)];
        let change = plus(next, self.speed, -1.0);
        [change[0] / bounds.period_s, change[1] / bounds.period_s]
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// What is called safe goes on within all limits, 3000 cycles long, and stays safe.
        #[test]
        fn going_on_keeps_the_limits(
            share in 0.9..1.0, growth in -1.0..1.0, turn in -1.1..1.1, jerk in 0.5..20.0, period_s in 2e-4..5e-3,
        ) {
            let bounds = Bounds { speed: 0.6, acceleration: 0.5, jerk, period_s };
            // Turning at up to 1.1 times the rate that the acceleration allows, growing by up to a tenth of it.
            let (length, growth) = (0.6 * share, growth * 0.05 * period_s);
            let angle: f64 = turn * bounds.acceleration / bounds.speed * period_s;
            let mut before = [length - growth, 0.0];
            let mut speed = [length * angle.cos(), length * angle.sin()];
            let mut safe = 0;
            let mut last = [(speed[0] - before[0]) / period_s, (speed[1] - before[1]) / period_s];
            for _ in 0..3000 {
                let Some(turning) = Turning::of(before, speed) else { break };
                if !turning.is_safe(&bounds, bounds.speed * ROUNDING) {
                    break;
                }
                safe += 1;
                let next = turning.next_acceleration(&bounds);
                (before, speed) = (speed, plus(speed, next, period_s));
                // The speeds' own rounding shows in the second difference.
                let rounding = 4e-16 / period_s;
                prop_assert!(length_of(speed) <= bounds.speed * (1.0 + 1e-9));
                prop_assert!(length_of(next) <= bounds.acceleration * (1.0 + 1e-9) + rounding);
                prop_assert!(length_of(plus(next, last, -1.0)) <= bounds.jerk_step() * (1.0 + 1e-9) + 2.0 * rounding);
                last = next;
            }
            prop_assert!(safe == 0 || safe == 3000, "safe for {} cycles only", safe);
        }
    }

    fn length_of(vector: Vector) -> f64 {
        vector[0].hypot(vector[1])
    }
}
