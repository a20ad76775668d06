//! A segment behind a network interface, in real time, for any MainDevice.

use crate::segment::{MainPort, Segment};
use core::ops::ControlFlow;
use core::time::Duration;
use omnibase_ethercat_wire::frame::{ETHERTYPE, FIRST_DATAGRAM, MAX_FRAME, PROCESSED_BIT};
use omnibase_ethercat_wire::{Clock, HostTime, Link, LinkError};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};

/// How long a wait lasts at most, so that whoever watches is asked now and then.
const LONGEST_WAIT: Duration = Duration::from_millis(5);
/// How long one of several links is waited at before a look at the others. A MainDevice sends into both ends of a ring at once:
/// what comes to one of them has the other looked at.
const SLICE: Duration = Duration::from_micros(200);
/// A segment's time that is farther behind is counted: the usual cycle.
pub const LONG_BEHIND: Duration = Duration::from_millis(1);
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
    /// The most by which the segment's time was behind the clock while nothing waited, ns.
    pub longest_behind_ns: u64,
    /// Looks at the segment while nothing waited.
    pub looks: u64,
    /// Those at which its time was behind by more than [`LONG_BEHIND`].
    pub looks_behind: u64,
    /// The longest time that a frame waited for this program, ns; 0 where the link doesn't know its arrivals.
    pub longest_wait_ns: u64,
}

/// Answers the frames that come in by `link` until `watch` breaks it off.
///
/// The segment's time goes on with `clock` from where it stands, also between frames. A frame passes the
/// segment at the instant of its arrival, as far as the link knows that, also where this program was late to
/// fetch it: pauses of the host are not the bus's, only the answer comes late.
///
/// Answers leave at once: the times of cables and chips are in the clocks of the SubDevices, but nobody waits
/// for them here.
///
/// `watch` sees the segment after each frame and each event within it, in the order of the segment's time, and may
/// inject faults.
pub fn serve(
    segment: &mut Segment,
    link: &mut dyn Link,
    clock: &dyn Clock,
    watch: &mut dyn FnMut(&mut Segment) -> ControlFlow<()>,
) -> Result<Served, LinkError> {
    run(segment, &mut [Port::new(MainPort::Primary, link)], clock, watch)
}

/// As [`serve`], for a segment whose ring was closed, with a link at each end.
///
/// Goes on while one of the links is down; `watch` then has to take its cable out of the segment
/// ([`Segment::main_plug`] tells which it is), as the chip at that end would notice.
pub fn serve_ring(
    segment: &mut Segment,
    ends: RingEnds<'_>,
    clock: &dyn Clock,
    watch: &mut dyn FnMut(&mut Segment) -> ControlFlow<()>,
) -> Result<Served, LinkError> {
    let RingEnds { primary, redundant } = ends;
    let ports = &mut [Port::new(MainPort::Primary, primary), Port::new(MainPort::Redundant, redundant)];
    run(segment, ports, clock, watch)
}

/// The links at both ends of a ring.
pub struct RingEnds<'a> {
    /// The one that leads to position 0.
    pub primary: &'a mut dyn Link,
    /// The one at the other end.
    pub redundant: &'a mut dyn Link,
}

fn run(
    segment: &mut Segment,
    ports: &mut [Port<'_>],
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
    let mut frame = [0; MAX_FRAME];
    let mut turn = 0;
    loop {
        // Looked at before the links: what came until then is in them, and is earlier than anything after it.
        let now = clock.now();
        for port in ports.iter_mut() {
            port.look(HostTime(0), clock)?;
        }
        let arrived = ports.iter().enumerate().filter_map(|(at, port)| Some((port.arrived?.arrival, at)));
        let Some((_, at)) = arrived.min() else {
            let advanced = service.advance(now);
            let behind_ns = (clock.now() - now).as_nanos() as u64;
            let served = &mut service.served;
            served.longest_behind_ns = served.longest_behind_ns.max(behind_ns);
            served.looks += 1;
            served.looks_behind += u64::from(u128::from(behind_ns) > LONG_BEHIND.as_nanos());
            let wait = match advanced {
                ControlFlow::Continue(()) => service.wait(now),
                ControlFlow::Break(()) => return Ok(service.served),
            };
            let up = ports.iter().filter(|port| !port.is_down).count();
            let wait = if ports.len() > 1 { wait.min(SLICE) } else { wait };
            turn += 1;
            match ports.iter_mut().filter(|port| !port.is_down).nth(turn % up.max(1)) {
                Some(port) => port.look(now + wait, clock)?,
                None => return Err(LinkError::Down),
            }
            continue;
        };
        let Some(Arrived { length, arrival, taken }) = ports[at].arrived.take() else { continue };
        let frame = &mut frame[..length.min(MAX_FRAME)];
        frame.copy_from_slice(&ports[at].buffer[..frame.len()]);
        let (leaves, flow) = service.take(ports[at].main, frame, arrival);
        service.served.longest_wait_ns =
            service.served.longest_wait_ns.max((taken - arrival).as_nanos() as u64);
        if let Some(port) = ports.iter_mut().find(|port| Some(port.main) == leaves) {
            port.send(frame)?;
        }
        if flow.is_break() {
            return Ok(service.served);
        }
    }
}

/// One of the MainDevice's interfaces.
struct Port<'a> {
    main: MainPort,
    link: &'a mut dyn Link,
    buffer: [u8; MAX_FRAME],
    /// The frame in the buffer.
    arrived: Option<Arrived>,
    is_down: bool,
}

/// A frame that was received.
#[derive(Clone, Copy)]
struct Arrived {
    length: usize,
    /// When it came in, and when it was fetched.
    arrival: HostTime,
    taken: HostTime,
}

impl<'a> Port<'a> {
    fn new(main: MainPort, link: &'a mut dyn Link) -> Self {
        Port { main, link, buffer: [0; MAX_FRAME], arrived: None, is_down: false }
    }

    /// Waits for a frame until `deadline`, where none is there yet.
    fn look(&mut self, deadline: HostTime, clock: &dyn Clock) -> Result<(), LinkError> {
        if self.arrived.is_some() {
            return Ok(());
        }
        match self.link.receive(&mut self.buffer, deadline) {
            Ok(None) => {}
            Ok(Some(length)) => {
                let taken = clock.now();
                let arrival = self.link.arrival().unwrap_or(taken).min(taken);
                self.arrived = Some(Arrived { length, arrival, taken });
                self.is_down = false;
            }
            Err(LinkError::Down) => self.is_down = true,
            Err(error) => return Err(error),
        }
        Ok(())
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        match self.link.send(frame) {
            Err(LinkError::Down) => self.is_down = true,
            other => other?,
        }
        Ok(())
    }
}

/// A watch that breaks the service off once `stop` is set.
pub fn until_set(stop: &AtomicBool) -> impl FnMut(&mut Segment) -> ControlFlow<()> {
    |_| match stop.load(Ordering::Relaxed) {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    }
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

    /// Runs a frame through the segment, in place; where its answer leaves.
    fn take(
        &mut self,
        from: MainPort,
        frame: &mut [u8],
        arrival: HostTime,
    ) -> (Option<MainPort>, ControlFlow<()>) {
        if !carries_datagrams(frame) || forget(&mut self.sent, frame) {
            self.served.ignored += 1;
            return (None, ControlFlow::Continue(()));
        }
        if self.advance(arrival).is_break() {
            return (None, ControlFlow::Break(()));
        }
        self.served.frames += 1;
        let at = self.in_segment(arrival);
        let back = self.segment.process_from(from, frame, at);
        let flow = (self.watch)(self.segment);
        let Some((_, leaves)) = back else { return (None, flow) };
        self.served.answered += 1;
        if self.sent.len() == REMEMBERED {
            self.sent.pop_front();
        }
        self.sent.push_back(frame.to_vec());
        (Some(leaves), flow)
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
