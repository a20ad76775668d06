//! A link that records what passes through it.

use crate::Direction;
use omnibase_ethercat_wire::{Clock, HostTime, Link, LinkError, RingState};
use std::io;

/// Takes recorded frames.
pub trait FrameSink {
    /// Takes one frame; `unix_ns` is its time in nanoseconds since 1970-01-01 UTC.
    fn record(&mut self, unix_ns: u64, direction: Direction, frame: &[u8]) -> io::Result<()>;
}

/// Wraps a link and hands every frame that was sent or received to a sink.
///
/// A sink that fails doesn't stop the bus: the recording ends there, and [`RecordingLink::failure`] says why.
pub struct RecordingLink<L> {
    link: L,
    clock: Box<dyn Clock>,
    unix_offset_ns: u64,
    sink: Box<dyn FrameSink>,
    failure: Option<io::Error>,
}

impl<L: Link> RecordingLink<L> {
    /// Records what passes through `link` into `sink`, with the times of `clock`.
    ///
    /// `unix_offset_ns` is added to them to get nanoseconds since 1970-01-01 UTC (0 leaves virtual time as it is).
    pub fn new(link: L, clock: Box<dyn Clock>, unix_offset_ns: u64, sink: Box<dyn FrameSink>) -> Self {
        RecordingLink { link, clock, unix_offset_ns, sink, failure: None }
    }

    /// Why recording has ended, if it has.
    pub fn failure(&self) -> Option<&io::Error> {
        self.failure.as_ref()
    }

    fn record(&mut self, direction: Direction, frame: &[u8]) {
        if self.failure.is_some() {
            return;
        }
        let unix_ns = self.clock.now().0.saturating_add(self.unix_offset_ns);
        self.failure = self.sink.record(unix_ns, direction, frame).err();
    }
}

impl<L: Link> Link for RecordingLink<L> {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        // Before the send: the answer of a near segment must not carry an earlier time.
        self.record(Direction::Outbound, frame);
        self.link.send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        let received = self.link.receive(buffer, deadline)?;
        if let Some(length) = received {
            self.record(Direction::Inbound, &buffer[..length]);
        }
        Ok(received)
    }

    fn arrival(&self) -> Option<HostTime> {
        self.link.arrival()
    }

    fn ring(&self) -> Option<RingState> {
        self.link.ring()
    }

    fn is_connected(&self) -> Option<bool> {
        self.link.is_connected()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::{Cell, RefCell};
    use std::rc::Rc;

    /// Gives back what was sent.
    struct Mirror(Vec<u8>);
    impl Link for Mirror {
        fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
            self.0 = frame.to_vec();
            Ok(())
        }
        fn receive(&mut self, buffer: &mut [u8], _: HostTime) -> Result<Option<usize>, LinkError> {
            let frame = std::mem::take(&mut self.0);
            buffer[..frame.len()].copy_from_slice(&frame);
            Ok((!frame.is_empty()).then_some(frame.len()))
        }
    }

    /// One nanosecond per look.
    struct Ticks(Cell<u64>);
    impl Clock for Ticks {
        fn now(&self) -> HostTime {
            self.0.set(self.0.get() + 1);
            HostTime(self.0.get())
        }
        fn sleep_until(&mut self, instant: HostTime) {
            self.0.set(instant.0);
        }
    }

    type Record = (u64, Direction, Vec<u8>);

    struct Shared(Rc<RefCell<Vec<Record>>>, usize);
    impl FrameSink for Shared {
        fn record(&mut self, unix_ns: u64, direction: Direction, frame: &[u8]) -> io::Result<()> {
            if self.0.borrow().len() == self.1 {
                return Err(io::Error::other("disk full"));
            }
            self.0.borrow_mut().push((unix_ns, direction, frame.to_vec()));
            Ok(())
        }
    }

    fn link(records: &Rc<RefCell<Vec<Record>>>, limit: usize) -> RecordingLink<Mirror> {
        let sink = Box::new(Shared(records.clone(), limit));
        RecordingLink::new(Mirror(Vec::new()), Box::new(Ticks(Cell::new(0))), 1000, sink)
    }

    #[test]
    fn both_directions_are_recorded_in_order_and_silence_is_not() {
        let records = Rc::default();
        let mut link = link(&records, 10);
        let mut buffer = [0; 2048];
        link.send(&[1, 2, 3]).unwrap();
        assert_eq!(link.receive(&mut buffer, HostTime(0)), Ok(Some(3)));
        assert_eq!(link.receive(&mut buffer, HostTime(0)), Ok(None));
        let expected =
            vec![(1001, Direction::Outbound, vec![1, 2, 3]), (1002, Direction::Inbound, vec![1, 2, 3])];
        assert_eq!(*records.borrow(), expected);
    }

    #[test]
    fn a_sink_that_fails_ends_the_recording_but_not_the_traffic() {
        let records = Rc::default();
        let mut link = link(&records, 1);
        let mut buffer = [0; 2048];
        link.send(&[1]).unwrap();
        assert_eq!(link.receive(&mut buffer, HostTime(0)), Ok(Some(1)));
        link.send(&[2]).unwrap();
        assert_eq!(records.borrow().len(), 1);
        assert_eq!(link.failure().unwrap().to_string(), "disk full");
    }
}
