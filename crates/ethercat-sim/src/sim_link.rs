//! A segment in the process: a link and a clock that share virtual time.

use crate::segment::{Segment, frame_spacing};
use omnibase_ethercat_wire::frame::MAX_FRAME;
use omnibase_ethercat_wire::{Clock, HostTime, Link, LinkError};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Virtual time: stands still until somebody sleeps or waits for a frame. Clones show the same time.
#[derive(Clone, Debug, Default)]
pub struct VirtualClock {
    now: Arc<AtomicU64>,
}

impl VirtualClock {
    /// A clock that shows 0.
    pub fn new() -> Self {
        Self::default()
    }

    /// Goes forward to `instant`; never back.
    pub fn advance_to(&self, instant: HostTime) {
        self.now.fetch_max(instant.0, Ordering::Relaxed);
    }
}

impl Clock for VirtualClock {
    fn now(&self) -> HostTime {
        HostTime(self.now.load(Ordering::Relaxed))
    }

    fn sleep_until(&mut self, instant: HostTime) {
        self.advance_to(instant);
    }
}

/// The MainDevice's end of the cable to a simulated segment, in virtual time.
///
/// A frame that is sent is processed at once, and can be received when the time has come at which its last bit
/// is back. Frames that are sent before the cable is free wait their turn.
#[derive(Debug)]
pub struct SimLink {
    segment: Segment,
    clock: VirtualClock,
    /// When the cable is free for the next frame.
    free_at: HostTime,
    /// Frames on their way back, in the order of their arrival.
    returning: VecDeque<(HostTime, Vec<u8>)>,
    /// Buffers for reuse, so that a cycle allocates nothing.
    spare: Vec<Vec<u8>>,
}

/// A link into `segment` and the clock that belongs to it.
pub fn in_process(segment: Segment) -> (SimLink, VirtualClock) {
    let clock = VirtualClock::new();
    clock.advance_to(segment.now());
    let link = SimLink {
        free_at: segment.now(),
        segment,
        clock: clock.clone(),
        returning: VecDeque::new(),
        spare: Vec::new(),
    };
    (link, clock)
}

impl SimLink {
    /// The segment, brought up to the present.
    pub fn segment_mut(&mut self) -> &mut Segment {
        self.segment.advance(self.clock.now());
        &mut self.segment
    }

    /// The segment as it was when the link was last used.
    pub fn segment(&self) -> &Segment {
        &self.segment
    }
}

impl Link for SimLink {
    fn is_connected(&self) -> Option<bool> {
        Some(self.segment.link_up())
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        if frame.len() > MAX_FRAME {
            return Err(LinkError::FrameTooLong { limit: MAX_FRAME, found: frame.len() });
        }
        let start = self.clock.now().max(self.free_at);
        self.segment.advance(start);
        self.free_at = start + frame_spacing(frame.len());
        let mut buffer = self.spare.pop().unwrap_or_else(|| Vec::with_capacity(MAX_FRAME));
        buffer.clear();
        buffer.extend_from_slice(frame);
        match self.segment.process(&mut buffer, start) {
            Some(back) => {
                // Another way may be shorter than that of the frame before: keep the order of arrival.
                let at = self.returning.partition_point(|(arrival, _)| *arrival <= back);
                self.returning.insert(at, (back, buffer));
            }
            None => self.spare.push(buffer),
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        let limit = deadline.max(self.clock.now());
        let arrived = self.returning.front().is_some_and(|(arrival, _)| *arrival <= limit);
        let Some((arrival, frame)) = self.returning.pop_front_if(|_| arrived) else {
            self.clock.advance_to(limit);
            self.segment.advance(limit);
            return Ok(None);
        };
        self.clock.advance_to(arrival);
        self.segment.advance(arrival.max(self.clock.now()));
        let length = frame.len().min(buffer.len());
        buffer[..length].copy_from_slice(&frame[..length]);
        self.spare.push(frame);
        Ok(Some(length))
    }
}
