//! Instants that don't mix: the host's monotonic time and the segment's distributed-clock time.

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
