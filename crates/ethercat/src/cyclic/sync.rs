//! When SYNC0 begins: at its place against the frames, for slow SubDevices against those that bring their data.

use core::time::Duration;

use crate::config::DcConfig;
use crate::image::Turn;
use crate::wire::DcTime;

/// Period and shift of SYNC0, ns; its period is one of the SubDevice's turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Sync0 {
    pub cycle_ns: u32,
    pub shift_ns: i32,
}

impl Sync0 {
    pub fn of(sync: DcConfig) -> Option<Self> {
        match sync {
            DcConfig::Off => None,
            DcConfig::Sync0 { cycle_ns, shift_ns } | DcConfig::Sync0And1 { cycle_ns, shift_ns, .. } => {
                (cycle_ns > 0).then_some(Sync0 { cycle_ns, shift_ns })
            }
        }
    }

    /// The first SYNC0 that isn't before `now + margin`: a multiple of the bus' cycle plus the shift, and the next one behind
    /// a frame with the SubDevice's data. `now` is when the frame of the cycle of this number passed.
    pub fn start(self, turn: Turn, cycle: u64, now: DcTime, margin: Duration) -> DcTime {
        let every = u64::from(turn.every.max(1));
        let (period, bus_cycle) = (u64::from(self.cycle_ns), (u64::from(self.cycle_ns) / every).max(1));
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
        Sync0 { cycle_ns, shift_ns }.start(Turn::EACH_CYCLE, 7, DcTime(now), Duration::ZERO)
    }

    #[test]
    fn the_first_sync_is_a_multiple_of_the_cycle_plus_the_shift_and_not_too_early() {
        assert_eq!(start(1_000_001, 1_000_000, 0), DcTime(2_000_000));
        assert_eq!(start(1_000_000, 1_000_000, 0), DcTime(1_000_000));
        assert_eq!(start(1_200_001, 1_000_000, 200_000), DcTime(2_200_000));
        assert_eq!(start(1_000_000, 1_000_000, -200_000), DcTime(1_800_000));
        assert_eq!(start(0, 125_000, 0), DcTime(0));
        let sync0 = Sync0 { cycle_ns: 1_000_000, shift_ns: 0 };
        let later = sync0.start(Turn::EACH_CYCLE, 0, DcTime(500_000), Duration::from_millis(100));
        assert_eq!(later, DcTime(101_000_000));
    }

    #[test]
    fn a_slow_one_is_synchronised_behind_the_frame_with_its_data() {
        // Frames pass at 0.5 ms of each: that of cycle 20 at 20.5 ms, so that of cycle 23 at 23.5 ms.
        let sync0 = Sync0 { cycle_ns: 10_000_000, shift_ns: 200_000 };
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
