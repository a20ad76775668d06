//! Sends all frames of a cycle, then takes them back: no frame of another cycle passes.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::counters::CycleCounters;
use super::frame::{CyclicFrame, Flight, FrameBytes};
use crate::wire::frame::{FIRST_DATAGRAM, MAX_FRAME};
use crate::wire::{HostTime, Link, LinkError};

/// Frames that aren't ours, beyond which a cycle stops listening: a babbling neighbour must not hold it.
const STRAYS_PER_CYCLE: usize = 64;

/// The link and all frames that go over it.
#[derive(Debug)]
pub(super) struct Exchanger<L> {
    pub link: L,
    pub frames: Vec<CyclicFrame>,
    /// Sequence number of the first frame of this cycle; every frame has its own.
    sequence: u32,
    /// Where the next frame is received.
    inbox: FrameBytes,
    /// The link said that it is down, and no frame of ours has come back since.
    pub is_down: bool,
    pub counters: CycleCounters,
}

impl<L: Link> Exchanger<L> {
    pub fn new(link: L, frames: Vec<CyclicFrame>) -> Self {
        Exchanger {
            link,
            frames,
            sequence: 0,
            inbox: Box::new([0; MAX_FRAME]),
            is_down: false,
            counters: CycleCounters::default(),
        }
    }

    /// Sends every frame that is marked [`Flight::Sent`], then waits for all of them until `deadline`; returns how
    /// many were lost. A link that is down loses them; `Err` where the port itself is broken.
    pub fn exchange(&mut self, deadline: HostTime) -> Result<usize, LinkError> {
        self.counters.cycles += 1;
        self.sequence = self.sequence.wrapping_add(self.frames.len() as u32);
        let mut outstanding = 0;
        for (number, frame) in self.frames.iter_mut().enumerate() {
            if frame.flight == Flight::Sent {
                frame.stamp(self.sequence.wrapping_add(number as u32));
                match self.link.send(frame.bytes()) {
                    Ok(()) => {}
                    // Awaited all the same: only who receives learns that the link is up again.
                    Err(LinkError::Down) => self.is_down = true,
                    Err(error) => return Err(error),
                }
                outstanding += 1;
            }
        }
        self.counters.frames_sent += outstanding as u64;
        let mut strays = 0;
        while outstanding > 0 && strays < STRAYS_PER_CYCLE {
            let length = match self.link.receive(&mut self.inbox[..], deadline) {
                Ok(Some(length)) => length,
                Ok(None) => break,
                Err(LinkError::Down) => {
                    self.is_down = true;
                    break;
                }
                Err(error) => return Err(error),
            };
            if self.take(length) {
                outstanding -= 1;
            } else {
                strays += 1;
            }
        }
        self.counters.frames_lost += outstanding as u64;
        Ok(outstanding)
    }

    /// Whether the received frame was one that is awaited.
    #[inline]
    fn take(&mut self, length: usize) -> bool {
        let number = self.inbox[FIRST_DATAGRAM + 1].wrapping_sub(self.sequence as u8);
        if let Some(frame) = self.frames.get_mut(usize::from(number))
            && frame.flight == Flight::Sent
            && frame.is_answered_by(&self.inbox, length)
        {
            core::mem::swap(&mut frame.back, &mut self.inbox);
            frame.flight = Flight::Back;
            self.is_down = false;
            return true;
        }
        self.count_stray(usize::from(number), length);
        false
    }

    #[cold]
    fn count_stray(&mut self, number: usize, length: usize) {
        let duplicate = self
            .frames
            .get(number)
            .is_some_and(|frame| frame.flight == Flight::Back && frame.is_answered_by(&self.inbox, length));
        let short = self.frames.get(number).is_some_and(|frame| frame.is_cut_short(&self.inbox, length));
        if duplicate {
            self.counters.duplicate += 1;
        } else if short {
            self.counters.short += 1;
        } else if self.frames.iter().any(|frame| frame.resembles(&self.inbox, length)) {
            self.counters.late += 1;
        } else {
            self.counters.foreign += 1;
        }
    }
}
