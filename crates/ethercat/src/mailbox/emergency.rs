//! A ring of emergencies that counts what it had to drop.

use crate::wire::HostTime;
use crate::wire::coe::Emergency;
use alloc::collections::VecDeque;

/// An emergency and when it was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReceivedEmergency {
    /// When it was read from the mailbox.
    pub time: HostTime,
    /// What it says.
    pub emergency: Emergency,
}

/// The newest emergencies of a SubDevice; the oldest give way and are counted.
#[derive(Clone, Debug)]
pub struct EmergencyRing {
    ring: VecDeque<ReceivedEmergency>,
    dropped: u64,
}

impl EmergencyRing {
    /// Emergencies that are kept until they are taken.
    pub const CAPACITY: usize = 16;

    pub(super) fn new() -> Self {
        EmergencyRing { ring: VecDeque::with_capacity(Self::CAPACITY), dropped: 0 }
    }

    pub(super) fn push(&mut self, entry: ReceivedEmergency) {
        if self.ring.len() == Self::CAPACITY {
            self.ring.pop_front();
            self.dropped += 1;
        }
        self.ring.push_back(entry);
    }

    /// Takes the oldest.
    pub fn take(&mut self) -> Option<ReceivedEmergency> {
        self.ring.pop_front()
    }

    /// Emergencies that are waiting.
    pub fn len(&self) -> usize {
        self.ring.len()
    }

    /// Whether none is waiting.
    pub fn is_empty(&self) -> bool {
        self.ring.is_empty()
    }

    /// Emergencies that were overwritten before anyone took them.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }
}
