//! What SubDevices keep in registers, read in turn: error counters and the distance of the clock.

use std::time::Duration;

use omnibase_ethercat::DcConfig;
use omnibase_ethercat::cyclic::{AcyclicRequest, AcyclicWork, CyclicBus, RegisterAccess};
pub(super) use omnibase_ethercat::trouble::COUNTERS;
use omnibase_ethercat::wire::bytes::u32_at;
use omnibase_ethercat::wire::{HostTime, Link, register};

use super::{OTHERS, Supervisor, firmware};

/// Between two looks at registers of some SubDevice.
const LOOK_INTERVAL: Duration = Duration::from_millis(20);
/// From here on a counter of 8 bits is cleared, before it stands still at 255.
const FULL: u8 = 128;
/// A clock farther from the reference than this share of the SYNC0 cycle is astray: frames pass half a cycle away from
/// SYNC0, and a tenth of that distance is used up then.
const STRAY_SHARE: u32 = 20;
/// No bound is smaller: clocks count as locked up to here, ns.
const LOCKED_NS: u64 = 1000;

/// How far a clock may be from the reference, ns; `None` where nothing depends on it.
fn stray_bound_ns(dc: DcConfig) -> Option<u64> {
    match dc {
        DcConfig::Off => None,
        DcConfig::Sync0 { cycle_ns, .. } | DcConfig::Sync0And1 { cycle_ns, .. } => {
            Some(u64::from(cycle_ns / STRAY_SHARE).max(LOCKED_NS))
        }
    }
}

/// Where a clock is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum ClockDeviation {
    /// With the reference.
    #[default]
    Near,
    /// Too far at the last look.
    Suspect,
    /// Too far at two looks in a row.
    Astray,
}

/// What the supervisor reads of a SubDevice, in turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Look {
    Counters,
    Clear,
    Clock,
}

impl Supervisor {
    /// One register access to one SubDevice at a time.
    pub(super) fn look_at_registers<L: Link>(&mut self, bus: &mut CyclicBus<L>, now: HostTime) {
        while let Some(done) = bus.poll_completion() {
            if done.tag & OTHERS != 0 {
                // There are never more than have room.
                self.ended.push_back(done);
                continue;
            }
            let is_there = done.result.is_ok();
            match done.work {
                AcyclicWork::Registers { data, .. } if done.tag == firmware::TAG => {
                    self.looked_at_firmware(is_there, data, now);
                }
                AcyclicWork::Registers { data, .. } => {
                    if is_there {
                        self.looked(&data);
                    }
                    self.buffer = data;
                    self.look = None;
                }
                AcyclicWork::Mailbox(answer) => self.answered(is_there, answer),
            }
        }
        if self.look.is_some() || now < self.next_look || self.all.is_empty() {
            return;
        }
        self.next_look = now + LOOK_INTERVAL;
        let wanted = self.next;
        if wanted == Look::Counters {
            self.looking_at = (self.looking_at + 1) % self.all.len();
        }
        let one = &self.all[self.looking_at];
        self.next = match wanted {
            Look::Counters if one.subdevice.dc.is_some() => Look::Clock,
            _ => Look::Counters,
        };
        if one.is_away() {
            self.next = Look::Counters;
            return;
        }
        let (way, register, length) = match wanted {
            Look::Counters => (RegisterAccess::Read, register::RX_ERROR_COUNTERS, COUNTERS),
            Look::Clear => (RegisterAccess::Write, register::RX_ERROR_COUNTERS, COUNTERS),
            Look::Clock => (RegisterAccess::Read, register::DC_SYSTEM_TIME_DIFFERENCE, 4),
        };
        let mut data = std::mem::take(&mut self.buffer);
        data.clear();
        data.resize(length, 0);
        let work = AcyclicWork::Registers { way, register, data };
        let request = AcyclicRequest { tag: 0, position: one.subdevice.position, work };
        match bus.submit(request) {
            Ok(()) => self.look = Some(wanted),
            Err(AcyclicRequest { work: AcyclicWork::Registers { data, .. }, .. }) => self.buffer = data,
            Err(_) => {}
        }
    }

    fn looked(&mut self, data: &[u8]) {
        let number = self.looking_at;
        let one = &mut self.all[number];
        match self.look {
            Some(Look::Clear) => one.counters = [0; COUNTERS],
            Some(Look::Clock) if data.len() >= 4 => {
                let value = u32_at(data, 0);
                let magnitude = i64::from(value & 0x7FFF_FFFF);
                one.figures.clock_ns = if value >> 31 != 0 { -magnitude } else { magnitude };
                one.figures.worst_clock_ns = one.figures.worst_clock_ns.max(magnitude as u64);
                self.judge_clock(number);
            }
            Some(Look::Counters) if data.len() >= COUNTERS => self.count(number, data),
            _ => {}
        }
    }

    /// Whether the clock that was looked at is where it should be.
    fn judge_clock(&mut self, number: usize) {
        let one = &mut self.all[number];
        let position = one.subdevice.position;
        let Some(bound_ns) = stray_bound_ns(one.subdevice.config.dc) else { return };
        // What the reference compares itself with is the host's time of sending, which tells of the host.
        if self.reference == Some(position) {
            one.clock = ClockDeviation::Near;
            return;
        }
        let (clock_ns, before) = (one.figures.clock_ns, one.clock);
        let is_far = clock_ns.unsigned_abs() > bound_ns;
        one.clock = match before {
            ClockDeviation::Near if is_far => ClockDeviation::Suspect,
            ClockDeviation::Suspect if is_far => ClockDeviation::Astray,
            ClockDeviation::Astray if clock_ns.unsigned_abs() > bound_ns / 2 => ClockDeviation::Astray,
            _ => ClockDeviation::Near,
        };
        match (before, one.clock) {
            // It is looked at again at once.
            (_, ClockDeviation::Suspect) => self.next = Look::Clock,
            (ClockDeviation::Suspect, ClockDeviation::Astray) => {
                one.figures.clock_strays += 1;
                self.totals.clock_strays += 1;
                self.tell(
                    number,
                    format_args!("its clock is {clock_ns} ns from the reference, {bound_ns} ns are the most"),
                );
            }
            (ClockDeviation::Astray, ClockDeviation::Near) => {
                self.tell(number, format_args!("its clock is with the reference again: {clock_ns} ns"));
            }
            _ => {}
        }
    }

    /// What the counters grew by.
    fn count(&mut self, number: usize, data: &[u8]) {
        let one = &mut self.all[number];
        // One that is smaller than before was cleared by a restart.
        let grown: [u8; COUNTERS] = std::array::from_fn(|at| {
            let (now, before) = (data[at], one.counters[at]);
            if now >= before { now - before } else { now }
        });
        one.counters.copy_from_slice(&data[..COUNTERS]);
        if one.counters.iter().any(|counter| *counter >= FULL) {
            self.next = Look::Clear;
        }
        let (mut damaged, mut lost) = ([0u8; 4], [0u8; 4]);
        for port in 0..4 {
            damaged[port] = grown[2 * port];
            lost[port] = grown[16 + port];
            one.figures.crc_errors[port] += u64::from(grown[2 * port]);
            one.figures.receive_errors[port] += u64::from(grown[2 * port + 1]);
            one.figures.forwarded_errors[port] += u64::from(grown[8 + port]);
            one.figures.link_losses[port] += u64::from(grown[16 + port]);
        }
        for port in 0..4 {
            self.totals.crc_errors += u64::from(damaged[port]);
            self.totals.link_losses += u64::from(lost[port]);
            if damaged[port] > 0 {
                self.tell(number, format_args!("{} damaged frames arrived at port {port}", damaged[port]));
            }
            if lost[port] > 0 {
                self.tell(number, format_args!("the link at port {port} was lost {} times", lost[port]));
            }
        }
    }
}
