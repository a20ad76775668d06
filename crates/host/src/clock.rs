//! The host's monotonic clock.

use omnibase_ethercat_wire::{Clock, HostTime};
use rustix::io::Errno;
use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec, clock_gettime};

/// How often two clocks are read before a pause between the readings is accepted.
const READINGS: usize = 4;
/// The longest undisturbed reading of two clocks, ns.
const READING_NS: u128 = 5_000;

/// 2000-01-01 0:00 UTC in ns since 1970.
const UNIX_2000_NS: u64 = 946_684_800_000_000_000;
/// 2024-01-01: no host that knows the date shows an earlier one.
const KNOWN_UNIX_NS: u64 = 1_704_067_200_000_000_000;

/// `CLOCK_MONOTONIC`: never set back, not stepped by time synchronisation.
///
/// Reading it needs no system call (vDSO). Sleeping is to an absolute instant, so that lateness doesn't add up.
#[derive(Clone, Copy, Debug, Default)]
pub struct MonotonicClock;

impl MonotonicClock {
    /// What has to be added to [`HostTime`] to get nanoseconds since 1970-01-01 UTC, for time stamps in recordings.
    pub fn unix_offset_ns(&self) -> u64 {
        nanoseconds(clock_gettime(ClockId::Realtime)).saturating_sub(self.now().0)
    }

    /// The monotonic instant of a kernel's time stamp from a moment ago, given in ns since 1970-01-01 UTC.
    ///
    /// Both clocks are read anew: an offset that is kept would be wrong once the calendar clock is set. A pause
    /// between the readings would pass for age, so the reading is repeated where there was one.
    pub(crate) fn instant_of_unix(&self, unix_ns: u64) -> HostTime {
        let mut now = self.now();
        let mut age_ns = 0;
        for _ in 0..READINGS {
            let before = self.now();
            age_ns = nanoseconds(clock_gettime(ClockId::Realtime)).saturating_sub(unix_ns);
            now = self.now();
            if (now - before).as_nanos() <= READING_NS {
                break;
            }
        }
        HostTime(now.0.saturating_sub(age_ns))
    }
}

impl Clock for MonotonicClock {
    #[inline]
    fn now(&self) -> HostTime {
        HostTime(nanoseconds(clock_gettime(ClockId::Monotonic)))
    }

    fn since_2000_ns(&self) -> Option<u64> {
        let unix_ns = self.unix_offset_ns();
        // A host that was just started and knows no date counts from 1970, or from when its software was built.
        (unix_ns + self.now().0 > KNOWN_UNIX_NS).then(|| unix_ns.wrapping_sub(UNIX_2000_NS))
    }

    fn chance(&self) -> Option<u64> {
        // Where the date isn't known, too, nanoseconds differ.
        Some(nanoseconds(clock_gettime(ClockId::Realtime)))
    }

    fn sleep_until(&mut self, instant: HostTime) {
        if instant <= self.now() {
            return;
        }
        let request = timespec(instant.0);
        // A signal handler may cut the sleep short; the contract is "at the instant or later".
        while clock_nanosleep_absolute(ClockId::Monotonic, &request) == Err(Errno::INTR) {}
    }
}

/// Nanoseconds of a time that isn't negative.
#[inline]
pub(crate) fn nanoseconds(time: Timespec) -> u64 {
    (time.tv_sec as u64).wrapping_mul(1_000_000_000).wrapping_add(time.tv_nsec as u64)
}

/// The kernel's form of `nanoseconds`.
#[inline]
pub(crate) fn timespec(nanoseconds: u64) -> Timespec {
    Timespec { tv_sec: (nanoseconds / 1_000_000_000) as i64, tv_nsec: (nanoseconds % 1_000_000_000) as _ }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_segments_epoch_is_2000() {
        let clock = MonotonicClock;
        let since_2000_ns = clock.since_2000_ns().expect("this machine knows the date") + clock.now().0;
        let by_std = std::time::UNIX_EPOCH.elapsed().unwrap().as_secs() - 10_957 * 86_400;
        assert!((since_2000_ns / 1_000_000_000).abs_diff(by_std) <= 2, "{since_2000_ns} {by_std}");
    }

    #[test]
    fn chance_goes_on_with_time() {
        let (before, begun) = (MonotonicClock.chance().unwrap(), MonotonicClock.now());
        MonotonicClock.sleep_until(HostTime(begun.0 + 1_000_000));
        assert!(MonotonicClock.chance().unwrap() >= before + 1_000_000);
    }

    #[test]
    fn never_goes_back_and_sleeps_at_least_to_the_instant() {
        let mut clock = MonotonicClock;
        let start = clock.now();
        let wanted = HostTime(start.0 + 50_000);
        clock.sleep_until(wanted);
        assert!(clock.now() >= wanted);
        clock.sleep_until(start);
    }

    #[test]
    fn nanoseconds_and_kernel_time_are_inverse() {
        for value in [0, 1, 999_999_999, 1_000_000_000, 1_773_540_979_389_182_856] {
            assert_eq!(nanoseconds(timespec(value)), value);
        }
    }

    #[test]
    fn a_time_stamp_is_the_instant_at_which_it_was_taken() {
        let before = MonotonicClock.now();
        let stamp_ns = nanoseconds(clock_gettime(ClockId::Realtime));
        let after = MonotonicClock.now();
        let instant = MonotonicClock.instant_of_unix(stamp_ns);
        // The readings aren't simultaneous: some microseconds, but for pauses, which the bounds contain.
        let slack = 20_000;
        assert!(instant.0 + slack >= before.0, "{instant:?} before {before:?}");
        assert!(instant <= MonotonicClock.now(), "{instant:?}, {after:?}");
        assert_eq!(MonotonicClock.instant_of_unix(0).0, 0, "a stamp that no frame of this boot can have");
    }

    #[test]
    fn unix_offset_leads_to_this_century() {
        let unix_ns = MonotonicClock.now().0 + MonotonicClock.unix_offset_ns();
        assert!(unix_ns > 946_684_800_000_000_000, "after 2000-01-01");
    }
}
