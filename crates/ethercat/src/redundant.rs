//! Cable redundancy: two interfaces at the ends of a ring, seen as one link.
//!
//! Each frame leaves as two copies at once. In a whole ring the first is processed by everybody and comes back
//! at the other end, while the second passes backwards, processed by nobody. Where the ring is broken each copy
//! turns at the break and comes back where it left, processed by its half.
//!
//! Both copies together are the answer: working counters add up, and what one half changed is taken from its
//! copy. So the very cycle of the break loses nothing.
//!
//! Frames carry an expected time of the reference clock (see [`crate::cyclic`]), so the half without the reference
//! keeps its time as well as the host's clock allows, until the ring is whole again.

use alloc::boxed::Box;
use alloc::collections::VecDeque;
use core::time::Duration;

use crate::wire::bytes::{put_u16, u16_at};
use crate::wire::frame::{DATAGRAM_HEADER, Datagrams, MAX_FRAME, PROCESSED_BIT};
use crate::wire::{Clock, Command, HostTime, Link, LinkError, RingState, register};

/// Frames whose answers are still awaited.
const MOST_OUTSTANDING: usize = 16;
/// Copies in a row that didn't come back, after which the next ones aren't waited for.
const GIVEN_UP_AFTER: u32 = 3;
/// How long one interface is waited at before a look at the other.
const SLICE: Duration = Duration::from_micros(5);
/// The second copy differs in the last byte of its source address.
const MARK_AT: usize = 11;
const MARK: u8 = 0x01;

/// One copy of a frame.
#[derive(Debug)]
struct Copy {
    bytes: Box<[u8; MAX_FRAME]>,
    length: usize,
    /// The interface at which it came back.
    back_at: Option<usize>,
}

impl Copy {
    fn new() -> Self {
        Copy { bytes: Box::new([0; MAX_FRAME]), length: 0, back_at: None }
    }
}

/// A frame that was sent, and its two copies.
#[derive(Debug)]
struct Outstanding {
    sent: Copy,
    copies: [Copy; 2],
    delivered: bool,
}

/// Two interfaces at the ends of one ring.
#[derive(Debug)]
pub struct RedundantLink<A, B, C> {
    primary: A,
    redundant: B,
    clock: C,
    outstanding: VecDeque<Outstanding>,
    spare: VecDeque<Outstanding>,
    scratch: Box<[u8; MAX_FRAME]>,
    /// Answers of each copy that stayed away, in a row.
    missing: [u32; 2],
    /// The most SubDevices that answered a broadcast: all of them.
    total: u16,
    state: RingState,
}

impl<A: Link, B: Link, C: Clock> RedundantLink<A, B, C> {
    /// A ring from `primary`, which leads to position 0, to `redundant`.
    pub fn new(primary: A, redundant: B, clock: C) -> Self {
        let one = || Outstanding { sent: Copy::new(), copies: [Copy::new(), Copy::new()], delivered: false };
        RedundantLink {
            primary,
            redundant,
            clock,
            outstanding: VecDeque::with_capacity(MOST_OUTSTANDING),
            spare: (0..MOST_OUTSTANDING).map(|_| one()).collect(),
            scratch: Box::new([0; MAX_FRAME]),
            missing: [0; 2],
            total: 0,
            state: RingState::Unknown,
        }
    }

    /// Looks at one interface until `deadline`; `true` where something came.
    fn look(&mut self, port: usize, deadline: HostTime) -> Result<Option<usize>, LinkError> {
        let received = match port {
            0 => self.primary.receive(&mut self.scratch[..], deadline),
            _ => self.redundant.receive(&mut self.scratch[..], deadline),
        };
        match received {
            // The other interface is what redundancy is for.
            Err(LinkError::Down) => Ok(None),
            other => other,
        }
    }

    /// Puts what was received in its place; `false` where it is nothing of ours.
    fn sort(&mut self, port: usize, length: usize) -> bool {
        let frame = &self.scratch[..length];
        if length <= MARK_AT {
            return false;
        }
        let second = usize::from(frame[MARK_AT] & MARK != self.mark_of_first());
        for one in self.outstanding.iter_mut().rev() {
            let copy = &mut one.copies[second];
            if copy.back_at.is_none() && is_answer(&one.sent.bytes[..one.sent.length], frame) {
                copy.bytes[..length].copy_from_slice(frame);
                copy.length = length;
                copy.back_at = Some(port);
                self.missing[second] = 0;
                return true;
            }
        }
        false
    }

    fn mark_of_first(&self) -> u8 {
        crate::wire::frame::MAIN_DEVICE_MAC[5] & MARK
    }

    /// The oldest frame that is complete, or as complete as it will be.
    fn ready(&self, is_over: bool) -> Option<usize> {
        self.outstanding.iter().position(|one| {
            let [first, second] = [0, 1].map(|n| one.copies[n].back_at.is_some());
            let [skip_first, skip_second] = self.missing.map(|missing| missing >= GIVEN_UP_AFTER);
            let is_ready = match (first, second) {
                (true, true) => true,
                (true, false) => is_over || skip_second,
                (false, true) => is_over || skip_first,
                (false, false) => false,
            };
            is_ready && !one.delivered
        })
    }

    /// Both copies as one answer.
    fn deliver(&mut self, at: usize, buffer: &mut [u8]) -> usize {
        let one = &mut self.outstanding[at];
        one.delivered = true;
        for (copy, missing) in one.copies.iter().zip(&mut self.missing) {
            if copy.back_at.is_none() {
                *missing = missing.saturating_add(1);
            }
        }
        let came = [0, 1].map(|n| one.copies[n].back_at);
        let length = one.sent.length;
        if let Some(counts) = merge(one, buffer) {
            self.learn(came, counts);
        }
        length
    }

    /// What the ways of both copies, and who answered them, say about the ring.
    ///
    /// A copy that went all the way or turned is proof by itself; one that stayed away proves nothing until several
    /// did, for cables lose frames.
    fn learn(&mut self, came: [Option<usize>; 2], [first, second]: [u16; 2]) {
        let is_broken = matches!(self.state, RingState::Broken { .. });
        let [no_first, no_second] = self.missing.map(|missing| missing >= GIVEN_UP_AFTER);
        let broken = |before, behind| RingState::Broken { before, behind };
        match came {
            [Some(1), None | Some(0)] | [None, Some(0)] => {
                self.total = self.total.max(first.saturating_add(second));
                self.state = RingState::Whole;
            }
            [Some(0), Some(1)] => {
                self.total = self.total.max(first.saturating_add(second));
                self.state = broken(first, self.total - second);
            }
            // Whoever is behind an end from which nothing comes back is reached by nobody from there.
            [Some(0), None] if no_second => self.state = broken(first, self.total.max(first)),
            [None, Some(1)] if no_first => self.state = broken(0, self.total.saturating_sub(second)),
            // One copy turned: the other turns at the same place, unless that is known better.
            [Some(0), None] if !is_broken => self.state = broken(first, first),
            [None, Some(1)] if !is_broken => {
                let place = self.total.saturating_sub(second);
                self.state = broken(place, place);
            }
            // Nothing new, or both ways at once: it broke or was mended just now, and the next frame tells.
            _ => {}
        }
    }
}

/// Whether `frame` answers `sent`: the same datagrams by command, index and length.
fn is_answer(sent: &[u8], frame: &[u8]) -> bool {
    if sent.len() > frame.len() {
        return false;
    }
    let (Ok(ours), Ok(theirs)) = (Datagrams::new(sent), Datagrams::new(frame)) else { return false };
    ours.zip(theirs).all(|pair| match pair {
        (Ok(ours), Ok(theirs)) => {
            let (ours, theirs) = (ours.header, theirs.header);
            (ours.command, ours.index, ours.length) == (theirs.command, theirs.index, theirs.length)
        }
        _ => false,
    })
}

/// Writes both copies as one frame into `buffer`; how many SubDevices answered its broadcast of the AL status, by copy.
fn merge(one: &Outstanding, buffer: &mut [u8]) -> Option<[u16; 2]> {
    let (sent, length) = (&one.sent.bytes[..one.sent.length], one.sent.length.min(buffer.len()));
    let back = |n: usize| one.copies[n].back_at.is_some().then(|| &one.copies[n].bytes[..]);
    let (first, second) = (back(0), back(1));
    let processed = [first, second].into_iter().flatten().any(|copy| copy[6] & PROCESSED_BIT != 0);
    buffer[..length].copy_from_slice(&first.or(second).unwrap_or(sent)[..length]);
    buffer[6..12].copy_from_slice(&sent[6..12]);
    if processed {
        buffer[6] |= PROCESSED_BIT;
    }
    let mut counts = None;
    let Ok(datagrams) = Datagrams::new(sent) else { return None };
    for datagram in datagrams.map_while(Result::ok) {
        let (start, size) = (datagram.offset + DATAGRAM_HEADER, datagram.header.length);
        let end = start + size;
        if end + 2 > length {
            break;
        }
        // A frame that turns at a closed port 0, as the second copy does at a break, is marked as circulating there.
        buffer[datagram.offset + 7] = sent[datagram.offset + 7];
        let is_broadcast_read = Command::from_code(datagram.header.command) == Some(Command::Brd);
        let count = |copy: Option<&[u8]>| copy.map_or(0, |copy| u16_at(copy, end));
        let answered = [count(first), count(second)];
        if let (Some(first), Some(second)) = (first, second) {
            for at in start..end {
                // What only one half changed stands in its copy alone.
                buffer[at] = if is_broadcast_read {
                    first[at] | second[at]
                } else {
                    first[at] ^ second[at] ^ sent[at]
                };
            }
            // The interrupt field, of all.
            let events = u16_at(first, datagram.offset + 8) | u16_at(second, datagram.offset + 8);
            put_u16(buffer, datagram.offset + 8, events);
        }
        put_u16(buffer, end, answered[0].wrapping_add(answered[1]));
        if is_broadcast_read && (datagram.header.address >> 16) as u16 == register::AL_STATUS {
            counts = Some(answered);
        }
    }
    counts
}

/// Turns positions into those of the half behind a break, which counts from its own first.
fn count_from(frame: &mut [u8], first: u16) {
    let offsets = |frame: &[u8], number: usize| -> Option<(usize, u8)> {
        let datagram = Datagrams::new(frame).ok()?.map_while(Result::ok).nth(number)?;
        Some((datagram.offset, datagram.header.command))
    };
    let mut number = 0;
    while let Some((offset, command)) = offsets(frame, number) {
        if matches!(
            Command::from_code(command),
            Some(Command::Aprd | Command::Apwr | Command::Aprw | Command::Armw)
        ) {
            let position = u16_at(frame, offset + 2);
            put_u16(frame, offset + 2, position.wrapping_add(first));
        }
        number += 1;
    }
}

impl<A: Link, B: Link, C: Clock> Link for RedundantLink<A, B, C> {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        if frame.len() > MAX_FRAME {
            return Err(LinkError::FrameTooLong { limit: MAX_FRAME, found: frame.len() });
        }
        let Some(mut one) = self.spare.pop_front().or_else(|| self.outstanding.pop_front()) else {
            return Ok(());
        };
        one.delivered = false;
        one.sent.bytes[..frame.len()].copy_from_slice(frame);
        one.sent.length = frame.len();
        one.copies.iter_mut().for_each(|copy| copy.back_at = None);
        self.outstanding.push_back(one);
        let first = self.primary.send(frame);
        self.scratch[..frame.len()].copy_from_slice(frame);
        if frame.len() > MARK_AT {
            self.scratch[MARK_AT] ^= MARK;
        }
        if let RingState::Broken { behind, .. } = self.state {
            count_from(&mut self.scratch[..frame.len()], behind);
        }
        let second = self.redundant.send(&self.scratch[..frame.len()]);
        // One of them is enough.
        first.or(second)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        loop {
            for port in [0, 1] {
                while let Some(length) = self.look(port, HostTime(0))? {
                    if !self.sort(port, length) {
                        buffer[..length].copy_from_slice(&self.scratch[..length]);
                        return Ok(Some(length));
                    }
                }
            }
            let now = self.clock.now();
            let is_over = now >= deadline;
            if let Some(at) = self.ready(is_over) {
                return Ok(Some(self.deliver(at, buffer)));
            }
            if is_over {
                // What has come as a whole makes room; what hasn't may still come late.
                while self.outstanding.len() > MOST_OUTSTANDING / 2
                    && let Some(one) = self.outstanding.pop_front()
                {
                    self.spare.push_back(one);
                }
                return Ok(None);
            }
            let until = (now + SLICE).min(deadline);
            if let Some(length) = self.look(0, until)?
                && !self.sort(0, length)
            {
                buffer[..length].copy_from_slice(&self.scratch[..length]);
                return Ok(Some(length));
            }
        }
    }

    fn ring(&self) -> Option<RingState> {
        Some(self.state)
    }

    fn is_connected(&self) -> Option<bool> {
        match (self.primary.is_connected(), self.redundant.is_connected()) {
            (Some(true), _) | (_, Some(true)) => Some(true),
            (Some(false), Some(false)) => Some(false),
            _ => None,
        }
    }
}
