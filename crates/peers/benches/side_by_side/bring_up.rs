//! Ours: the segment to OP, and cycles.

use crate::DRIVES;
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

/// Brings the segment behind `link` to OP.
fn operational<L: Link>(link: L) -> (CyclicBus<L>, ProcessImage) {
    let mut bus = Bus::new(link, MonotonicClock, BusOptions::default());
    bus.scan().expect("a scan");
    bus.configure(&vec![SubDeviceConfig::default(); DRIVES]).expect("all in PRE-OP");
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
    assert_eq!(bus.frames_per_cycle(), 1);
    (bus, image)
}

/// Ours over `link`.
pub fn ours(link: impl Link, mark: Mark, cycles: u64) {
    let (mut bus, mut image) = operational(link);
    mark.measure(cycles, || {
        let deadline = MonotonicClock.now() + PATIENCE;
        bus.exchange(&mut image, deadline).expect("the cable is in") == Exchange::Complete
    });
}

/// The frame that ours sends in OP, with the segment in OP to answer it.
pub fn frame_in_op(interface: &str) -> Vec<u8> {
    let link = Keeping { link: PacketSocket::open(interface).unwrap(), last: Vec::new() };
    let (bus, _) = operational(link);
    bus.into_parts().0.last
}

/// A link that remembers what was sent last.
struct Keeping {
    link: PacketSocket,
    last: Vec<u8>,
}

impl Link for Keeping {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        frame.clone_into(&mut self.last);
        self.link.send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        self.link.receive(buffer, deadline)
    }
}
