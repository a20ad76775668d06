//! The distributed-clock unit: local clock, system time, drift control and SYNC generator together.

use super::clock::{DriftControl, LocalClock};
use super::sync::{Pulses, SyncUnit, TimeWidth};
use super::{Esc, EscConfig};
use omnibase_ethercat_wire::bytes::{put_u16, put_u32, put_u64, u16_at, u32_at, u64_at};
use omnibase_ethercat_wire::register::{self as reg, al_event};

/// Start of the unit's registers, and of each group in them.
const TIMES: usize = reg::DC_RECEIVE_TIMES as usize;
const SYSTEM_TIME: usize = reg::DC_SYSTEM_TIME as usize;
const UNIT_TIME: usize = reg::DC_RECEIVE_TIME_UNIT as usize;
const OFFSET: usize = reg::DC_SYSTEM_TIME_OFFSET as usize;
const DELAY: usize = reg::DC_SYSTEM_TIME_DELAY as usize;
const DIFFERENCE: usize = reg::DC_SYSTEM_TIME_DIFFERENCE as usize;
const SPEED: usize = reg::DC_SPEED_COUNTER_START as usize;
const SPEED_DIFFERENCE: usize = reg::DC_SPEED_COUNTER_DIFFERENCE as usize;
const FILTERS: usize = reg::DC_FILTER_DEPTHS as usize;
const ACTIVATION: usize = reg::DC_ACTIVATION as usize;
const STATUS: usize = reg::DC_ACTIVATION_STATUS as usize;
const SYNC_STATUS: usize = reg::DC_SYNC0_STATUS as usize;
const START: usize = reg::DC_START_TIME as usize;
const NEXT_SYNC1: usize = reg::DC_NEXT_SYNC1 as usize;
const CYCLES: usize = reg::DC_SYNC0_CYCLE as usize;

/// The unit's state.
#[derive(Debug)]
pub struct DcUnit {
    clock: LocalClock,
    drift: DriftControl,
    sync: SyncUnit,
    offset: u64,
    delay: u32,
    width: TimeWidth,
    /// Host time of the next pulse.
    next_pulse: Option<u64>,
}

impl DcUnit {
    /// A unit that gets power at host time `now`.
    pub fn new(config: &EscConfig, now: u64) -> Self {
        let width = if config.has(reg::FEATURE_DC_64) { TimeWidth::Bits64 } else { TimeWidth::Bits32 };
        DcUnit {
            clock: LocalClock::new(now, config.dc_offset_ns, config.dc_drift_ppm),
            drift: DriftControl::default(),
            sync: SyncUnit::default(),
            offset: 0,
            delay: 0,
            width,
            next_pulse: None,
        }
    }

    /// System time at host time `now`, ns.
    pub fn system_time(&self, now: u64) -> u64 {
        self.clock.at(now).wrapping_add(self.offset)
    }

    /// Host time of the next SYNC pulse.
    pub fn next_pulse(&self) -> Option<u64> {
        self.next_pulse
    }

    fn schedule(&mut self, now: u64) {
        self.next_pulse = self.sync.next().map(|next| {
            let ahead = next.saturating_sub(self.system_time(now));
            self.clock.host_after(now, ahead)
        });
    }

    /// A system time arrived from the reference clock.
    fn compare(&mut self, received: u32, now: u64) {
        let own = (self.system_time(now) as u32).wrapping_sub(self.delay);
        self.drift.compare(own.wrapping_sub(received) as i32, &mut self.clock, now);
        if self.next_pulse.is_some() {
            self.schedule(now);
        }
    }
}

impl Esc {
    /// Fires SYNC pulses that are due at host time `now`.
    pub(super) fn run_sync(&mut self, now: u64) {
        let Some(dc) = &mut self.dc else { return };
        let system_time = dc.system_time(now);
        let mut events = 0;
        while let Some(pulses) = dc.sync.fire(system_time) {
            if pulses.sync0 {
                events |= al_event::SYNC0;
            }
            if pulses.sync1 {
                events |= al_event::SYNC1;
            }
        }
        dc.schedule(now);
        if events & al_event::SYNC0 != 0 {
            self.memory[SYNC_STATUS] = 1;
        }
        if events & al_event::SYNC1 != 0 {
            self.memory[SYNC_STATUS + 1] = 1;
        }
        if events != 0 {
            self.raise(events);
        }
    }

    /// Brings registers that change by themselves up to host time `now`, as far as `start..end` shows them.
    pub(super) fn refresh_dc(&mut self, start: usize, end: usize, now: u64) {
        let Some(dc) = &self.dc else { return };
        if start < SYSTEM_TIME + 8 && end > SYSTEM_TIME {
            put_u64(&mut self.memory, SYSTEM_TIME, dc.system_time(now));
        }
        if end > DIFFERENCE && start < FILTERS {
            put_u32(&mut self.memory, DIFFERENCE, dc.drift.difference_register());
            put_u16(&mut self.memory, SPEED_DIFFERENCE, dc.drift.speed_difference_register());
        }
        if end > STATUS {
            self.memory[STATUS] = dc.sync.status();
            if dc.sync.running() {
                put_u64(&mut self.memory, START, dc.sync.next0().unwrap_or(0));
                put_u64(&mut self.memory, NEXT_SYNC1, dc.sync.next1().unwrap_or(0));
            }
        }
    }

    /// Register values after power-on.
    pub(super) fn show_dc_registers(&mut self) {
        let Some(dc) = &self.dc else { return };
        put_u16(&mut self.memory, SPEED, dc.drift.speed_counter_start());
        self.memory[FILTERS] = super::clock::DIFFERENCE_FILTER_DEFAULT;
        self.memory[FILTERS + 1] = 12;
    }

    /// A write from `start` on into the unit's registers that the access map allows at least in part.
    /// Returns whether any byte was written.
    pub(super) fn write_dc(
        &mut self,
        start: usize,
        data: &[u8],
        side: super::sync_manager::Side,
        now: u64,
    ) -> bool {
        let end = start + data.len();
        let touches = |first: usize, length: usize| start < first + length && end > first;
        let Some(dc) = &mut self.dc else { return false };
        let mut written = false;
        if side == super::sync_manager::Side::Ecat {
            if touches(TIMES, 1) {
                for (port, arrival) in self.port_arrivals.iter().enumerate() {
                    let Some(arrival) = arrival else { continue };
                    let time = dc.clock.at(now.saturating_add_signed(*arrival));
                    put_u32(&mut self.memory, TIMES + 4 * port, time as u32);
                }
                put_u64(&mut self.memory, UNIT_TIME, dc.clock.at(now));
                written = true;
            }
            if touches(SYSTEM_TIME, 8) && self.config.has_system_time() {
                written = true;
                if start <= SYSTEM_TIME && end >= SYSTEM_TIME + 4 {
                    dc.compare(u32_at(data, SYSTEM_TIME - start), now);
                }
            }
        }
        // A system time is computed when it is read: there is nothing to store.
        if start >= SYSTEM_TIME && end <= SYSTEM_TIME + 8 {
            return written;
        }
        // Everything else is stored where this side may, and taken over from there.
        let running = dc.sync.running();
        let locked =
            |at: usize| (START..START + 8).contains(&at) && running || (TIMES..UNIT_TIME + 8).contains(&at);
        written |= self.store(side, start, data, locked);
        if written {
            self.take_dc_registers(start, end, now);
        }
        written
    }

    /// Takes over registers in `start..end` that were written.
    fn take_dc_registers(&mut self, start: usize, end: usize, now: u64) {
        let touches = |first: usize, length: usize| start < first + length && end > first;
        let Some(dc) = &mut self.dc else { return };
        if touches(OFFSET, 8) {
            dc.offset = u64_at(&self.memory, OFFSET);
            let system_time = dc.system_time(now);
            dc.sync.step(system_time, dc.width);
            dc.schedule(now);
        }
        if touches(DELAY, 4) {
            dc.delay = u32_at(&self.memory, DELAY);
        }
        if touches(FILTERS, 1) {
            dc.drift.set_difference_depth(self.memory[FILTERS]);
        }
        if touches(SPEED, 2) {
            dc.drift.reset(u16_at(&self.memory, SPEED), &mut dc.clock, now);
            put_u16(&mut self.memory, SPEED, dc.drift.speed_counter_start());
            dc.schedule(now);
        }
        if touches(CYCLES, 8) {
            dc.sync.set_cycles(u32_at(&self.memory, CYCLES), u32_at(&self.memory, CYCLES + 4));
        }
        if touches(ACTIVATION, 1) {
            let activation = self.memory[ACTIVATION];
            if activation & 1 != 0 {
                let outputs = Pulses { sync0: activation & 2 != 0, sync1: activation & 4 != 0 };
                let system_time = dc.system_time(now);
                dc.sync.activate(outputs, u64_at(&self.memory, START), system_time, dc.width);
            } else {
                dc.sync.stop();
            }
            dc.schedule(now);
        }
    }
}
