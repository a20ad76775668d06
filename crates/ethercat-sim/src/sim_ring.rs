//! A ring in the process: two links into one segment, and the clock that all share.

use crate::segment::{MainPort, Segment, frame_spacing};
use crate::sim_link::VirtualClock;
use omnibase_ethercat_wire::frame::MAX_FRAME;
use omnibase_ethercat_wire::{Clock, HostTime, Link, LinkError};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

/// Segment and cables behind both interfaces.
#[derive(Debug)]
struct Ring {
    segment: Segment,
    clock: VirtualClock,
    /// When each interface's cable is free for the next frame.
    free_at: [HostTime; 2],
    /// Frames on their way back to each interface, in the order of their arrival.
    returning: [VecDeque<(HostTime, Vec<u8>)>; 2],
}

/// One of the MainDevice's two interfaces, in virtual time.
#[derive(Clone, Debug)]
pub struct SimPort {
    ring: Rc<RefCell<Ring>>,
    port: MainPort,
}

/// Both interfaces of a segment whose ring was closed, and the clock that belongs to them.
pub fn ring_in_process(segment: Segment) -> (SimPort, SimPort, VirtualClock) {
    let clock = VirtualClock::new();
    clock.advance_to(segment.now());
    let free_at = [segment.now(); 2];
    let ring = Ring { segment, clock: clock.clone(), free_at, returning: Default::default() };
    let ring = Rc::new(RefCell::new(ring));
    let primary = SimPort { ring: ring.clone(), port: MainPort::Primary };
    (primary, SimPort { ring, port: MainPort::Redundant }, clock)
}

impl SimPort {
    /// Does something with the segment, brought up to the present.
    pub fn with_segment<T>(&self, act: impl FnOnce(&mut Segment) -> T) -> T {
        let mut ring = self.ring.borrow_mut();
        let now = ring.clock.now();
        ring.segment.advance(now);
        act(&mut ring.segment)
    }
}

impl Link for SimPort {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        if frame.len() > MAX_FRAME {
            return Err(LinkError::FrameTooLong { limit: MAX_FRAME, found: frame.len() });
        }
        let mut ring = self.ring.borrow_mut();
        let own = self.port as usize;
        let start = ring.clock.now().max(ring.free_at[own]);
        ring.segment.advance(start);
        ring.free_at[own] = start + frame_spacing(frame.len());
        let mut frame = frame.to_vec();
        if let Some((back, port)) = ring.segment.process_from(self.port, &mut frame, start) {
            let returning = &mut ring.returning[port as usize];
            let at = returning.partition_point(|(arrival, _)| *arrival <= back);
            returning.insert(at, (back, frame));
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        let mut ring = self.ring.borrow_mut();
        let limit = deadline.max(ring.clock.now());
        let returning = &mut ring.returning[self.port as usize];
        let arrived = returning.front().is_some_and(|(arrival, _)| *arrival <= limit);
        let Some((arrival, frame)) = returning.pop_front_if(|_| arrived) else {
            ring.clock.advance_to(limit);
            ring.segment.advance(limit);
            return Ok(None);
        };
        ring.clock.advance_to(arrival);
        let now = ring.clock.now();
        ring.segment.advance(now);
        let length = frame.len().min(buffer.len());
        buffer[..length].copy_from_slice(&frame[..length]);
        Ok(Some(length))
    }
}
