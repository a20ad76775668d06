//! A ring between two interfaces: any one break loses no cycle, and its place is known.

use std::cell::Cell;
use std::rc::Rc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use omnibase_ethercat::config::Every;
use omnibase_ethercat::cyclic::{ClockDirection, Goal, TransitionOptions};
use omnibase_ethercat::paced::{Leader, Pace, PacedBus};
use omnibase_ethercat::redundant::RedundantLink;
use omnibase_ethercat::wire::{HostTime, Link, LinkError, RingState};
use omnibase_ethercat::{Bus, BusOptions, Exchange, ProcessImage, SubDeviceConfig};
use omnibase_ethercat_sim::{Fault, Segment, SegmentFile, SimPort, VirtualClock, ring_in_process};

use crate::runner::synchronous;

const CYCLE: Duration = Duration::from_millis(1);

/// An interface that loses the next answers.
struct Lossy {
    port: SimPort,
    to_lose: Rc<Cell<u32>>,
}

impl Link for Lossy {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.port.send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        loop {
            let received = self.port.receive(buffer, deadline)?;
            if received.is_none() || self.to_lose.get() == 0 {
                return Ok(received);
            }
            self.to_lose.set(self.to_lose.get() - 1);
        }
    }
}

struct Ring {
    paced: PacedBus<RedundantLink<Lossy, Lossy, VirtualClock>, VirtualClock>,
    /// Answers that each interface is to lose.
    to_lose: [Rc<Cell<u32>>; 2],
    image: ProcessImage,
    port: SimPort,
    count: usize,
}

impl Ring {
    fn new(count: usize) -> Self {
        Ring::of(&synchronous(count, CYCLE))
    }

    fn of(configs: &[SubDeviceConfig]) -> Self {
        let count = configs.len();
        let text = format!("[[subdevice]]\nkind = \"servo\"\ncount = {count}\n");
        let mut segment: Segment =
            SegmentFile::parse(&text).unwrap().build(std::path::Path::new(".")).unwrap();
        segment.close_ring(count - 1, 1).unwrap();
        let (primary, redundant, clock) = ring_in_process(segment);
        let port = primary.clone();
        let to_lose: [Rc<Cell<u32>>; 2] = Default::default();
        let primary = Lossy { port: primary, to_lose: to_lose[0].clone() };
        let redundant = Lossy { port: redundant, to_lose: to_lose[1].clone() };
        let link = RedundantLink::new(primary, redundant, clock.clone());
        let mut bus = Bus::new(link, clock, BusOptions::default());
        bus.scan().unwrap();
        bus.configure(configs).unwrap();
        let ready = bus.into_cyclic(ClockDirection::CycleFollowsDc).unwrap();
        let pace =
            Pace { cycle: CYCLE, timeout: CYCLE * 4 / 5, leader: Leader::ReferenceClock, sync0_shift_ns: 0 };
        let mut image = ready.bus.plan().image();
        let mut paced = PacedBus::new(ready.bus, ready.clock, pace);
        let reached = paced.reach(Goal::Op, TransitionOptions::default(), &AtomicBool::new(false), |paced| {
            paced.exchange(&mut image).map(drop)
        });
        assert_eq!(reached, Ok(true));
        Ring { image, paced, to_lose, port, count }
    }

    fn cycle(&mut self) -> Exchange {
        self.paced.exchange(&mut self.image).unwrap().0
    }

    fn complete(&mut self, cycles: usize, what: &str) {
        for cycle in 0..cycles {
            assert_eq!(self.cycle(), Exchange::Complete, "{what}, cycle {cycle}");
        }
    }

    /// The cable before the SubDevice at `place`; the last one leads to the redundant interface.
    fn cable(&self, place: usize, mended: bool) {
        let (position, port) = if place == self.count { (place - 1, 1) } else { (place, 0) };
        let fault = if mended { Fault::CableRestored { port } } else { Fault::CableCut { port } };
        self.port.with_segment(|segment| segment.inject(position, fault)).unwrap();
    }

    fn state(&self) -> Option<RingState> {
        self.paced.bus().link().ring()
    }

    fn worst_clock_ns(&self) -> u32 {
        self.port.with_segment(|segment| {
            let differences = segment.sub_devices().iter().filter_map(|one| one.esc().peek(0x092C, 4));
            let magnitude = |bytes: &[u8]| u32::from_le_bytes(bytes.try_into().unwrap()) & 0x7FFF_FFFF;
            differences.map(magnitude).max().unwrap_or(0)
        })
    }

    fn statuses(&self) -> Vec<u8> {
        self.port.with_segment(|segment| {
            segment.sub_devices().iter().map(|one| one.esc().peek(0x0130, 1).unwrap()[0]).collect()
        })
    }
}

#[test]
fn each_break_of_a_ring_loses_no_cycle_and_is_located_and_mended() {
    for count in [3, 20] {
        let mut ring = Ring::new(count);
        ring.complete(100, "whole");
        let before = ring.paced.bus().counters();
        assert_eq!(ring.state(), Some(RingState::Whole));
        for place in 0..=count {
            let what = format!("{count} devices, break before {place}");
            ring.cable(place, false);
            ring.complete(2, &what);
            let place_found = place as u16;
            let broken = RingState::Broken { before: place_found, behind: place_found };
            assert_eq!(ring.state(), Some(broken), "{what}");
            ring.complete(500, &what);
            // The half without the reference follows the host's clock: the way of its frames is another.
            assert!(ring.worst_clock_ns() < 5000, "{what}: {} ns", ring.worst_clock_ns());
            ring.cable(place, true);
            ring.complete(500, &format!("{what}, mended"));
            assert_eq!(ring.state(), Some(RingState::Whole), "{what}, mended");
        }
        let after = ring.paced.bus().counters();
        assert_eq!(after.working_counter_errors, before.working_counter_errors);
        assert_eq!(after.frames_lost, before.frames_lost);
        assert_eq!(ring.statuses(), vec![8; count]);
    }
}

#[test]
fn a_break_loses_no_turn_of_slow_ones_either() {
    let mut configs = synchronous(4, CYCLE);
    for slow in [1, 3] {
        let every = Every::nth(4).unwrap();
        configs[slow] = SubDeviceConfig { every, ..SubDeviceConfig::default() };
    }
    let mut ring = Ring::of(&configs);
    let before = ring.paced.bus().counters();
    for place in 0..=4 {
        // In each phase of the slow ones.
        ring.complete(41, "whole");
        ring.cable(place, false);
        ring.complete(41, &format!("break before {place}"));
        ring.cable(place, true);
    }
    let after = ring.paced.bus().counters();
    assert_eq!(after.working_counter_errors, before.working_counter_errors);
    assert_eq!(after.frames_lost, before.frames_lost);
    assert_eq!(ring.statuses(), [8; 4]);
}

#[test]
fn a_second_break_loses_only_what_lies_between() {
    let mut ring = Ring::new(5);
    ring.cable(1, false);
    ring.complete(200, "first break");
    ring.cable(3, false);
    ring.cycle();
    ring.cycle();
    assert_eq!(ring.state(), Some(RingState::Broken { before: 1, behind: 3 }));
    for _ in 0..300 {
        assert_eq!(ring.cycle(), Exchange::Without { not_operational: 2 });
    }
    let statuses = ring.statuses();
    assert_eq!((statuses[0], &statuses[3..]), (8, &[8u8, 8][..]));
}

#[test]
fn a_copy_that_is_lost_tells_of_no_other_break() {
    let broken = |before, behind| Some(RingState::Broken { before, behind });
    for port in [0, 1] {
        for lost in [1, 2] {
            let mut ring = Ring::new(5);
            ring.complete(100, "whole");
            ring.to_lose[port].set(lost);
            for _ in 0..lost {
                ring.cycle();
                assert_eq!(ring.state(), Some(RingState::Whole), "port {port}, {lost} lost, whole");
            }
            ring.complete(100, "whole again");
            ring.cable(2, false);
            ring.complete(100, "broken");
            assert_eq!(ring.state(), broken(2, 2));
            ring.to_lose[port].set(lost);
            for _ in 0..lost {
                ring.cycle();
                assert_eq!(ring.state(), broken(2, 2), "port {port}, {lost} lost, broken");
            }
            // Questions to those that seemed to be missing may still be on their way.
            ring.cycle();
            assert_eq!(ring.state(), broken(2, 2), "port {port}, {lost} lost, broken");
            ring.complete(100, "all copies are back");
            ring.cable(2, true);
            ring.complete(100, "mended");
            assert_eq!(ring.state(), Some(RingState::Whole));
        }
    }
}

#[test]
fn an_interface_that_falls_silent_beside_a_break_is_told() {
    let mut ring = Ring::new(5);
    ring.cable(2, false);
    ring.complete(200, "first break");
    ring.cable(5, false);
    for _ in 0..3 {
        ring.cycle();
    }
    assert_eq!(ring.state(), Some(RingState::Broken { before: 2, behind: 5 }));
    ring.cable(2, true);
    ring.cable(5, true);
    for _ in 0..3 {
        ring.cycle();
    }
    assert_eq!(ring.state(), Some(RingState::Whole));
}
