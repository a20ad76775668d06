//! Instants that don't mix: the host's monotonic time and the segment's distributed-clock time.

use core::fmt;
use core::ops::{Add, Sub};
use core::time::Duration;

/// Nanoseconds of the host's monotonic clock (or of the virtual clock that stands for it).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct HostTime(pub u64);

/// Nanoseconds of a distributed clock, counted from 2000-01-01 where it was set so (ETG.1000.4).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct DcTime(pub u64);

macro_rules! instant {
    ($name:ident) => {
        impl Add<Duration> for $name {
            type Output = Self;
            fn add(self, rhs: Duration) -> Self {
                $name(self.0.saturating_add(u64::try_from(rhs.as_nanos()).unwrap_or(u64::MAX)))
            }
        }

        impl Sub<$name> for $name {
            type Output = Duration;
            /// Zero where `rhs` is later.
            fn sub(self, rhs: $name) -> Duration {
                Duration::from_nanos(self.0.saturating_sub(rhs.0))
            }
        }
    };
}
instant!(HostTime);
instant!(DcTime);

/// How long something took, as people are told it: three digits, and whole seconds.
pub fn spoken(duration: Duration) -> impl fmt::Display {
    Spoken(duration)
}

struct Spoken(Duration);

impl fmt::Display for Spoken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const SECOND: u128 = 1_000_000_000;
        let ns = self.0.as_nanos();
        let mut step = 1;
        while step < SECOND && ns / step >= 1000 {
            step *= 10;
        }
        let rounded = (ns + step / 2) / step * step;
        let units = [("s", SECOND), ("ms", 1_000_000), ("us", 1000), ("ns", 1)];
        let (unit, size) = units.into_iter().find(|(_, size)| rounded >= *size).unwrap_or(units[0]);
        write!(f, "{} {unit}", rounded as f64 / size as f64)
    }
}

/// The host's time. Only runners and set-up code own one; a cycle gets its times as arguments.
pub trait Clock {
    /// The present instant.
    fn now(&self) -> HostTime;
    /// Returns at `instant` or later; at once where it has passed.
    fn sleep_until(&mut self, instant: HostTime);

    /// What has to be added to this clock's times to get ns since 2000-01-01 0:00 UTC, as distributed clocks count;
    /// `None` where the date isn't known.
    fn since_2000_ns(&self) -> Option<u64> {
        None
    }

    /// A number that is another one at each start of the program, of the machine, or of the segment, as the time of day is; `None`
    /// where starts are to repeat each other, as in virtual time.
    fn chance(&self) -> Option<u64> {
        None
    }
}

impl<C: Clock + ?Sized> Clock for alloc::boxed::Box<C> {
    fn now(&self) -> HostTime {
        (**self).now()
    }
    fn sleep_until(&mut self, instant: HostTime) {
        (**self).sleep_until(instant);
    }
    fn since_2000_ns(&self) -> Option<u64> {
        (**self).since_2000_ns()
    }
    fn chance(&self) -> Option<u64> {
        (**self).chance()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn how_long_something_took_is_told_in_three_digits() {
        for (ns, expected) in [
            (0, "0 s"),
            (7, "7 ns"),
            (1500, "1.5 us"),
            (886_000, "886 us"),
            (999_600, "1 ms"),
            (29_860_078, "29.9 ms"),
            (500_000_000, "500 ms"),
            (3_000_000_000, "3 s"),
            (12_345_678_901, "12.3 s"),
            (3_723_400_000_000, "3723 s"),
        ] {
            assert_eq!(spoken(Duration::from_nanos(ns)).to_string(), expected);
        }
    }
}
