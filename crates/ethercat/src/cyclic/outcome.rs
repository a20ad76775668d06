//! What a cycle came to: its frames, the inputs, the segment's state.

use super::{Goal, Step, TransitionError};

/// What became of one cycle's frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exchange {
    /// Every frame came back and every working counter of process data is right; the inputs are new.
    Complete,
    /// SubDevices that are known to be missing took no part, everyone else did; the others' inputs are new.
    Without {
        /// SubDevices that aren't operational, see [`CyclicBus::health`](super::CyclicBus::health).
        not_operational: u16,
    },
    /// A working counter isn't what it should be; the inputs are those of the last complete exchange.
    ShortCount {
        /// Frame of the cycle, from 0.
        frame: u16,
        /// Datagram in that frame, from 0.
        datagram: u16,
        /// Working counter that it should have.
        expected: u16,
        /// Working counter that it has.
        received: u16,
    },
    /// Frames weren't back at the deadline; the inputs are those of the last complete exchange.
    Lost {
        /// Frames with process data that are missing.
        lost: u16,
        /// Frames with process data that were sent in this cycle.
        sent: u16,
    },
}

/// AL status of all SubDevices together, as one broadcast read brings it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SegmentStatus {
    /// SubDevices that answered.
    pub answered: u16,
    /// All their AL statuses (0x0130) ORed.
    pub bits: u16,
}

/// How old a SubDevice's inputs are, and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freshness {
    /// Of the last exchange.
    Fresh,
    /// A frame is missing, but not the one with this SubDevice's inputs: they are held back to match the others.
    HeldBack,
    /// The frame with its inputs is missing.
    FrameLost,
    /// The working counter of the datagram with its inputs is wrong.
    ShortCount,
    /// The SubDevice isn't operational.
    NotOperational,
    /// The frame with its inputs goes each n-th cycle, and not in this one: they are so many cycles old.
    Resting {
        /// Cycles since they came.
        cycles: u64,
    },
}

/// Which state the segment is in, as far as this bus brought it there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TransitionStatus {
    /// PRE-OP or whatever the set-up left; frames go round.
    Standby,
    /// On the way.
    Moving {
        /// Where to.
        goal: Goal,
        /// How far.
        step: Step,
    },
    /// There.
    Reached(Goal),
    /// A transition failed; ask again, or end.
    Failed(TransitionError),
}
