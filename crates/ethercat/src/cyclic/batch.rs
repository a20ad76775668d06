//! The same small register access to many SubDevices, in frames of their own beside the process data.

use alloc::vec::Vec;

use super::frame::{CyclicFrame, Flight, Purpose};
use crate::found::Found;
use crate::image::{FEWEST_DATAGRAMS, FILLER_LENGTH};
use crate::wire::frame::DATAGRAM_OVERHEAD;
use crate::wire::{Address, Command};

/// Frames beside the process data in one cycle: 160 SubDevices.
pub(super) const BATCH_FRAMES: usize = 2;
/// Attempts at one access that has to succeed.
pub(super) const ATTEMPTS: u8 = 6;
/// Bytes kept for the indices' sake.
const FILLERS: usize = (FEWEST_DATAGRAMS - 1) * (FILLER_LENGTH + DATAGRAM_OVERHEAD);

/// How one access ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ItemState {
    /// To be sent.
    Open { attempts: u8 },
    /// In a frame of this cycle.
    Sent { attempts: u8 },
    /// Done by one SubDevice; `data` is what came back.
    Answered,
    /// Refused or not heard, whatever was tried; what the last attempt found.
    Failed { found: Found },
}

/// One access.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item {
    pub position: u16,
    pub command: Command,
    pub station: u16,
    pub register: u16,
    pub length: u8,
    pub data: [u8; 8],
    pub state: ItemState,
}

/// What a batch writes or reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Access {
    /// Read so many bytes.
    Read { register: u16, length: u8 },
    /// Write the first bytes of these.
    Write { register: u16, length: u8, data: [u8; 8] },
}

impl Access {
    pub fn write(register: u16, bytes: &[u8]) -> Self {
        let mut data = [0; 8];
        data[..bytes.len()].copy_from_slice(bytes);
        Access::Write { register, length: bytes.len() as u8, data }
    }
}

/// A list of accesses of which as many as fit are sent in each cycle until all have ended.
#[derive(Clone, Debug)]
pub(super) struct Batch {
    items: Vec<Item>,
    unfinished: usize,
    /// Answered attempts at one access; lost frames are repeated [`ATTEMPTS`] times anyway.
    attempts: u8,
}

impl Batch {
    /// Room for one access to each SubDevice.
    pub fn new(capacity: usize) -> Self {
        Batch { items: Vec::with_capacity(capacity), unfinished: 0, attempts: ATTEMPTS }
    }

    /// Begins a new list, whose accesses are tried so many times while SubDevices refuse them.
    pub fn begin(&mut self, attempts: u8) {
        self.attempts = attempts;
        self.items.clear();
        self.unfinished = 0;
    }

    /// Adds an access; more than one per SubDevice are ignored, so that nothing is allocated.
    pub fn add(&mut self, position: u16, station: u16, access: Access) {
        if self.items.len() == self.items.capacity() {
            return;
        }
        let (command, register, length, data) = match access {
            Access::Read { register, length } => (Command::Fprd, register, length, [0; 8]),
            Access::Write { register, length, data } => (Command::Fpwr, register, length, data),
        };
        let state = ItemState::Open { attempts: 0 };
        self.items.push(Item { position, command, station, register, length, data, state });
        self.unfinished += 1;
    }

    /// Whether every access has ended.
    pub fn is_finished(&self) -> bool {
        self.unfinished == 0
    }

    pub fn items(&self) -> &[Item] {
        &self.items
    }

    /// Fills the batch frames with what is open.
    pub fn fill(&mut self, frames: &mut [CyclicFrame]) {
        let mut open = self.items.iter_mut().enumerate().filter_map(|(number, item)| match item.state {
            ItemState::Open { attempts } => Some((number, item, attempts)),
            _ => None,
        });
        let mut next = open.next();
        for frame in frames {
            frame.truncate(0);
            while let Some((number, item, attempts)) = next.take() {
                let length = usize::from(item.length);
                let address = Address::station(item.station, item.register);
                if frame.room(FILLERS) < length
                    || !frame.push(Purpose::Batch(number as u16), item.command, address, length)
                {
                    next = Some((number, item, attempts));
                    break;
                }
                if item.command == Command::Fpwr
                    && let Some(slot) = frame.slots().last().copied()
                {
                    frame.data_mut(slot.data()).copy_from_slice(&item.data[..length]);
                }
                item.state = ItemState::Sent { attempts: attempts + 1 };
                next = open.next();
            }
            if frame.slots().is_empty() {
                break;
            }
            while frame.slots().len() < FEWEST_DATAGRAMS {
                frame.push(Purpose::Filler, Command::Nop, Address::broadcast(0), FILLER_LENGTH);
            }
            frame.flight = Flight::Sent;
        }
    }

    /// Takes the answers out of the batch frames.
    pub fn collect(&mut self, frames: &mut [CyclicFrame]) {
        for frame in frames.iter_mut().filter(|frame| frame.flight == Flight::Back) {
            frame.read_counters();
            for slot in frame.slots() {
                let Purpose::Batch(number) = slot.purpose else { continue };
                let Some(item) = self.items.get_mut(usize::from(number)) else { continue };
                let ItemState::Sent { attempts } = item.state else { continue };
                if slot.received == 1 {
                    if item.command == Command::Fprd {
                        let data = &frame.back[slot.data()];
                        item.data[..data.len()].copy_from_slice(data);
                    }
                    item.state = ItemState::Answered;
                    self.unfinished -= 1;
                } else if attempts >= self.attempts {
                    item.state = ItemState::Failed { found: Found::WorkingCounter(slot.received) };
                    self.unfinished -= 1;
                } else {
                    item.state = ItemState::Open { attempts };
                }
            }
        }
        for item in &mut self.items {
            if let ItemState::Sent { attempts } = item.state {
                if attempts >= ATTEMPTS {
                    item.state = ItemState::Failed { found: Found::Nothing };
                    self.unfinished -= 1;
                } else {
                    item.state = ItemState::Open { attempts };
                }
            }
        }
    }
}
