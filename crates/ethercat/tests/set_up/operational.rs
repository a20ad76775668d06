//! From power-on to OP: the segments that the repository ships, with and without SYNC0.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use omnibase_ethercat::config::{DcConfig, Timeouts};
use omnibase_ethercat::cyclic::{ClockDirection, Exchange, Goal, Handover, TransitionOptions};
use omnibase_ethercat::paced::{Leader, Pace, PacedBus};
use omnibase_ethercat::subdevice::{Direction, SubDevice};
use omnibase_ethercat::wire::bytes::{u16_at, u32_at, u64_at};
use omnibase_ethercat::wire::{AlState, Clock, HostTime, Link, register};
use omnibase_ethercat::{Bus, BusOptions, CyclicBus, ProcessImage, SubDeviceConfig};
use omnibase_ethercat_sim::segment_file::line_of_images;
use omnibase_ethercat_sim::{Segment, SegmentFile, VirtualClock, in_process};

use crate::segment::recorded_sii;

pub const CYCLE: Duration = Duration::from_millis(1);
/// First SYNC0 so far ahead: a tenth of what a real host takes, whose cycles are late now and then.
const SYNC_MARGIN: Duration = Duration::from_millis(10);
/// Cycles after which a segment counts as hung.
const CYCLE_LIMIT: usize = 30_000;

/// A segment of the repository.
pub fn segment_file(name: &str) -> Segment {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../segments"));
    let text = std::fs::read_to_string(folder.join(name)).unwrap();
    SegmentFile::parse(&text).unwrap().build(folder).unwrap()
}

/// A segment that cycles.
pub struct Operational<L: Link> {
    pub paced: PacedBus<L, VirtualClock>,
    pub image: ProcessImage,
    pub subdevices: Vec<SubDevice>,
}

/// Takes a segment all the way to OP; every failure in words.
pub fn to_op<L: Link>(
    link: L,
    clock: VirtualClock,
    configs: impl Fn(&[SubDevice]) -> Vec<SubDeviceConfig>,
) -> Result<Operational<L>, String> {
    let mut bus = Bus::new(link, clock, BusOptions::default());
    bus.scan().map_err(|error| error.to_string())?;
    let configs = configs(bus.subdevices());
    bus.configure(&configs).map_err(|error| error.to_string())?;
    let handover = bus.into_cyclic(ClockDirection::CycleFollowsDc).map_err(|error| error.to_string())?;
    let Handover { bus, clock, subdevices } = handover;
    let mut image = bus.plan().image();
    let pace = Pace { cycle: CYCLE, timeout: CYCLE / 2, leader: Leader::ReferenceClock, sync0_shift_ns: 0 };
    let mut paced = PacedBus::new(bus, clock, pace);
    let options = TransitionOptions { sync_margin: SYNC_MARGIN, ..TransitionOptions::default() };
    let (stop, mut cycles) = (AtomicBool::new(false), 0);
    let reached = paced.reach(Goal::Op, options, &stop, |paced| {
        cycles += 1;
        stop.store(cycles == CYCLE_LIMIT, Ordering::Relaxed);
        paced.exchange(&mut image).map(drop)
    });
    if !reached.map_err(|error| error.to_string())? {
        return Err("hung".into());
    }
    Ok(Operational { paced, image, subdevices })
}

pub fn unconfigured(_: &[SubDevice]) -> Vec<SubDeviceConfig> {
    Vec::new()
}

/// SYNC0 at the cycle for every SubDevice that has a mailbox, thus an application that cares.
pub fn with_sync0(found: &[SubDevice]) -> Vec<SubDeviceConfig> {
    let dc = DcConfig::Sync0 { cycle_ns: CYCLE.as_nanos() as u32, shift_ns: 0 };
    let config = |one: &SubDevice| SubDeviceConfig {
        dc: if one.sii.header.mailbox_protocols != 0 { dc } else { DcConfig::Off },
        ..SubDeviceConfig::default()
    };
    found.iter().map(config).collect()
}

/// Everything in OP, and the clocks of all that have one within 1 us; gives the bus time that it took.
fn check(name: &str, configs: impl Fn(&[SubDevice]) -> Vec<SubDeviceConfig>) -> HostTime {
    let (link, clock) = in_process(segment_file(name));
    let operational = to_op(link, clock.clone(), configs).unwrap();
    let reached = clock.now();
    assert_eq!(operational.paced.bus().last_exchange(), Exchange::Complete);
    let segment = operational.paced.bus().link().segment();
    let time_at = |n: usize| segment.sub_devices()[n].esc().system_time(reached);
    let reference = (0..operational.subdevices.len()).find_map(time_at).map(|time| time.0);
    for (number, one) in operational.subdevices.iter().enumerate() {
        let esc = segment.sub_devices()[number].esc();
        let status = esc.peek(register::AL_STATUS, 2).map(|bytes| u16_at(bytes, 0));
        assert_eq!(status, Some(AlState::Op.bits()), "SubDevice {number}");
        if let (Some(time), Some(reference)) = (esc.system_time(reached), reference) {
            let apart = time.0.abs_diff(reference);
            assert!(one.dc.is_some() && apart < 1000, "SubDevice {number} is {apart} ns apart");
        }
    }
    println!("{name}: OP after {:?} of bus time", Duration::from_nanos(reached.0));
    reached
}

fn seconds(seconds: u64) -> HostTime {
    HostTime(seconds * 1_000_000_000)
}

#[test]
fn three_sgdv_reach_op_with_sync0_within_two_seconds() {
    assert!(check("three-sgdv.toml", with_sync0) < seconds(2));
}

#[test]
fn three_servos_reach_op_with_and_without_sync0() {
    assert!(check("three-servos.toml", with_sync0) < seconds(2));
    assert!(check("three-servos.toml", unconfigured) < seconds(2));
}

#[test]
fn a_hundred_servos_reach_op_within_ten_seconds() {
    assert!(check("hundred-servos.toml", with_sync0) < seconds(10));
}

#[test]
fn a_mixed_tree_reaches_op_and_its_bits_arrive() {
    assert!(check("mixed-tree.toml", with_sync0) < seconds(4));
    let (link, clock) = in_process(segment_file("mixed-tree.toml"));
    let Operational { mut paced, mut image, subdevices } = to_op(link, clock, with_sync0).unwrap();
    let lengths =
        subdevices.iter().map(|one| (one.bit_length(Direction::Outputs), one.bit_length(Direction::Inputs)));
    let bits = [(0, 0), (0, 8), (8, 0), (5, 3), (160, 160), (160, 160), (128, 128), (0, 0), (16, 0)];
    assert_eq!(lengths.collect::<Vec<_>>(), bits);
    // The bits that the plan gives to "odd-bits" are those that reach its memory, and no others.
    let odd = paced.bus().plan().placements_of(3).iter().find(|place| place.direction == Direction::Outputs);
    let odd = *odd.unwrap();
    let memory = |bus: &CyclicBus<_>| -> Option<u8> {
        let start = subdevices[3].process_data(Direction::Outputs).next()?.area.start;
        let link: &omnibase_ethercat_sim::SimLink = bus.link();
        link.segment().sub_devices()[3].esc().peek(start, 1).map(|bytes| bytes[0])
    };
    for pattern in [0b10101u8, 0b01010] {
        image.outputs.fill(0);
        image.outputs[odd.offset] = pattern << odd.logical.start_bit;
        assert_eq!(paced.exchange(&mut image).unwrap().0, Exchange::Complete);
        paced.exchange(&mut image).unwrap();
        assert_eq!(memory(paced.bus()).map(|byte| byte & 0x1F), Some(pattern));
    }
}

/// The recorded images behind the simulator's generic device, the servo drive with its dozens of PDOs among them.
#[test]
fn recorded_devices_reach_op() {
    let names = ["ek1100-sii.bin", "el2828-sii.bin", "el2889-sii.bin", "akd-sii.bin"];
    let Some(images) = names.map(recorded_sii).into_iter().collect::<Option<Vec<_>>>() else { return };
    let (link, clock) = in_process(line_of_images(&images).unwrap());
    let Operational { mut paced, mut image, subdevices } = to_op(link, clock, unconfigured).unwrap();
    let outputs = subdevices.iter().map(|one| one.bit_length(Direction::Outputs));
    assert_eq!(outputs.collect::<Vec<_>>(), [0, 8, 16, 48]);
    // Each terminal's bytes arrive in its digital outputs, those of the EL2889 through two SyncManagers.
    for (position, pattern) in [(1, vec![0xA5]), (2, vec![0x3C, 0xC3])] {
        let places: Vec<_> =
            paced.bus().plan().placements_of(position).iter().map(|place| place.offset).collect();
        for (offset, byte) in places.into_iter().zip(&pattern) {
            image.outputs[offset] = *byte;
        }
        assert_eq!(paced.exchange(&mut image).unwrap().0, Exchange::Complete);
        let esc = paced.bus().link().segment().sub_devices()[usize::from(position)].esc();
        assert_eq!(esc.peek(0x0F00, pattern.len()), Some(&pattern[..]));
    }
}

/// Two servos, of which the second takes 11 s for each change of state: longer than any device is waited for.
const SLOW: &str = "[[subdevice]]\nkind = \"servo\"\n\n[[subdevice]]\nkind = \"servo\"\nservo = { transition_us = 11_000_000 }\n";

#[test]
fn a_slow_device_is_waited_for_as_long_as_it_may_take() {
    let seconds = |seconds| Some(Duration::from_secs(seconds));
    let reach = |timeouts: Timeouts| {
        let segment = SegmentFile::parse(SLOW).unwrap().build(Path::new(".")).unwrap();
        let (link, clock) = in_process(segment);
        let slow = SubDeviceConfig { timeouts, ..SubDeviceConfig::default() };
        let reached = to_op(link, clock.clone(), |_| vec![SubDeviceConfig::default(), slow.clone()]);
        (reached.map(drop), clock.now())
    };
    let patient = Timeouts { init: seconds(12), pre_op: seconds(12), safe_op_op: seconds(12), mailbox: None };
    let (reached, at) = reach(patient);
    assert_eq!(reached, Ok(()));
    assert!(at > HostTime(33_000_000_000), "it took its time: {at:?}");
    for (timeouts, told) in [
        (Timeouts::default(), "PRE-OP not reached within 3 s"),
        (Timeouts { safe_op_op: None, ..patient }, "still in PRE-OP after 10 s"),
        (Timeouts { safe_op_op: seconds(2), ..patient }, "still in PRE-OP after 2 s"),
    ] {
        let text = reach(timeouts).0.unwrap_err();
        assert!(text.contains("SubDevice 1") && text.contains(told), "{told}: {text}");
    }
}

#[test]
fn one_at_the_end_whose_cables_are_swapped_reaches_op() {
    for text in [
        "[[subdevice]]\nkind = \"servo\"\ncount = 2\n\n[[subdevice]]\nkind = \"servo\"\nentry_port = 1\n",
        "[[subdevice]]\nkind = \"servo\"\nentry_port = 1\n",
    ] {
        let (link, clock) = in_process(SegmentFile::parse(text).unwrap().build(Path::new(".")).unwrap());
        let operational = to_op(link, clock, with_sync0).unwrap();
        assert_eq!(operational.paced.bus().last_exchange(), Exchange::Complete);
    }
}

#[test]
fn events_of_the_clock_are_as_asked() {
    let cycle_ns = CYCLE.as_nanos() as u32 / 2;
    let dc = DcConfig::Sync0And1 { cycle_ns, shift_ns: 0, sync1_cycle_ns: cycle_ns + 100_000 };
    let registers = |assign_activate| {
        let (link, clock) = in_process(segment_file("three-servos.toml"));
        let config = SubDeviceConfig { dc, assign_activate, ..SubDeviceConfig::default() };
        let operational = to_op(link, clock, |_| vec![config.clone(); 3]).unwrap();
        let segment = operational.paced.bus().link().segment();
        let esc = segment.sub_devices()[1].esc();
        let control = u16_at(esc.peek(register::DC_CYCLIC_CONTROL, 2).unwrap(), 0);
        let sync0 = u32_at(esc.peek(register::DC_SYNC0_CYCLE, 4).unwrap(), 0);
        let sync1 = u32_at(esc.peek(register::DC_SYNC1_CYCLE, 4).unwrap(), 0);
        // SYNC1 is counted from the first SYNC0: that is in phase with the cycle, so that SYNC1 is at its place in each.
        let start = u64_at(esc.peek(register::DC_START_TIME, 8).unwrap(), 0);
        (control, sync0, sync1, start % CYCLE.as_nanos() as u64)
    };
    assert_eq!(registers(None), (0x0700, cycle_ns, cycle_ns + 100_000, 0));
    assert_eq!(registers(Some(0x0730)), (0x0730, cycle_ns, cycle_ns + 100_000, 0));
}
