//! The table of the bus, and the drives' watchdog.

use super::Check;
use super::safety::LOST_EXCHANGES_TOLERATED;
use crate::config::*;

/// The drives' watchdog by default, us: that of the standard after power-on.
pub(super) const DRIVE_WATCHDOG_US: u32 = 100_000;

/// The cycle, us; where the file has none, which is a problem of its own, some cycle.
pub(super) fn cycle_us(table: &BusTable) -> u32 {
    table.cycle_us.unwrap_or(1000).max(1)
}

impl Check {
    pub(super) fn bus(&mut self, table: &BusTable, safety: &SafetyTable) -> Option<BusPlan> {
        let cycle_us = self.need(table.cycle_us, "bus.cycle_us", "everything is timed by it")?;
        let synchronisation = table.synchronisation.unwrap_or(Synchronisation::Sync0);
        let timeout_us = table.receive_timeout_us.unwrap_or(cycle_us / 2);
        if timeout_us >= cycle_us {
            let reason = "the answer must be there before the next cycle";
            let problem = self.report(ProblemKind::OutOfRange, "bus.receive_timeout_us", reason);
            problem.value = Some(timeout_us.to_string());
            problem.limit = Some(format!("below cycle_us = {cycle_us}"));
        }
        let half_cycle_us = i32::try_from(cycle_us / 2).unwrap_or(i32::MAX);
        let drive_watchdog = self.drive_watchdog(safety, cycle_us);
        Some(BusPlan {
            cycle_ns: u64::from(cycle_us) * 1000,
            receive_timeout_ns: u64::from(timeout_us) * 1000,
            synchronisation,
            sync0_shift_ns: table.sync0_shift_us.unwrap_or(half_cycle_us).saturating_mul(1000),
            clock_source: table.clock_source.unwrap_or(ClockSource::DistributedClock),
            drive_watchdog: drive_watchdog?,
        })
    }

    /// Chips count steps: what they can't represent is refused, not rounded. A watchdog that bites before the policy
    /// for lost exchanges does would take the ramp away from it.
    fn drive_watchdog(&mut self, table: &SafetyTable, cycle_us: u32) -> Option<DriveWatchdog> {
        const KEY: &str = "safety.drive_watchdog_us";
        let us = table.drive_watchdog_us.unwrap_or(DRIVE_WATCHDOG_US);
        let Some(watchdog) = DriveWatchdog::from_us(us) else {
            let below = us / DriveWatchdog::STEP_US * DriveWatchdog::STEP_US;
            let reason = "the drives' watchdog counts whole steps of 100 us";
            let problem = self.report(ProblemKind::OutOfRange, KEY, reason);
            problem.value = Some(us.to_string());
            problem.limit = Some(format!("{below} or {}", below.saturating_add(DriveWatchdog::STEP_US)));
            return None;
        };
        let tolerated = table.lost_exchanges_tolerated.unwrap_or(LOST_EXCHANGES_TOLERATED);
        let least_us = cycle_us.saturating_mul(tolerated.saturating_add(2));
        if table.drive_watchdog_us.is_some() && us < least_us {
            let reason =
                format!("it would stop the drives while {tolerated} lost exchanges are still tolerated");
            let problem = self.report(ProblemKind::Contradiction, KEY, reason);
            problem.value = Some(us.to_string());
            problem.limit = Some(format!("from {least_us}, two cycles more than are tolerated"));
        }
        Some(watchdog)
    }
}
