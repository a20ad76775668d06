//! SubDevices whose process data go in each n-th cycle only.

use omnibase_ethercat::config::Every;

use super::Check;
use super::bus::{DRIVE_WATCHDOG_US, cycle_us};
use crate::config::*;

/// Values that come less often are no process data, us.
const MOST_US: u64 = 500_000;

/// In which cycles the data of a SubDevice go; `None` where it can't be so slow.
pub(super) fn resolve(
    check: &mut Check,
    file: &RobotFile,
    setting: &str,
    own: &DeviceTable,
    is_written: bool,
) -> Option<Every> {
    let n = own.every.unwrap_or(1);
    let every = Every::nth(n)?;
    if n == 1 {
        return Some(every);
    }
    let safety = &file.safety;
    let cycle_us = u64::from(cycle_us(&file.bus));
    let watchdog_us = u64::from(safety.drive_watchdog_us.unwrap_or(DRIVE_WATCHDOG_US));
    // Behind a lost frame two of its periods pass, and the next frame may be late by a cycle.
    let by_watchdog = (watchdog_us / cycle_us).saturating_sub(1) / 2;
    let by_age = MOST_US / cycle_us;
    let of_it = |input: &&Option<String>| {
        let device = input.as_ref().and_then(|input| input.split_once('.')).map(|(device, _)| device);
        device.is_some() && device == own.name.as_deref()
    };
    let stops = [&safety.enable_input, &safety.stop_input, &safety.gyro_input].iter().any(of_it);
    let (kind, most, reason) = if own.axis.is_some() {
        (ProblemKind::Contradiction, 1, "it is a drive, and drives are told where to go in every cycle")
    } else if stops {
        (ProblemKind::Contradiction, 1, "[safety] stops by an input of it, which is heard in every cycle")
    } else if is_written && u64::from(n) > by_watchdog {
        (
            ProblemKind::Contradiction,
            by_watchdog,
            "one lost frame and its watchdog bites (safety.drive_watchdog_us)",
        )
    } else if u64::from(n) > by_age {
        (ProblemKind::OutOfRange, by_age, "it would be heard less often than every half second")
    } else {
        return Some(every);
    };
    let problem = check.report(kind, setting, reason);
    problem.value = Some(n.to_string());
    problem.limit = Some(if most <= 1 { "1".into() } else { format!("1 to {most}") });
    None
}
