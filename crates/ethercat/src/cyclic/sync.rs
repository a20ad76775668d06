//! When SYNC0 begins: at its place against the frames, for slow SubDevices against those that bring their data.

use core::time::Duration;

use crate::config::DcConfig;
use crate::image::Turn;
use crate::wire::DcTime;

/// When SYNC0 comes, ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Sync0 {
    /// From one to the next.
    pub cycle_ns: u32,
    pub shift_ns: i32,
    /// After that all events come again, in the SubDevice's turn: SYNC0's cycle, or that of a SYNC1 that comes less often.
    pub period_ns: u32,
}

impl Sync0 {
    pub fn of(sync: DcConfig) -> Option<Self> {
        match sync {
            DcConfig::Off => None,
            DcConfig::Sync0 { cycle_ns, shift_ns } => {
                (cycle_ns > 0).then_some(Sync0 { cycle_ns, shift_ns, period_ns: cycle_ns })
            }
            DcConfig::Sync0And1 { cycle_ns, shift_ns, sync1_cycle_ns } => {
                // SYNC1 is counted from the first SYNC0 behind the one before.
                let cycles = (cycle_ns > 0).then(|| sync1_cycle_ns / cycle_ns + 1)?;
                Some(Sync0 { cycle_ns, shift_ns, period_ns: cycle_ns.saturating_mul(cycles) })
            }
        }
    }

    /// The first SYNC0 that isn't before `now + margin`: a multiple of the bus' cycle plus the shift, and the next one behind
    /// a frame with the SubDevice's data. `now` is when the frame of the cycle of this number passed.
    pub fn start(self, turn: Turn, cycle: u64, now: DcTime, margin: Duration) -> DcTime {
        let every = u64::from(turn.every.max(1));
        let (period, bus_cycle) = (u64::from(self.period_ns), (u64::from(self.period_ns) / every).max(1));
        let shift = i64::from(self.shift_ns).rem_euclid(bus_cycle as i64) as u64;
        let next = now.0.saturating_sub(shift).div_ceil(bus_cycle).saturating_mul(bus_cycle);
        let own = next.saturating_add(shift).saturating_add(turn.until_due(cycle).saturating_mul(bus_cycle));
        let earliest = (now + margin).0;
        let periods = earliest.saturating_sub(own).div_ceil(period);
        DcTime(own.saturating_add(periods.saturating_mul(period)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn start(now: u64, cycle_ns: u32, shift_ns: i32) -> DcTime {
        Sync0 { cycle_ns, shift_ns, period_ns: cycle_ns }.start(
            Turn::EACH_CYCLE,
            7,
            DcTime(now),
            Duration::ZERO,
        )
    }

    #[test]
    fn the_first_sync_is_a_multiple_of_the_cycle_plus_the_shift_and_not_too_early() {
        assert_eq!(start(1_000_001, 1_000_000, 0), DcTime(2_000_000));
        assert_eq!(start(1_000_000, 1_000_000, 0), DcTime(1_000_000));
        assert_eq!(start(1_200_001, 1_000_000, 200_000), DcTime(2_200_000));
        assert_eq!(start(1_000_000, 1_000_000, -200_000), DcTime(1_800_000));
        assert_eq!(start(0, 125_000, 0), DcTime(0));
        let sync0 = Sync0 { cycle_ns: 1_000_000, shift_ns: 0, period_ns: 1_000_000 };
        let later = sync0.start(Turn::EACH_CYCLE, 0, DcTime(500_000), Duration::from_millis(100));
        assert_eq!(later, DcTime(101_000_000));
    }

    #[test]
    fn the_first_sync_is_in_phase_with_a_slower_sync1() {
        // SYNC0 four times in a bus cycle of 1 ms, SYNC1 with each fourth of them.
        let dc = DcConfig::Sync0And1 { cycle_ns: 250_000, shift_ns: 300_000, sync1_cycle_ns: 750_000 };
        let start = Sync0::of(dc).unwrap().start(Turn::EACH_CYCLE, 0, DcTime(5_310_000), Duration::ZERO);
        assert_eq!(start, DcTime(6_300_000));
        // One that comes with each SYNC0 leaves the phase to it.
        let dc = DcConfig::Sync0And1 { cycle_ns: 250_000, shift_ns: 300_000, sync1_cycle_ns: 100_000 };
        let start = Sync0::of(dc).unwrap().start(Turn::EACH_CYCLE, 0, DcTime(5_310_000), Duration::ZERO);
        assert_eq!(start, DcTime(5_550_000));
    }

    #[test]
    fn a_slow_one_is_synchronised_behind_the_frame_with_its_data() {
        // Frames pass at 0.5 ms of each: that of cycle 20 at 20.5 ms, so that of cycle 23 at 23.5 ms.
        let sync0 = Sync0 { cycle_ns: 10_000_000, shift_ns: 200_000, period_ns: 10_000_000 };
        let turn = Turn { every: 10, phase: 3 };
        for cycle in 20..40 {
            let now = DcTime(cycle * 1_000_000 + 500_000);
            let start = sync0.start(turn, cycle, now, Duration::from_millis(100));
            assert!(start >= now + Duration::from_millis(100));
            assert!(start < now + Duration::from_millis(111));
            assert_eq!(start.0 % 10_000_000, 4_200_000, "cycle {cycle}");
        }
    }
}
