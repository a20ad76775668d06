//! The start-up list of one SubDevice in parts that a way back runs one after the other.

use alloc::vec::Vec;

use super::super::sync::Sync0;
use super::SEARCH;
use crate::config::DcConfig;
use crate::start_up::{Refusal, StartUpStep};
use crate::subdevice::{DcWidth, SubDevice};
use crate::wire::{AlState, register};

fn registers(what: &'static str, register: u16, data: &[u8], refusal: Refusal) -> StartUpStep {
    StartUpStep::Registers { register, data: data.to_vec(), what, refusal }
}

/// To INIT and everything off: what is switched on can't be written, and the list switches on what it needs.
pub(super) fn clearing(set_up: &[StartUpStep]) -> Vec<StartUpStep> {
    let off = |what, register, data: &[u8]| registers(what, register, data, Refusal::IsTolerated);
    let mut steps = Vec::from([
        StartUpStep::State { state: AlState::Init, timeout: SEARCH },
        off("SYNC off", register::DC_ACTIVATION, &[0]),
        off("taking the EEPROM", register::SII_CONFIG, &[2]),
        off("taking the EEPROM", register::SII_CONFIG, &[0]),
    ]);
    let managers = set_up.iter().filter_map(|step| match step {
        StartUpStep::Registers { register, data, .. } if (0x0800..0x0880).contains(register) => {
            Some((*register, data.len() as u16 / register::SM_SIZE))
        }
        _ => None,
    });
    for (first, count) in managers {
        for number in 0..count {
            steps.push(off("a SyncManager off", first + number * register::SM_SIZE + 6, &[0]));
        }
    }
    steps
}

/// Setting its clock, where the list does.
pub(super) fn setting_clock(steps: &[StartUpStep]) -> Vec<StartUpStep> {
    // Writing the speed counter's start makes the control loop forget what it was told before.
    let loop_anew = registers(
        "the clock's control loop",
        register::DC_SPEED_COUNTER_START,
        &crate::clock_setup::SPEED_COUNTER_START.to_le_bytes(),
        Refusal::IsTolerated,
    );
    let mut clock: Vec<_> = steps.iter().filter(|step| is_clock(step)).cloned().collect();
    if !clock.is_empty() {
        clock.insert(0, loop_anew.clone());
        // Once more behind the offset: what came between was told to a clock with another time.
        clock.push(loop_anew);
    }
    clock
}

pub(super) fn is_clock(step: &StartUpStep) -> bool {
    matches!(step, StartUpStep::ClockOffset { .. })
}

/// SYNC0 (and SYNC1) on; the start time, last but one, is still to be filled in.
pub(super) fn arming(subdevice: &SubDevice) -> Vec<StartUpStep> {
    let config = &subdevice.config;
    let Some(Sync0 { cycle_ns, .. }) = Sync0::of(config.dc) else { return Vec::new() };
    let must = |what, register, data: &[u8]| registers(what, register, data, Refusal::IsError);
    let mut steps = Vec::from([must("SYNC off", register::DC_ACTIVATION, &[0])]);
    let [control, activation] = config.assign_activate().to_le_bytes();
    let refusal = Refusal::IsTolerated;
    steps.push(registers("the SYNC unit", register::DC_CYCLIC_CONTROL, &[control], refusal));
    steps.push(must("the SYNC0 cycle", register::DC_SYNC0_CYCLE, &cycle_ns.to_le_bytes()));
    if let DcConfig::Sync0And1 { sync1_cycle_ns, .. } = config.dc {
        steps.push(must("the SYNC1 cycle", register::DC_SYNC1_CYCLE, &sync1_cycle_ns.to_le_bytes()));
    }
    let is_short = subdevice.dc.is_some_and(|dc| dc.width == DcWidth::Bits32);
    let length = if is_short { 4 } else { 8 };
    steps.push(must("the start time", register::DC_START_TIME, &[0; 8][..length]));
    steps.push(must("SYNC on", register::DC_ACTIVATION, &[activation]));
    steps
}
