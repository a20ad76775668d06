//! Distributed clocks: propagation delays over any tree, and one common time.
//!
//! One broadcast write latches, in each clock, the local times at which that frame passed its ports. From
//! differences of times of one and the same clock follow the delays (ETG.1000.4, "Distributed clocks").

use alloc::vec::Vec;
use core::time::Duration;

use crate::bus::Bus;
use crate::error::{DcError, SetUpError};
use crate::start_up::{Refusal, StartUpStep};
use crate::subdevice::{DcClock, DcWidth, Parent, Port, SubDevice};
use crate::topology::{self, BRANCH_LIMIT_NS};
use crate::transaction::{Access, Expect};
use crate::wire::bytes::{u32_at, u64_at};
use crate::wire::{Clock, Link, register};

/// How far a branch may seem shorter than what is in it: the granularity of the latches.
const TOLERANCE_NS: u32 = 400;
/// Filter depths (0x0934): speed counter 12, system time difference 0.
pub(crate) const FILTERS: u16 = 0x0C00;
/// Speed counter start (0x0930), its value after reset; writing it starts the control loop anew.
pub(crate) const SPEED_COUNTER_START: u16 = 0x1000;

/// What the delays are computed from, for one SubDevice.
#[derive(Clone, Copy, Debug)]
pub struct Latched {
    /// Its ports.
    pub ports: [Port; 4],
    /// Where it hangs.
    pub parent: Option<Parent>,
    /// Receive times of ports 0 to 3, where it has a clock.
    pub times_ns: Option<[u32; 4]>,
}

impl Latched {
    /// Time from the frame's first arrival until it was back at `port`.
    fn since_entry(&self, times_ns: [u32; 4], port: u8) -> u32 {
        let entry = topology::entry_port(&self.ports);
        times_ns[usize::from(port)].wrapping_sub(times_ns[usize::from(entry)])
    }

    /// When the frame left by `port` and when it came back, since its arrival.
    fn branch(&self, times_ns: [u32; 4], port: u8) -> (u32, u32) {
        let before = topology::exit_ports(&self.ports).take_while(|&exit| exit != port).last();
        let left = before.map_or(0, |before| self.since_entry(times_ns, before));
        (left, self.since_entry(times_ns, port))
    }

    /// Time that the frame spent in this SubDevice and all behind it.
    fn inside(&self, times_ns: [u32; 4]) -> u32 {
        topology::exit_ports(&self.ports).last().map_or(0, |last| self.since_entry(times_ns, last))
    }
}

/// Propagation delays from the first clock to each, ns; `None` for SubDevices without a clock.
///
/// SubDevices without a clock count as cable. Where several clocks hang behind one such, the cable's time is
/// shared evenly among them: only the sum can be measured.
pub fn delays(segment: &[Latched]) -> Result<Vec<Option<u32>>, DcError> {
    let mut delays: Vec<Option<u32>> = Vec::with_capacity(segment.len());
    delays.resize(segment.len(), None);
    let above: Vec<_> = (0..segment.len()).map(|number| clock_above(segment, number)).collect();
    // When a clock without another one above it sees the frame, counted from the first clock.
    let mut root = 0u32;
    for (number, one) in segment.iter().enumerate() {
        let Some(times_ns) = one.times_ns else { continue };
        if above[number].is_none() {
            delays[number] = Some(root);
            root = root.saturating_add(one.inside(times_ns));
        }
        let Some(own) = delays[number] else { continue };
        for port in topology::exit_ports(&one.ports) {
            let below: Vec<(usize, u32)> = (number + 1..segment.len())
                .filter(|&other| above[other] == Some((number, port)))
                .filter_map(|other| {
                    segment[other].times_ns.map(|times| (other, segment[other].inside(times)))
                })
                .collect();
            let position = number as u16;
            let (left, back) = one.branch(times_ns, port);
            let found_ns = back.wrapping_sub(left);
            if found_ns > BRANCH_LIMIT_NS {
                let limit_ns = BRANCH_LIMIT_NS;
                return Err(DcError::BranchTooLong { position, port, found_ns, limit_ns });
            }
            let inside_ns = below.iter().fold(0u32, |sum, (_, inside)| sum.saturating_add(*inside));
            if inside_ns > found_ns.saturating_add(TOLERANCE_NS) {
                return Err(DcError::BranchTooShort { position, port, found_ns, inside_ns });
            }
            let cable = found_ns.saturating_sub(inside_ns) / (2 * below.len().max(1) as u32);
            let mut passed = left;
            for (other, inside) in below {
                passed = passed.saturating_add(cable);
                delays[other] = Some(own.saturating_add(passed));
                passed = passed.saturating_add(inside).saturating_add(cable);
            }
        }
    }
    Ok(delays)
}

/// The next clock on the way to the MainDevice, and its port that leads here.
fn clock_above(segment: &[Latched], mut number: usize) -> Option<(usize, u8)> {
    // A tree's parents come before their children, so this ends.
    while let Some(parent) = segment[number].parent {
        let above = usize::from(parent.position);
        if above >= number {
            return None;
        }
        if segment[above].times_ns.is_some() {
            return Some((above, parent.port));
        }
        number = above;
    }
    None
}

/// Time of a frame in all branches that hang at clocks without another one above: all of the segment but the cable to
/// its first clock, and what is before that.
fn propagation(segment: &[Latched]) -> Duration {
    let topmost = (0..segment.len()).filter(|number| clock_above(segment, *number).is_none());
    let inside = topmost.filter_map(|number| Some(segment[number].inside(segment[number].times_ns?)));
    Duration::from_nanos(inside.map(u64::from).sum())
}

/// The steps that set one SubDevice's clock again after it lost power.
pub fn steps(clock: &DcClock) -> Vec<StartUpStep> {
    let registers = |what, register, data: &[u8]| StartUpStep::Registers {
        register,
        data: data.to_vec(),
        what,
        refusal: Refusal::IsError,
    };
    let delay_ns = clock.delay_ns;
    Vec::from([
        registers("the clock's filters", register::DC_FILTER_DEPTHS, &FILTERS.to_le_bytes()),
        registers("the clock's delay", register::DC_SYSTEM_TIME_DELAY, &delay_ns.to_le_bytes()),
        StartUpStep::ClockOffset { delay_ns },
        registers(
            "the clock's control",
            register::DC_SPEED_COUNTER_START,
            &SPEED_COUNTER_START.to_le_bytes(),
        ),
    ])
}

/// The broadcast write that lets each of so many clocks keep the times at which it passes their ports.
pub(crate) fn latch(clocks: usize) -> Access {
    let expect = Expect::AtLeast(clocks as u16);
    Access::broadcast_write("latching the receive times", register::DC_RECEIVE_TIMES, &[0; 4], expect)
}

impl<L: Link, C: Clock> Bus<L, C> {
    /// Measures all delays and sets all clocks to the host's time, so that they run together from here on.
    ///
    /// The reference clock is the first SubDevice that has one. Nothing happens where none has.
    pub(crate) fn set_clocks(&mut self) -> Result<(), SetUpError> {
        let with_clock: Vec<usize> =
            (0..self.subdevices.len()).filter(|&n| self.subdevices[n].dc.is_some()).collect();
        if with_clock.is_empty() {
            return Ok(());
        }
        self.transactor.perform_one(latch(with_clock.len()))?;
        let now = self.transactor.clock.now();
        let mut reads = Vec::with_capacity(2 * with_clock.len());
        for &number in &with_clock {
            let target = self.subdevices[number].target();
            let (ports, unit) = (register::DC_RECEIVE_TIMES, register::DC_RECEIVE_TIME_UNIT);
            reads.push(Access::read("reading the receive times", target, ports, 16));
            reads.push(Access::read("reading the local time", target, unit, 8));
        }
        self.transactor.perform(&mut reads)?;
        let mut segment: Vec<Latched> = self
            .subdevices
            .iter()
            .map(|one| Latched { ports: one.ports, parent: one.parent, times_ns: None })
            .collect();
        for (&number, reads) in with_clock.iter().zip(reads.chunks_exact(2)) {
            let times = core::array::from_fn(|port| u32_at(&reads[0].data, 4 * port));
            segment[number].times_ns = Some(times);
        }
        let delays = delays(&segment)?;
        self.propagation = Some(propagation(&segment));
        // Where the host knows the date, the segment's time is that of the standard: ns since 2000.
        let epoch_ns = self.transactor.clock.since_2000_ns().unwrap_or(0);
        let mut writes = Vec::with_capacity(3 * with_clock.len());
        for (&number, reads) in with_clock.iter().zip(reads.chunks_exact(2)) {
            let subdevice = &mut self.subdevices[number];
            let delay_ns = delays[number].unwrap_or(0);
            let common = now.0.wrapping_add(epoch_ns).wrapping_add(u64::from(delay_ns));
            let local = u64_at(&reads[1].data, 0);
            let width = subdevice.dc.map_or(DcWidth::Bits64, |clock| clock.width);
            let offset_ns = match width {
                DcWidth::Bits64 => common.wrapping_sub(local),
                DcWidth::Bits32 => u64::from((common as u32).wrapping_sub(local as u32)),
            };
            let receive_times_ns = segment[number].times_ns.unwrap_or_default();
            subdevice.dc = Some(DcClock { width, delay_ns, offset_ns, receive_times_ns });
            let target = subdevice.target();
            writes.push(Access::write(
                "setting the clock's delay",
                target,
                register::DC_SYSTEM_TIME_DELAY,
                &delay_ns.to_le_bytes(),
            ));
            let offset = offset_ns.to_le_bytes();
            let length = if width == DcWidth::Bits64 { 8 } else { 4 };
            writes.push(Access::write(
                "setting the clock's offset",
                target,
                register::DC_SYSTEM_TIME_OFFSET,
                &offset[..length],
            ));
            writes.push(Access::write(
                "starting the clock's control",
                target,
                register::DC_SPEED_COUNTER_START,
                &SPEED_COUNTER_START.to_le_bytes(),
            ));
        }
        self.transactor.perform(&mut writes)
    }
}

/// The reference clock: the first SubDevice that has one.
pub fn reference_clock(subdevices: &[SubDevice]) -> Option<&SubDevice> {
    subdevices.iter().find(|one| one.dc.is_some())
}

#[cfg(test)]
mod tests;
