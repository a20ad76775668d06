//! A SubDevice's events of distributed clocks.

use omnibase_ethercat::DcConfig;

use super::Check;
use super::bus::cycle_us;
use super::subdevices::identity_number;
use crate::config::*;

/// What beats in the cycle of a SubDevice.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Beat {
    /// A drive's: with all others, in every cycle, unless the bus has no SYNC0.
    Drive,
    /// None but what its table asks for, in each n-th cycle.
    Every(u16),
}

/// The events; `None` inside where it has none, outside where it can't have them so. `setting` is the table's name.
pub(super) fn resolve(
    check: &mut Check,
    bus: &BusTable,
    setting: &str,
    table: Option<&DcTable>,
    beat: Beat,
) -> Option<Option<DcPlan>> {
    let cycle_us = cycle_us(bus);
    let shift_us = bus.sync0_shift_us.unwrap_or(cycle_us as i32 / 2);
    let is_synchronised = bus.synchronisation.unwrap_or(Synchronisation::Sync0) == Synchronisation::Sync0;
    let by_default = DcPlan::sync0(shift_us.saturating_mul(1000));
    let Some(table) = table else {
        return Some((is_synchronised && beat == Beat::Drive).then_some(by_default));
    };
    if !is_synchronised {
        let reason = "cycles follow the clock of the bus only with `bus.synchronisation = \"sync0\"`";
        check.report(ProblemKind::Contradiction, setting, reason);
        return None;
    }
    let mut refuse = |key: &str, reason: &str, value: String, limit: String| -> Option<Option<DcPlan>> {
        let problem = check.report(ProblemKind::OutOfRange, &format!("{setting}.{key}"), reason);
        (problem.value, problem.limit) = (Some(value), Some(limit));
        None
    };
    let every = if let Beat::Every(every) = beat { every } else { 1 };
    let own_cycle_ns = u64::from(cycle_us) * 1000 * u64::from(every);
    let per_cycle = table.sync0_per_cycle.unwrap_or(1);
    if !own_cycle_ns.is_multiple_of(u64::from(per_cycle)) {
        let limit = format!("a divisor of its cycle of {own_cycle_ns} ns");
        return refuse("sync0_per_cycle", "SYNC0s come at whole ns", per_cycle.to_string(), limit);
    }
    if let Some(own) = table.sync0_shift_us {
        if beat == Beat::Drive {
            let reason = "drives act together: `bus.sync0_shift_us` is for all of them";
            return refuse("sync0_shift_us", reason, own.to_string(), format!("{shift_us}, or no such key"));
        }
        if own.unsigned_abs() >= cycle_us {
            let limit = format!("below cycle_us = {cycle_us}");
            return refuse("sync0_shift_us", "it is a place in the cycle", own.to_string(), limit);
        }
    }
    let sync0_us = own_cycle_ns / u64::from(per_cycle) / 1000;
    let sync1_every = table.sync1_every.unwrap_or(1);
    if !sync1_every.is_multiple_of(per_cycle) && !per_cycle.is_multiple_of(sync1_every) {
        let limit = format!("a multiple or a divisor of sync0_per_cycle = {per_cycle}");
        let reason = "SYNC1 would wander through the cycle";
        return refuse("sync1_every", reason, sync1_every.to_string(), limit);
    }
    let sync1_shift_us = table.sync1_shift_us.unwrap_or(0);
    if u64::from(sync1_shift_us) >= sync0_us {
        let limit = format!("below {sync0_us}, from one SYNC0 to the next");
        let reason = "SYNC1 comes between two SYNC0s";
        return refuse("sync1_shift_us", reason, sync1_shift_us.to_string(), limit);
    }
    // Registers of 32 bits hold both.
    let most_us = u64::from(u32::MAX) / 1000;
    let sync1_us = u64::from(sync1_every - 1) * sync0_us + u64::from(sync1_shift_us);
    if sync1_us > most_us {
        let limit = format!("at most {}", (most_us - u64::from(sync1_shift_us)) / sync0_us + 1);
        let reason = "SYNC1 comes 4.29 s behind a SYNC0 at most";
        return refuse("sync1_every", reason, sync1_every.to_string(), limit);
    }
    Some(Some(DcPlan {
        assign_activate: assign_activate(check, setting, table)?,
        sync0_per_cycle: per_cycle,
        sync0_shift_ns: table.sync0_shift_us.unwrap_or(shift_us).saturating_mul(1000),
        sync1_every,
        sync1_shift_ns: sync1_shift_us * 1000,
    }))
}

/// What turns the events on; `None` where it turns on others than its table asks for.
fn assign_activate(check: &mut Check, setting: &str, table: &DcTable) -> Option<u16> {
    let setting = format!("{setting}.assign_activate");
    let wanted = match &table.assign_activate {
        Some(text) => identity_number(check, &setting, text)?,
        None => DcConfig::SYNC0.into(),
    };
    let word = wanted as u16;
    let wants_sync1 = table.sync1_every.is_some() || table.sync1_shift_us.is_some();
    let reason = if u16::try_from(wanted).is_err() {
        "it is a word of 16 bits"
    } else if word & DcConfig::SYNC0 != DcConfig::SYNC0 {
        "it turns no SYNC0 on; leave the table out where none is wanted"
    } else if word & 1 != 0 {
        "it gives the SYNC unit to the device itself, and its times are written by the bus"
    } else if wants_sync1 && !(DcPlan { assign_activate: word, ..DcPlan::sync0(0) }).has_sync1() {
        "it turns SYNC1 off, and its times are given"
    } else {
        return Some(word);
    };
    let value = format!("\"0x{wanted:04X}\"");
    let limit = "bits 8 and 9 (SYNC0), bit 10 with SYNC1, bit 0 clear, such as \"0x0300\" or \"0x0700\"";
    let problem = check.report(ProblemKind::OutOfRange, &setting, reason);
    (problem.value, problem.limit) = (Some(value), Some(limit.to_owned()));
    None
}
