//! A device's modes of distributed clocks: in words, and as the key `dc` of a robot's file.

use crate::robot_table::RobotTable;
use omnibase_esi::Device;
use omnibase_esi::model::{DcMode, SyncTimes};
use omnibase_ethercat::DcConfig;

/// The mode that the device is given, and the others beside it.
pub fn modes(device: &Device, is_drive: bool, table: &mut RobotTable) {
    // The first is the one by default; a robot's drives beat with SYNC0 where they can.
    let given = device.dc_modes.iter().position(|mode| !is_drive || has_sync0(mode));
    for (number, mode) in device.dc_modes.iter().enumerate() {
        let words = synchronisation(mode);
        if mode.is_unclear || !has_sync0(mode) {
            table.comment(&format!("Synchronisation: {words}."));
            continue;
        }
        match keys(mode, is_drive) {
            Err(why) => table.comment(&format!("LOOK AT THIS: {words}: {why}.")),
            Ok(keys) if given == Some(number) => table.line(&keys, &words),
            Ok(keys) => table.line(&format!("# {keys}"), &format!("or {words}")),
        }
        let shift_us = mode.sync0.shift_ns as f64 * 1e-3;
        if shift_us != 0.0 {
            let whose = if is_drive { "which all drives have" } else { "or the device's own in `dc`" };
            let in_which = if given == Some(number) { "Its" } else { "In that mode its" };
            table.comment(&format!(
                "{in_which} maker shifts SYNC0 by {shift_us} us: add that to `bus.sync0_shift_us`, {whose}."
            ));
        }
    }
}

fn has_sync0(mode: &DcMode) -> bool {
    mode.assign_activate & DcConfig::SYNC0 == DcConfig::SYNC0
}

/// A mode with SYNC0 as the key `dc`, or why that can't say it.
fn keys(mode: &DcMode, is_drive: bool) -> Result<String, String> {
    let mut values = vec![format!("assign_activate = \"0x{:04X}\"", mode.assign_activate)];
    // Factors below 0 divide the bus' cycle, others multiply it (SYNC0) or SYNC0's (SYNC1).
    let per_cycle = match (mode.sync0.cycle_ns, mode.sync0.factor.unwrap_or(1)) {
        (0, -1..=1) => 1,
        (0, factor) if factor < 0 => factor.unsigned_abs(),
        (0, factor) if is_drive => {
            return Err(format!("a drive's SYNC0 comes in every cycle, not in one of {factor}"));
        }
        (0, factor) => return Err(format!("`every = {factor}` gives its data and its SYNC0 that cycle")),
        (cycle_ns, _) => return Err(format!("a SYNC0 each {cycle_ns} ns, whatever the bus' cycle is")),
    };
    if per_cycle > 1 {
        values.push(format!("sync0_per_cycle = {per_cycle}"));
    }
    if mode.assign_activate & DcConfig::SYNC1 == 0 {
        return Ok(format!("dc = {{ {} }}", values.join(", ")));
    }
    let every = match (mode.sync1.cycle_ns, mode.sync1.factor.unwrap_or(1)) {
        (0, factor @ 0..) => factor.max(1).unsigned_abs(),
        (0, factor) if per_cycle.is_multiple_of(factor.unsigned_abs()) => per_cycle / factor.unsigned_abs(),
        (0, factor) => {
            return Err(format!("SYNC1 can't come {} times in a cycle with {per_cycle} SYNC0", -factor));
        }
        (cycle_ns, _) => return Err(format!("a SYNC1 each {cycle_ns} ns, whatever the bus' cycle is")),
    };
    if every > 1 {
        values.push(format!("sync1_every = {every}"));
    }
    match mode.sync1.shift_ns {
        0 => {}
        shift if shift > 0 && shift % 1000 == 0 => values.push(format!("sync1_shift_us = {}", shift / 1000)),
        shift => return Err(format!("SYNC1 comes whole us behind a SYNC0, not {shift} ns")),
    }
    Ok(format!("dc = {{ {} }}", values.join(", ")))
}

/// A mode of synchronisation in words, and what follows for `[bus]`.
pub fn synchronisation(mode: &DcMode) -> String {
    let name = if mode.name.is_empty() { mode.description.english() } else { &mode.name };
    if mode.is_unclear {
        return format!("\"{name}\" has a number that can't be read: LOOK AT THIS in the maker's file");
    }
    let sync = |times: &SyncTimes, of: &str| {
        let cycle = match (times.cycle_ns, times.factor) {
            (0, Some(factor)) if factor < 0 => format!("{of} / {}", -factor),
            // As `keys` takes it.
            (0, Some(0)) => format!("{of} x 1 (its factor is 0)"),
            (0, factor) => format!("{of} x {}", factor.unwrap_or(1)),
            (cycle, _) => format!("{cycle} ns"),
        };
        format!("cycle {cycle}, shift {} ns", times.shift_ns)
    };
    let activate = mode.assign_activate;
    match (has_sync0(mode), activate & DcConfig::SYNC1 != 0) {
        (false, _) => format!("\"{name}\" without SYNC (AssignActivate 0x{activate:04X})"),
        (true, false) => {
            format!(
                "\"{name}\" with SYNC0 (AssignActivate 0x{activate:04X}): {}; `bus.synchronisation = \"sync0\"`",
                sync(&mode.sync0, "bus cycle")
            )
        }
        (true, true) => format!(
            "\"{name}\" with SYNC0 and SYNC1 (AssignActivate 0x{activate:04X}): SYNC0 {}, SYNC1 {}",
            sync(&mode.sync0, "bus cycle"),
            sync(
                &mode.sync1,
                if mode.sync1.factor.is_some_and(|factor| factor < 0) { "bus cycle" } else { "SYNC0" }
            )
        ),
    }
}
