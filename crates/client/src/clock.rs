//! The robot's clock, as far as a program knows it.

use std::time::{Duration, Instant};

/// Of what the robot told of its clock in so long, the best counts: later its clock, or this one, may have been set.
const CLOCK_KEPT: Duration = Duration::from_secs(1);

/// The robot's clock as it was told lately, carried on by this computer's own.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RobotClock {
    began: Instant,
    /// How far it is ahead of the time since then, ms, at least: of the present second, and of the one before.
    ahead_ms: [f64; 2],
    since: Instant,
}

impl RobotClock {
    /// Not told yet.
    pub(crate) fn unknown(now: Instant) -> Self {
        RobotClock { began: now, ahead_ms: [f64::NEG_INFINITY; 2], since: now }
    }

    /// Below 0 before the beginning.
    fn elapsed_ms(&self, now: Instant) -> f64 {
        let since_ms = now.saturating_duration_since(self.began).as_secs_f64() * 1e3;
        since_ms - self.began.saturating_duration_since(now).as_secs_f64() * 1e3
    }

    /// What it shows at an instant, ms; what it told took its time to come, so that it may show a little more.
    pub(crate) fn at_ms(&self, instant: Instant) -> f64 {
        self.elapsed_ms(instant) + self.ahead_ms[0].max(self.ahead_ms[1])
    }

    /// Told anew: what came by a quicker way says more.
    pub(crate) fn told(&mut self, told_ms: f64, now: Instant) {
        if now.saturating_duration_since(self.since) > CLOCK_KEPT {
            (self.ahead_ms, self.since) = ([f64::NEG_INFINITY, self.ahead_ms[0]], now);
        }
        self.ahead_ms[0] = self.ahead_ms[0].max(told_ms - self.elapsed_ms(now));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_robots_clock_is_the_best_that_was_told_lately() {
        let began = Instant::now();
        let after = |ms: u64| began + Duration::from_millis(ms);
        let mut clock = RobotClock::unknown(began);
        clock.told(1000.0, began);
        assert!((clock.at_ms(after(100)) - 1100.0).abs() < 1e-9);
        // What took 30 ms to come says less than what is known; what took no time more.
        clock.told(1070.0, after(100));
        assert!((clock.at_ms(after(100)) - 1100.0).abs() < 1e-9);
        clock.told(1105.0, after(100));
        assert!((clock.at_ms(after(100)) - 1105.0).abs() < 1e-9);
        // It stood for 150 ms: that is found within two seconds.
        (110..2300).step_by(20).for_each(|ms| clock.told(ms as f64 + 855.0, after(ms)));
        assert!((clock.at_ms(after(2300)) - 3155.0).abs() < 1e-9);
    }
}
