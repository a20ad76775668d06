//! A segment behind a network interface, in real time, for any MainDevice.

use crate::segment::Segment;
use core::ops::ControlFlow;
use core::time::Duration;
use omnibase_ethercat_wire::frame::{ETHERTYPE, FIRST_DATAGRAM, MAX_FRAME, PROCESSED_BIT};
use omnibase_ethercat_wire::{Clock, HostTime, Link, LinkError};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};

/// How long a wait lasts at most, so that whoever watches is asked now and then.
const LONGEST_WAIT: Duration = Duration::from_millis(5);
/// Answers that are remembered, to know them when the interface shows us what we sent.
const REMEMBERED: usize = 8;

/// What a served segment did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Served {
    /// Frames of a MainDevice.
    pub frames: u64,
    /// Of them, those that were answered; the others were lost in the segment.
    pub answered: u64,
    /// Foreign frames, and own ones that came back.
    pub ignored: u64,
    /// The longest time that a frame waited for this program, ns; 0 where the link doesn't know its arrivals.
    pub longest_wait_ns: u64,
}

/// Answers the frames that come in by `link` until `watch` breaks it off.
///
/// The segment's time goes on with `clock` from where it stands, also between frames. A frame passes the segment at
/// the instant of its arrival, as far as the link knows that, also where this program was late to fetch it: pauses
/// of the host are not the bus's, only the answer comes late. Answers leave at once: the times of cables and chips
/// are in the clocks of the SubDevices, but nobody waits for them here.
///
/// `watch` sees the segment after each frame and each event within it, in the order of the segment's time, and may
/// inject faults.
pub fn serve(
    segment: &mut Segment,
    link: &mut dyn Link,
    clock: &dyn Clock,
    watch: &mut dyn FnMut(&mut Segment) -> ControlFlow<()>,
) -> Result<Served, LinkError> {
    let mut service = Service {
        origin: clock.now(),
        start: segment.now(),
        segment,
        watch,
        served: Served::default(),
        sent: VecDeque::with_capacity(REMEMBERED),
    };
    let mut buffer = [0; MAX_FRAME];
    loop {
        // Looked at before the link: what came until then is in the link, and is earlier than anything after it.
        let now = clock.now();
        let mut received = link.receive(&mut buffer, HostTime(0))?;
        if received.is_none() {
            let wait = match service.advance(now) {
                ControlFlow::Continue(()) => service.wait(now),
                ControlFlow::Break(()) => return Ok(service.served),
            };
            received = link.receive(&mut buffer, now + wait)?;
        }
        let Some(length) = received else { continue };
        let taken = clock.now();
        let arrival = link.arrival().unwrap_or(taken).min(taken);
        let frame = &mut buffer[..length.min(MAX_FRAME)];
        let (answer, flow) = service.take(frame, arrival);
        service.served.longest_wait_ns =
            service.served.longest_wait_ns.max((taken - arrival).as_nanos() as u64);
        if answer == Answer::Leaves {
            link.send(frame)?;
        }
        if flow.is_break() {
            return Ok(service.served);
        }
    }
}

/// A watch that breaks the service off once `stop` is set.
pub fn until_set(stop: &AtomicBool) -> impl FnMut(&mut Segment) -> ControlFlow<()> {
    |_| match stop.load(Ordering::Relaxed) {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    }
}

/// What becomes of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Answer {
    /// It goes back.
    Leaves,
    /// Nothing goes back.
    None,
}

/// A segment that is being served.
struct Service<'a> {
    segment: &'a mut Segment,
    watch: &'a mut dyn FnMut(&mut Segment) -> ControlFlow<()>,
    /// The host's time at the segment's `start`.
    origin: HostTime,
    start: HostTime,
    served: Served,
    sent: VecDeque<Vec<u8>>,
}

impl Service<'_> {
    fn in_segment(&self, host: HostTime) -> HostTime {
        self.start + (host - self.origin)
    }

    /// How long to wait for a frame: until the segment's next event.
    fn wait(&self, now: HostTime) -> Duration {
        let due = self.segment.next_wake().map(|wake| wake - self.in_segment(now));
        due.unwrap_or(LONGEST_WAIT).min(LONGEST_WAIT)
    }

    /// Lets happen what is due up to an instant of the host's, event by event.
    fn advance(&mut self, host: HostTime) -> ControlFlow<()> {
        let until = self.in_segment(host);
        while let Some(wake) = self.segment.next_wake().filter(|wake| *wake <= until) {
            self.segment.advance(wake);
            (self.watch)(self.segment)?;
        }
        self.segment.advance(until);
        (self.watch)(self.segment)
    }

    /// Runs a frame through the segment, in place.
    fn take(&mut self, frame: &mut [u8], arrival: HostTime) -> (Answer, ControlFlow<()>) {
        if !carries_datagrams(frame) || forget(&mut self.sent, frame) {
            self.served.ignored += 1;
            return (Answer::None, ControlFlow::Continue(()));
        }
        if self.advance(arrival).is_break() {
            return (Answer::None, ControlFlow::Break(()));
        }
        self.served.frames += 1;
        let at = self.in_segment(arrival);
        let back = self.segment.process(frame, at);
        let flow = (self.watch)(self.segment);
        if back.is_none() {
            return (Answer::None, flow);
        }
        self.served.answered += 1;
        if self.sent.len() == REMEMBERED {
            self.sent.pop_front();
        }
        self.sent.push_back(frame.to_vec());
        (Answer::Leaves, flow)
    }
}

fn carries_datagrams(frame: &[u8]) -> bool {
    frame.len() >= FIRST_DATAGRAM && frame[12..14] == ETHERTYPE.to_be_bytes()
}

/// Whether `frame` is one that we sent. A MainDevice may have a locally administered address itself, so the bit
/// in the source address isn't enough.
fn forget(sent: &mut VecDeque<Vec<u8>>, frame: &[u8]) -> bool {
    if frame[6] & PROCESSED_BIT == 0 {
        return false;
    }
    match sent.iter().position(|own| own == frame) {
        Some(at) => sent.remove(at).is_some(),
        None => false,
    }
}
