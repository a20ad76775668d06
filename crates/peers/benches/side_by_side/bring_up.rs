//! Ours: the segment to OP, and cycles.

use crate::Course;
use crate::mark::Mark;
use omnibase_ethercat::cyclic::{ClockDirection, Goal, Handover, TransitionOptions, TransitionStatus};
use omnibase_ethercat::wire::{Clock, HostTime, Link, LinkError};
use omnibase_ethercat::{Bus, BusOptions, CyclicBus, Exchange, ProcessImage, SubDeviceConfig};
use omnibase_host::{MonotonicClock, PacketSocket};
use std::time::Duration;

/// Between two cycles on the way to OP.
const PAUSE: Duration = Duration::from_millis(1);
/// For a frame to come back: a shared machine takes its time.
const PATIENCE: Duration = Duration::from_millis(50);

/// Brings the segment of so many `drives` behind `link` to OP.
fn operational<L: Link>(link: L, drives: usize) -> (CyclicBus<L>, ProcessImage) {
    let mut bus = Bus::new(link, MonotonicClock, BusOptions::default());
    bus.scan().expect("a scan");
    bus.configure(&vec![SubDeviceConfig::default(); drives]).expect("all in PRE-OP");
    let Handover { mut bus, mut clock, .. } =
        bus.into_cyclic(ClockDirection::CycleFollowsDc).expect("a plan of frames");
    let mut image = bus.plan().image();
    bus.request(Goal::Op, TransitionOptions::default(), clock.now());
    while *bus.transition() != TransitionStatus::Reached(Goal::Op) {
        if let TransitionStatus::Failed(error) = bus.transition() {
            panic!("on the way to OP: {error}");
        }
        bus.exchange(&mut image, clock.now() + PATIENCE).expect("the cable is in");
        clock.sleep_until(clock.now() + PAUSE);
    }
    (bus, image)
}

/// Ours over `link`.
pub fn ours(link: impl Link, mark: Mark, course: Course) {
    let (mut bus, mut image) = operational(link, course.drives);
    mark.measure(course, || {
        let deadline = MonotonicClock.now() + PATIENCE;
        bus.exchange(&mut image, deadline).expect("the cable is in") == Exchange::Complete
    });
}

/// The frames of a cycle of ours in OP, with the segment in OP to answer them.
pub fn frames_in_op(interface: &str, course: Course) -> Vec<Vec<u8>> {
    let link = Keeping { link: PacketSocket::open(interface).unwrap(), sent: Vec::new() };
    let (bus, _) = operational(link, course.drives);
    let frames = bus.frames_per_cycle();
    let mut sent = bus.into_parts().0.sent;
    sent.split_off(sent.len() - frames)
}

/// A link that remembers what was sent.
struct Keeping {
    link: PacketSocket,
    sent: Vec<Vec<u8>>,
}

impl Link for Keeping {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.sent.push(frame.to_vec());
        self.link.send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        self.link.receive(buffer, deadline)
    }
}
