//! Two ways of keeping the cycle and the distributed clocks together.

use core::time::Duration;

use crate::wire::{DcTime, HostTime};

/// The reference clock as the cycle's frames show it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ClockReading {
    last: Option<DcTime>,
    /// Time of the cycle that read it.
    read_at: HostTime,
}

impl ClockReading {
    /// Takes the data of an answered clock datagram: 8 bytes, or 4 that wrap every 4.29 s.
    #[inline]
    pub fn take(&mut self, data: &[u8]) {
        if let Some(bytes) = data.first_chunk() {
            self.last = Some(DcTime(u64::from_le_bytes(*bytes)));
        } else if let Some(bytes) = data.first_chunk() {
            let low = u32::from_le_bytes(*bytes);
            let last = self.last.unwrap_or_default().0;
            let passed = low.wrapping_sub(last as u32);
            self.last = Some(DcTime(last.wrapping_add(u64::from(passed))));
        }
    }

    /// Takes the data of an answered clock datagram of the cycle at `now`.
    #[inline]
    pub fn take_at(&mut self, data: &[u8], now: HostTime) {
        self.take(data);
        self.read_at = now;
    }

    /// What the reference clock will show to the cycle at `now`, as far as the host's clock can tell. `None` before
    /// the first reading.
    #[inline]
    pub fn expected(&self, now: HostTime) -> Option<DcTime> {
        self.last.map(|last| DcTime(last.0.wrapping_add(now.0.wrapping_sub(self.read_at.0))))
    }

    pub fn last(self) -> Option<DcTime> {
        self.last
    }
}

/// How a [`DcFollower`] reacts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FollowerGains {
    /// Share of the phase error that is corrected in one cycle.
    pub proportional: f64,
    /// Share that is added to the lasting correction in each cycle: this is what follows the drift.
    pub integral: f64,
    /// Share of the error's change that is corrected in one cycle.
    pub derivative: f64,
    /// The largest correction in one cycle, as a share of the cycle: a running cycle is steered, never stepped.
    pub limit: f64,
}

impl Default for FollowerGains {
    fn default() -> Self {
        FollowerGains { proportional: 0.1, integral: 0.002, derivative: 0.0, limit: 0.05 }
    }
}

/// Makes the host's cycle follow the distributed clock: frames leave at a fixed phase of the DC time.
///
/// Each cycle gives it the DC time that the frame read; it gives back when to wake next. The phase error is the
/// visible measure of how well that works.
#[derive(Clone, Debug)]
pub struct DcFollower {
    cycle_ns: u64,
    phase_ns: u64,
    gains: FollowerGains,
    /// ns per cycle by which the host's cycle has to differ from its nominal length.
    drift_ns: f64,
    error_ns: Option<i64>,
}

impl DcFollower {
    /// Frames shall pass the reference clock at `phase` behind each multiple of `cycle`.
    pub fn new(cycle: Duration, phase: Duration, gains: FollowerGains) -> Self {
        let cycle_ns = (cycle.as_nanos() as u64).max(1);
        DcFollower {
            cycle_ns,
            phase_ns: phase.as_nanos() as u64 % cycle_ns,
            gains,
            drift_ns: 0.0,
            error_ns: None,
        }
    }

    /// The instant of the next cycle after one that began at `wake`; `clock` is the DC time that its frame read, or
    /// `None` where it was lost: then the cycle goes on with the drift that is known.
    pub fn next_wake(&mut self, wake: HostTime, clock: Option<DcTime>) -> HostTime {
        let mut correction = self.drift_ns;
        if let Some(clock) = clock {
            let error = self.phase_error(clock);
            let change = self.error_ns.map_or(0, |last| error - last);
            self.error_ns = Some(error);
            let limit = self.gains.limit * self.cycle_ns as f64;
            let (error, change) = (error as f64, change as f64);
            let drift = self.drift_ns - self.gains.integral * error;
            let wished = drift - self.gains.proportional * error - self.gains.derivative * change;
            correction = wished.clamp(-limit, limit);
            // While the limit holds, the error says nothing about the drift.
            if correction == wished {
                self.drift_ns = drift;
            }
        }
        let length = self.cycle_ns as i64 + correction as i64;
        HostTime(wake.0.saturating_add(length.max(1) as u64))
    }

    /// How far `clock` is behind the wished phase (positive) or before it, ns; at most half a cycle.
    pub fn phase_error(&self, clock: DcTime) -> i64 {
        let behind = clock.0.wrapping_sub(self.phase_ns) % self.cycle_ns;
        if behind > self.cycle_ns / 2 { behind as i64 - self.cycle_ns as i64 } else { behind as i64 }
    }

    /// The phase error of the last cycle whose frame came back, ns.
    pub fn last_error_ns(&self) -> Option<i64> {
        self.error_ns
    }

    /// What the host's clock gains on the reference clock, as far as it is known, parts per million.
    pub fn drift_ppm(&self) -> f64 {
        self.drift_ns / self.cycle_ns as f64 * 1e6
    }
}

/// Makes the reference clock follow the host's: gives the DC time to write to it (0x0910) in each cycle.
///
/// The first reading fixes the relation, so the running clock isn't stepped; from then on DC time passes as host
/// time does, and the reference clock's own control loop removes its drift.
#[derive(Clone, Copy, Debug, Default)]
pub struct HostToDc {
    anchor: Option<(HostTime, DcTime)>,
    error_ns: Option<i64>,
}

impl HostToDc {
    /// Not tied yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// The DC time that belongs to `host`; `None` before the first reading.
    pub fn time_at(&self, host: HostTime) -> Option<DcTime> {
        let (host_anchor, dc_anchor) = self.anchor?;
        Some(DcTime(dc_anchor.0.wrapping_add(host.0.wrapping_sub(host_anchor.0))))
    }

    /// Takes a reading of the reference clock, whose frame was sent at `host`.
    pub fn read(&mut self, host: HostTime, clock: DcTime) {
        match self.time_at(host) {
            None => self.anchor = Some((host, clock)),
            Some(wished) => self.error_ns = Some(clock.0.wrapping_sub(wished.0) as i64),
        }
    }

    /// How far the reference clock was ahead of the host (positive) or behind it at the last reading, ns.
    pub fn last_error_ns(&self) -> Option<i64> {
        self.error_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A host whose clock runs 50 ppm fast, frames that take 20 us, one frame in 50 lost.
    #[test]
    fn the_cycle_locks_to_a_drifting_clock_without_a_step() {
        let cycle = Duration::from_millis(1);
        let mut follower = DcFollower::new(cycle, Duration::from_micros(200), FollowerGains::default());
        let dc = |host: HostTime| DcTime((host.0 as f64 * (1.0 - 50e-6)) as u64 + 777_123_456);
        let mut wake = HostTime(5_000_000);
        let mut worst_late = 0;
        for cycle_number in 0..10_000 {
            let clock = dc(wake + Duration::from_micros(20));
            let next = follower.next_wake(wake, (cycle_number % 50 != 7).then_some(clock));
            let length = next - wake;
            assert!(length.abs_diff(cycle) <= Duration::from_micros(50), "stepped by {length:?}");
            if cycle_number > 3000 {
                worst_late = worst_late.max(follower.phase_error(clock).abs());
            }
            wake = next;
        }
        assert!(worst_late < 100, "{worst_late} ns after 3 s");
        assert!((follower.drift_ppm() - 50.0).abs() < 2.0, "{}", follower.drift_ppm());
    }

    #[test]
    fn the_phase_error_has_a_sign_and_half_a_cycle_at_most() {
        let cycle = Duration::from_nanos(1000);
        let follower = DcFollower::new(cycle, Duration::from_nanos(100), FollowerGains::default());
        assert_eq!(follower.phase_error(DcTime(5_100)), 0);
        assert_eq!(follower.phase_error(DcTime(5_150)), 50);
        assert_eq!(follower.phase_error(DcTime(5_050)), -50);
        assert_eq!(follower.phase_error(DcTime(5_600)), 500);
    }

    #[test]
    fn a_32_bit_clock_is_continued_over_its_wrap() {
        let mut reading = ClockReading::default();
        reading.take(&[0xF0, 0xFF, 0xFF, 0xFF]);
        reading.take(&[0x10, 0, 0, 0]);
        assert_eq!(reading.last(), Some(DcTime(0x1_0000_0010)));
        reading.take(&[1, 2, 3]);
        assert_eq!(reading.last(), Some(DcTime(0x1_0000_0010)));
    }

    #[test]
    fn the_host_leads_without_stepping_the_clock() {
        let mut host_to_dc = HostToDc::new();
        assert_eq!(host_to_dc.time_at(HostTime(1)), None);
        host_to_dc.read(HostTime(1_000), DcTime(50_000));
        assert_eq!(host_to_dc.time_at(HostTime(2_500)), Some(DcTime(51_500)));
        host_to_dc.read(HostTime(2_000), DcTime(51_030));
        assert_eq!(host_to_dc.last_error_ns(), Some(30));
    }
}
