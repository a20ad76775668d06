//! A SubDevice's events of distributed clocks, resolved.

use omnibase_ethercat::config::{DcConfig, SyncMode, Timeouts};
use std::time::Duration;

use super::start_tables::TimeoutsTable;

/// Events of a SubDevice's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DcPlan {
    /// What the registers 0x0980 (low byte) and 0x0981 are told.
    pub assign_activate: u16,
    /// SYNC0s in each of its cycles.
    pub sync0_per_cycle: u16,
    /// When in the cycle SYNC0 comes, ns.
    pub sync0_shift_ns: i32,
    /// SYNC1, where it is on, comes with each n-th SYNC0.
    pub sync1_every: u16,
    /// So long behind it, ns.
    pub sync1_shift_ns: u32,
}

impl DcPlan {
    /// A SYNC0 in each cycle.
    pub fn sync0(shift_ns: i32) -> Self {
        DcPlan {
            assign_activate: DcConfig::SYNC0,
            sync0_per_cycle: 1,
            sync0_shift_ns: shift_ns,
            sync1_every: 1,
            sync1_shift_ns: 0,
        }
    }

    /// Whether SYNC1 is on.
    pub fn has_sync1(&self) -> bool {
        self.assign_activate & DcConfig::SYNC1 != 0
    }

    /// How long before a frame its application beat last, ns: by SYNC1 where this is on, else by SYNC0. `cycle_ns` is its own cycle,
    /// `frame_ns` where in it frames pass; a beat at that very instant is too late for them.
    pub(crate) fn last_beat_ns(&self, cycle_ns: u64, frame_ns: i64) -> u64 {
        let sync0_ns = cycle_ns / u64::from(self.sync0_per_cycle.max(1));
        let (interval_ns, behind_ns) = match self.has_sync1() {
            true => (sync0_ns * u64::from(self.sync1_every.max(1)), i64::from(self.sync1_shift_ns)),
            false => (sync0_ns, 0),
        };
        let interval_ns = interval_ns.max(1) as i64;
        let since_ns = (frame_ns - i64::from(self.sync0_shift_ns) - behind_ns).rem_euclid(interval_ns);
        (if since_ns == 0 { interval_ns } else { since_ns }) as u64
    }

    /// What the bus is asked for, where the SubDevice's cycle has this length.
    pub(super) fn config(&self, cycle_ns: u64) -> DcConfig {
        let period_ns = u32::try_from(cycle_ns).unwrap_or(u32::MAX);
        let (cycle_ns, shift_ns) = (period_ns / u32::from(self.sync0_per_cycle.max(1)), self.sync0_shift_ns);
        if !self.has_sync1() {
            return DcConfig::Sync0 { cycle_ns, shift_ns };
        }
        // It is counted from the first SYNC0 behind the SYNC1 before.
        let skipped_ns = cycle_ns.saturating_mul(u32::from(self.sync1_every.saturating_sub(1)));
        let sync1_cycle_ns = skipped_ns.saturating_add(self.sync1_shift_ns);
        DcConfig::Sync0And1 { cycle_ns, shift_ns, sync1_cycle_ns }
    }

    /// What 0x1C32 and 0x1C33 are told; a device with SYNC1 has a choice of its own.
    pub(super) fn sync_mode(&self) -> Option<SyncMode> {
        (!self.has_sync1()).then_some(SyncMode::Sync0)
    }
}

impl From<&TimeoutsTable> for Timeouts {
    fn from(table: &TimeoutsTable) -> Self {
        let time = |ms: Option<u32>| ms.map(|ms| Duration::from_millis(ms.into()));
        Timeouts {
            init: time(table.init_ms),
            pre_op: time(table.pre_op_ms),
            safe_op_op: time(table.safe_op_op_ms),
            mailbox: time(table.mailbox_ms),
        }
    }
}
