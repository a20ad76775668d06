//! Instants of the robot on ROS 2's clock.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant, SystemTime};

/// Of what the robot told of its clock in so long, the best counts.
const KEPT: Duration = Duration::from_secs(1);
/// By so much stamps may seem to go back where the best is forgotten, ns; they stay in their order.
const JITTER_NS: i64 = 20_000_000;

/// Which clock stamps are of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// This computer's.
    System,
    /// The simulated robot's own, which is told on `/clock`.
    Robot,
}

/// How far the robot's clock is ahead of this program's, ns, at least: of the present second, and of the one before.
struct Ahead {
    best_ns: [Option<i64>; 2],
    since: Instant,
    /// The last stamp that was made.
    last_ns: i64,
}

/// ROS 2's clock, in all threads.
#[derive(Clone)]
pub struct Clock {
    kind: Kind,
    began: Instant,
    ahead: Arc<Mutex<Ahead>>,
}

impl Clock {
    /// Nothing known of the robot's.
    pub fn new(kind: Kind) -> Self {
        let began = Instant::now();
        let ahead = Ahead { best_ns: [None; 2], since: began, last_ns: i64::MIN };
        Clock { kind, began, ahead: Arc::new(Mutex::new(ahead)) }
    }

    /// What it shows now, ns; nothing while the robot's is not known.
    pub fn now_ns(&self) -> Option<i64> {
        match self.kind {
            Kind::System => system_ns(),
            Kind::Robot => {
                let best_ns = self.ahead.lock().unwrap_or_else(PoisonError::into_inner).best_ns();
                Some(self.elapsed_ns(Instant::now()) + best_ns?)
            }
        }
    }

    /// The stamp of a robot's instant, of which it was told now.
    pub fn stamp_ns(&self, instant_ns: u64) -> Option<i64> {
        let now = Instant::now();
        let instant_ns = i64::try_from(instant_ns).ok()?;
        let mut ahead = self.ahead.lock().unwrap_or_else(PoisonError::into_inner);
        let elapsed_ns = self.elapsed_ns(now);
        ahead.told(instant_ns - elapsed_ns, now);
        let stamp_ns = match self.kind {
            Kind::Robot => instant_ns,
            Kind::System => system_ns()? - (elapsed_ns + ahead.best_ns()? - instant_ns),
        };
        let stamp_ns = if (ahead.last_ns.saturating_sub(JITTER_NS)..=ahead.last_ns).contains(&stamp_ns) {
            ahead.last_ns + 1
        } else {
            stamp_ns
        };
        ahead.last_ns = stamp_ns;
        Some(stamp_ns)
    }

    fn elapsed_ns(&self, now: Instant) -> i64 {
        now.saturating_duration_since(self.began).as_nanos() as i64
    }
}

impl Ahead {
    fn best_ns(&self) -> Option<i64> {
        self.best_ns[0].max(self.best_ns[1])
    }

    fn told(&mut self, ahead_ns: i64, now: Instant) {
        if now.saturating_duration_since(self.since) > KEPT {
            (self.best_ns, self.since) = ([None, self.best_ns[0]], now);
        }
        self.best_ns[0] = self.best_ns[0].max(Some(ahead_ns));
    }
}

fn system_ns() -> Option<i64> {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).ok()?;
    i64::try_from(now.as_nanos()).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_keep_their_order_and_their_distance() {
        let clock = Clock::new(Kind::System);
        let before_ns = system_ns().unwrap();
        let first_ns = clock.stamp_ns(5_000_000).unwrap();
        // Told later, of an instant 1 ms after: at most so late, and never before.
        let second_ns = clock.stamp_ns(6_000_000).unwrap();
        let after_ns = system_ns().unwrap();
        assert!(first_ns >= before_ns && second_ns > first_ns, "{first_ns} {second_ns}");
        assert!(second_ns <= after_ns);
        // What was told twice isn't of the same instant.
        assert!(clock.stamp_ns(6_000_000).unwrap() > second_ns);
    }

    #[test]
    fn a_simulated_robots_clock_is_its_own() {
        let clock = Clock::new(Kind::Robot);
        assert_eq!(clock.now_ns(), None);
        assert_eq!(clock.stamp_ns(7_000_000), Some(7_000_000));
        let now_ns = clock.now_ns().unwrap();
        assert!((7_000_000..1_000_000_000).contains(&now_ns), "{now_ns}");
    }
}
