//! One prebuilt frame: stamped, sent, recognised when it comes back.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::counters::CommandSet;
use crate::image::{Role, Turn};
use crate::wire::bytes::{put_u16, put_u32, u16_at};
use crate::wire::frame::{
    DATAGRAM_HEADER, DATAGRAM_OVERHEAD, ETHERNET_HEADER, ETHERTYPE, FIRST_DATAGRAM, MAIN_DEVICE_MAC,
    MAX_FRAME, PROCESSED_BIT,
};
use crate::wire::{Address, Command};

/// Bytes of any frame.
pub(super) type FrameBytes = Box<[u8; MAX_FRAME]>;

/// The most datagrams that fit: two data bytes each.
pub(super) const MOST_DATAGRAMS: usize = (MAX_FRAME - FIRST_DATAGRAM) / (DATAGRAM_OVERHEAD + 2);

/// The source address with which a frame comes back, and the EtherType behind it.
const PROCESSED_SOURCE: u64 = {
    let [a, b, c, d, e, f] = MAIN_DEVICE_MAC;
    let [high, low] = ETHERTYPE.to_be_bytes();
    u64::from_le_bytes([a | PROCESSED_BIT, b, c, d, e, f, high, low])
};

/// What a slot of a frame is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    /// A datagram of the plan.
    Planned(Role),
    /// The one datagram of acyclic work.
    Spare,
    /// An item of the batch.
    Batch(u16),
    /// Carries a part of the sequence number.
    Filler,
}

/// One datagram in a prebuilt frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slot {
    /// What it is for.
    pub purpose: Purpose,
    /// Offset of the header in the frame.
    offset: u16,
    /// Bytes of data.
    length: u16,
    /// Expected working counter.
    pub expected: u16,
    /// A smaller count that is right while known SubDevices are missing.
    pub accepted: u16,
    /// What SubDevices on their way back may add to it.
    pub leeway: u16,
    /// What came back last.
    pub received: u16,
    /// Cycles in which that wasn't the expected one.
    pub short_counts: u64,
    /// Which bits of the header's first eight bytes (command, index, address, length and flags) come back as sent.
    unchanged: u64,
}

impl Slot {
    fn header_at(&self) -> usize {
        usize::from(self.offset)
    }

    /// Where its data stand in the frame.
    pub fn data(&self) -> core::ops::Range<usize> {
        let start = self.header_at() + DATAGRAM_HEADER;
        start..start + usize::from(self.length)
    }
}

/// What became of a frame in this cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Flight {
    /// Not sent.
    Idle,
    /// Sent, not back.
    Sent,
    /// Back; its bytes are in [`CyclicFrame::back`].
    Back,
}

/// A frame that is sent again and again.
#[derive(Clone, Debug)]
pub(super) struct CyclicFrame {
    /// As it is sent. Everything that SubDevices change stays zero in here, so nothing has to be cleared.
    out: FrameBytes,
    length: usize,
    slots: Vec<Slot>,
    /// In which cycles it goes.
    pub turn: Turn,
    /// The cycle from which its inputs are.
    pub taken_in: u64,
    /// As it came back.
    pub back: FrameBytes,
    /// What became of it.
    pub flight: Flight,
    /// Every command that was ever in it.
    pub commands: CommandSet,
}

/// Bits of the first eight header bytes that a command leaves alone: auto-increment and broadcast commands count
/// the SubDevices in their position field. A SubDevice whose port 0 is closed, as one at the end whose cables are swapped has it,
/// marks frames as circulating once.
fn unchanged_bits(command: Command) -> u64 {
    const CIRCULATING: u64 = 1 << (48 + 14);
    match command {
        Command::Aprd | Command::Apwr | Command::Aprw | Command::Armw => !(0xFFFF_0000 | CIRCULATING),
        Command::Brd | Command::Bwr | Command::Brw | Command::Nop => !(0xFFFF_0000 | CIRCULATING),
        _ => !CIRCULATING,
    }
}

#[inline]
fn word_at(bytes: &[u8; MAX_FRAME], offset: usize) -> u64 {
    bytes[offset..].first_chunk().map_or(0, |word| u64::from_le_bytes(*word))
}

impl CyclicFrame {
    pub fn new(most_datagrams: usize) -> Self {
        let mut out = Box::new([0; MAX_FRAME]);
        out[..6].fill(0xFF);
        out[6..12].copy_from_slice(&MAIN_DEVICE_MAC);
        out[12..14].copy_from_slice(&ETHERTYPE.to_be_bytes());
        put_u16(&mut out[..], ETHERNET_HEADER, 0x1000);
        CyclicFrame {
            out,
            length: FIRST_DATAGRAM,
            slots: Vec::with_capacity(most_datagrams),
            turn: Turn::EACH_CYCLE,
            taken_in: 0,
            back: Box::new([0; MAX_FRAME]),
            flight: Flight::Idle,
            commands: CommandSet::default(),
        }
    }

    pub fn slots(&self) -> &[Slot] {
        &self.slots
    }

    pub fn slots_mut(&mut self) -> &mut [Slot] {
        &mut self.slots
    }

    fn set_length(&mut self, length: usize) {
        self.length = length;
        put_u16(&mut self.out[..], ETHERNET_HEADER, 0x1000 | (length - FIRST_DATAGRAM) as u16);
    }

    /// Data bytes that one more datagram could carry, with room for `fillers` kept.
    pub fn room(&self, fillers: usize) -> usize {
        if self.slots.len() == self.slots.capacity() {
            return 0;
        }
        (MAX_FRAME - self.length).saturating_sub(DATAGRAM_OVERHEAD + fillers)
    }

    /// Appends a datagram of zeros; `false` where it doesn't fit. Allocates nothing.
    pub fn push(&mut self, purpose: Purpose, command: Command, address: Address, length: usize) -> bool {
        if self.slots.len() == self.slots.capacity() || self.length + DATAGRAM_OVERHEAD + length > MAX_FRAME {
            return false;
        }
        let offset = self.length;
        let end = offset + DATAGRAM_OVERHEAD + length;
        self.out[offset..end].fill(0);
        self.out[offset] = command.code();
        put_u32(&mut self.out[..], offset + 2, address.raw());
        put_u16(&mut self.out[..], offset + 6, length as u16);
        if let Some(last) = self.slots.last() {
            self.out[last.header_at() + 7] |= 0x80;
        }
        self.slots.push(Slot {
            purpose,
            offset: offset as u16,
            length: length as u16,
            expected: 0,
            accepted: 0,
            leeway: 0,
            received: 0,
            short_counts: 0,
            unchanged: unchanged_bits(command),
        });
        self.commands.add(command);
        self.set_length(end);
        true
    }

    /// Drops datagrams until `count` are left.
    pub fn truncate(&mut self, count: usize) {
        let Some(first) = self.slots.get(count) else { return };
        let length = first.header_at();
        self.slots.truncate(count);
        if let Some(last) = self.slots.last() {
            self.out[last.header_at() + 7] &= !0x80;
        }
        self.set_length(length);
    }

    /// The data of a slot, as they will be sent.
    #[inline]
    pub fn data_mut(&mut self, range: core::ops::Range<usize>) -> &mut [u8] {
        &mut self.out[range]
    }

    /// Turns one datagram into a NOP, or back into its command, for the next cycle.
    pub fn set_command(&mut self, slot: usize, command: Command) {
        self.out[self.slots[slot].header_at()] = command.code();
    }

    /// Turns one datagram to another address, from the next cycle on.
    pub fn set_address(&mut self, slot: usize, address: Address) {
        let at = self.slots[slot].header_at();
        put_u32(&mut self.out[..], at + 2, address.raw());
    }

    /// Writes the sequence number into the indices, lowest byte first. Three datagrams carry 24 bits of it.
    #[inline]
    pub fn stamp(&mut self, sequence: u32) {
        let bytes = sequence.to_le_bytes();
        for (number, slot) in self.slots.iter().enumerate() {
            self.out[usize::from(slot.offset) + 1] = bytes[number & 3];
        }
    }

    /// The frame as it is sent.
    #[inline]
    pub fn bytes(&self) -> &[u8] {
        &self.out[..self.length]
    }

    /// Whether `frame` is this one: processed by a SubDevice, every datagram with the command, index, address and
    /// length that were sent.
    #[inline]
    pub fn is_answered_by(&self, frame: &[u8; MAX_FRAME], length: usize) -> bool {
        length >= self.length
            && word_at(frame, 6) == PROCESSED_SOURCE
            && u16_at(&frame[..], ETHERNET_HEADER) == u16_at(&self.out[..], ETHERNET_HEADER)
            && self.slots.iter().all(|slot| {
                let at = slot.header_at();
                (word_at(frame, at) ^ word_at(&self.out, at)) & slot.unchanged == 0
            })
    }

    /// Whether `frame` is this one of this very cycle, but has lost its end.
    pub fn is_cut_short(&self, frame: &[u8; MAX_FRAME], length: usize) -> bool {
        length < self.length
            && self.resembles(frame, length)
            && self.slots.first().is_some_and(|slot| {
                let index = slot.header_at() + 1;
                frame[index] == self.out[index]
            })
    }

    /// Whether `frame` looks like this one of another cycle: the same first datagram but for its index.
    pub fn resembles(&self, frame: &[u8; MAX_FRAME], length: usize) -> bool {
        const INDEX: u64 = 0xFF00;
        const MORE: u64 = 1 << 63;
        let Some(slot) = self.slots.first() else { return false };
        let changed = word_at(frame, slot.header_at()) ^ word_at(&self.out, slot.header_at());
        length >= FIRST_DATAGRAM + DATAGRAM_OVERHEAD
            && word_at(frame, 6) == PROCESSED_SOURCE
            && changed & slot.unchanged & !INDEX & !MORE == 0
    }

    /// Reads every working counter of the frame that came back; whether all are as expected.
    #[inline]
    pub fn read_counters(&mut self) -> bool {
        let mut right = true;
        for slot in &mut self.slots {
            let at = usize::from(slot.offset) + DATAGRAM_HEADER + usize::from(slot.length);
            slot.received = u16_at(&self.back[..], at);
            right &= slot.received == slot.expected;
        }
        right
    }
}
