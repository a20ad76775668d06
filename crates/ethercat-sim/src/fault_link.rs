//! A link that loses, delays, repeats, swaps and falsifies frames, reproducibly.
//!
//! Random faults come from a seed; [`Injection`]s hit exactly the n-th frame or datagram. Nothing here knows the
//! time: delays are counted in frames that are sent meanwhile, so a run is the same on any clock.

use omnibase_ethercat_wire::Command;
use omnibase_ethercat_wire::bytes::{put_u16, u16_at};
use omnibase_ethercat_wire::frame::{DATAGRAM_HEADER, Datagrams, FIRST_DATAGRAM, MAX_FRAME};
use omnibase_ethercat_wire::{HostTime, Link, LinkError, RingState};
use std::collections::VecDeque;

/// Requests whose answers are still expected; older ones are taken for lost.
const OUTSTANDING: usize = 256;

/// How often random faults happen, in parts per million of the frames. Each frame suffers at most one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultRates {
    /// The request never reaches the segment.
    pub drop_request_ppm: u32,
    /// The segment did its work, but the answer is lost.
    pub drop_answer_ppm: u32,
    /// The answer comes only after 1 to `delay_frames` more frames were sent.
    pub delay_ppm: u32,
    /// The most frames that a delayed answer is late by.
    pub delay_frames: u32,
    /// The answer comes twice.
    pub duplicate_ppm: u32,
    /// The answer comes after the one that follows it.
    pub reorder_ppm: u32,
    /// One bit of the answer is flipped behind the Ethernet header. (A real network card would drop the frame.)
    pub corrupt_ppm: u32,
    /// One datagram's working counter in the answer is too small by one, where it is not 0.
    pub short_count_ppm: u32,
}

/// Where an [`Injection`] hits; counted from 0 in the order of sending.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// The n-th frame.
    Frame(u64),
    /// The n-th datagram, counted through all frames; what happens to whole frames happens to the one it is in.
    Datagram(u64),
}

/// What happens to a frame or datagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultAction {
    /// The request never reaches the segment.
    DropRequest,
    /// The segment did its work, but the answer is lost.
    DropAnswer,
    /// The answer comes only after so many more frames were sent.
    Delay {
        /// Frames sent meanwhile.
        frames: u64,
    },
    /// The answer comes twice.
    Duplicate,
    /// The answer comes after the one that follows it.
    Reorder,
    /// This bit of the answer is flipped, counted from the frame's first bit; nothing where the frame is shorter.
    FlipBit {
        /// Index of the bit.
        bit: usize,
    },
    /// Working counters in the answer are replaced: of the datagram, or of all datagrams of the frame.
    WorkingCounter(u16),
    /// Working counters in the answer are one less than they are, where they are not 0.
    ShortCount,
    /// No SubDevice acts on the datagram (or on any of the frame): it comes back as it was sent, counted 0.
    NotProcessed,
}

/// A fault at an exact place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Injection {
    /// Where.
    pub target: Target,
    /// What.
    pub action: FaultAction,
}

/// What happened so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultCounts {
    /// Frames that were given to send.
    pub frames: u64,
    /// Datagrams in them.
    pub datagrams: u64,
    /// Frames that suffered a fault.
    pub faults: u64,
}

/// A request on its way.
#[derive(Debug)]
struct Outstanding {
    signature: Signature,
    /// What happens to the answer, and to which datagram of it (all where `None`).
    actions: Vec<(FaultAction, Option<usize>)>,
    /// Commands to put back: offset of the datagram, its command code.
    restore: Vec<(usize, u8)>,
}

/// What an answer has in common with its request: length, first command and index, EtherCAT header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Signature {
    length: usize,
    header: u16,
    command: u8,
    index: u8,
}

impl Signature {
    fn of(frame: &[u8]) -> Option<Self> {
        (frame.len() > FIRST_DATAGRAM + 1).then(|| Signature {
            length: frame.len(),
            header: u16_at(frame, 14),
            command: frame[FIRST_DATAGRAM],
            index: frame[FIRST_DATAGRAM + 1],
        })
    }
}

/// An answer that is held back.
#[derive(Debug)]
struct Held {
    frame: Vec<u8>,
    release: Release,
}

#[derive(Debug, PartialEq, Eq)]
enum Release {
    /// When so many frames have been sent in all.
    AtFrame(u64),
    /// After the next answer.
    AfterNext,
    /// With the next receive.
    Now,
}

/// A wrapper of a link in which things go wrong.
#[derive(Debug)]
pub struct FaultLink<L> {
    inner: L,
    rates: FaultRates,
    injections: Vec<Injection>,
    random: u64,
    counts: FaultCounts,
    outstanding: VecDeque<Outstanding>,
    held: VecDeque<Held>,
}

impl<L: Link> FaultLink<L> {
    /// A link without faults yet; `seed` decides where random ones will hit.
    pub fn new(inner: L, seed: u64) -> Self {
        FaultLink {
            inner,
            rates: FaultRates::default(),
            injections: Vec::new(),
            random: seed,
            counts: FaultCounts::default(),
            outstanding: VecDeque::new(),
            held: VecDeque::new(),
        }
    }

    /// Sets how often random faults happen from now on.
    pub fn set_rates(&mut self, rates: FaultRates) {
        self.rates = rates;
    }

    /// Adds a fault at an exact place.
    pub fn inject(&mut self, injection: Injection) {
        self.injections.push(injection);
    }

    /// Frames and datagrams that were sent, and faults that happened.
    pub fn counts(&self) -> FaultCounts {
        self.counts
    }

    /// The link inside.
    pub fn inner(&self) -> &L {
        &self.inner
    }

    /// The link inside, for changes.
    pub fn inner_mut(&mut self) -> &mut L {
        &mut self.inner
    }

    /// Gives the link inside back.
    pub fn into_inner(self) -> L {
        self.inner
    }

    /// The next random number (splitmix64).
    fn random(&mut self) -> u64 {
        self.random = self.random.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.random;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn random_below(&mut self, limit: u64) -> u64 {
        self.random() % limit.max(1)
    }

    /// The random fault of one frame.
    fn random_action(&mut self, frame: &[u8], datagrams: u64) -> Option<(FaultAction, Option<usize>)> {
        let rates = self.rates;
        let mut dice = self.random_below(1_000_000) as u32;
        let mut hit = |rate: u32| {
            let hit = dice < rate;
            dice = dice.wrapping_sub(rate);
            hit
        };
        let action = if hit(rates.drop_request_ppm) {
            FaultAction::DropRequest
        } else if hit(rates.drop_answer_ppm) {
            FaultAction::DropAnswer
        } else if hit(rates.delay_ppm) {
            FaultAction::Delay { frames: 1 + self.random_below(u64::from(rates.delay_frames)) }
        } else if hit(rates.duplicate_ppm) {
            FaultAction::Duplicate
        } else if hit(rates.reorder_ppm) {
            FaultAction::Reorder
        } else if hit(rates.corrupt_ppm) {
            let bits = (frame.len().saturating_sub(14) * 8) as u64;
            FaultAction::FlipBit { bit: 14 * 8 + self.random_below(bits) as usize }
        } else if hit(rates.short_count_ppm) {
            return Some((
                FaultAction::WorkingCounter(u16::MAX),
                Some(self.random_below(datagrams) as usize),
            ));
        } else {
            return None;
        };
        Some((action, None))
    }

    /// The injections that hit the frame with number `frame`, whose first datagram has number `first`.
    fn injected(&self, frame: u64, first: u64, count: u64) -> Vec<(FaultAction, Option<usize>)> {
        let hit = |injection: &Injection| match injection.target {
            Target::Frame(n) => (n == frame).then_some((injection.action, None)),
            Target::Datagram(n) => {
                (first..first + count).contains(&n).then(|| (injection.action, Some((n - first) as usize)))
            }
        };
        self.injections.iter().filter_map(hit).collect()
    }

    /// Finds the request that this answer belongs to.
    fn take_request(&mut self, answer: &[u8]) -> Option<Outstanding> {
        let signature = Signature::of(answer)?;
        let at = self.outstanding.iter().position(|request| request.signature == signature)?;
        self.outstanding.remove(at)
    }

    /// Does to an answer what is to happen to it; `None` where it doesn't come now.
    fn falsify(&mut self, mut frame: Vec<u8>) -> Option<Vec<u8>> {
        let Some(request) = self.take_request(&frame) else { return Some(frame) };
        for (offset, command) in request.restore {
            frame[offset] = command;
        }
        let mut hold = None;
        for (action, datagram) in request.actions {
            match action {
                FaultAction::DropRequest | FaultAction::NotProcessed => {}
                FaultAction::DropAnswer => return None,
                FaultAction::Delay { frames } => hold = Some(Release::AtFrame(self.counts.frames + frames)),
                FaultAction::Reorder => hold = Some(Release::AfterNext),
                FaultAction::Duplicate => {
                    self.held.push_back(Held { frame: frame.clone(), release: Release::Now });
                }
                FaultAction::FlipBit { bit } => {
                    if let Some(byte) = frame.get_mut(bit / 8) {
                        *byte ^= 1 << (bit % 8);
                    }
                }
                FaultAction::WorkingCounter(value) => {
                    change_counters(&mut frame, datagram, |_| value);
                }
                FaultAction::ShortCount => {
                    change_counters(&mut frame, datagram, |count| count.saturating_sub(1))
                }
            }
        }
        match hold {
            Some(release) => {
                self.held.push_back(Held { frame, release });
                None
            }
            None => Some(frame),
        }
    }

    fn deliver(&mut self, frame: &[u8], buffer: &mut [u8]) -> usize {
        let length = frame.len().min(buffer.len());
        buffer[..length].copy_from_slice(&frame[..length]);
        length
    }
}

/// Offsets of the datagrams of a frame, and where their counters stand.
fn datagrams(frame: &[u8]) -> Vec<(usize, usize)> {
    let Ok(datagrams) = Datagrams::new(frame) else { return Vec::new() };
    datagrams
        .map_while(Result::ok)
        .map(|datagram| (datagram.offset, datagram.offset + DATAGRAM_HEADER + datagram.header.length))
        .collect()
}

fn change_counters(frame: &mut [u8], only: Option<usize>, change: impl Fn(u16) -> u16) {
    for (n, (_, counter)) in datagrams(frame).into_iter().enumerate() {
        if only.is_none_or(|only| only == n) {
            let present = u16_at(frame, counter);
            put_u16(frame, counter, change(present));
        }
    }
}

impl<L: Link> Link for FaultLink<L> {
    fn ring(&self) -> Option<RingState> {
        self.inner.ring()
    }

    fn is_connected(&self) -> Option<bool> {
        self.inner.is_connected()
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        let places = datagrams(frame);
        let count = places.len() as u64;
        let mut actions = self.injected(self.counts.frames, self.counts.datagrams, count);
        actions.extend(self.random_action(frame, count));
        self.counts.frames += 1;
        self.counts.datagrams += count;
        self.counts.faults += u64::from(!actions.is_empty());
        if actions.iter().any(|(action, _)| *action == FaultAction::DropRequest) {
            return Ok(());
        }
        let mut request = frame.to_vec();
        let mut restore = Vec::new();
        for (action, only) in &actions {
            if *action == FaultAction::NotProcessed {
                for (n, (offset, _)) in places.iter().enumerate() {
                    if only.is_none_or(|only| only == n) {
                        restore.push((*offset, request[*offset]));
                        request[*offset] = Command::Nop.code();
                    }
                }
            }
        }
        if let Some(signature) = Signature::of(&request) {
            if self.outstanding.len() == OUTSTANDING {
                self.outstanding.pop_front();
            }
            self.outstanding.push_back(Outstanding { signature, actions, restore });
        }
        self.inner.send(&request)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        let sent = self.counts.frames;
        let due = self.held.iter().position(|held| match held.release {
            Release::Now => true,
            Release::AtFrame(frame) => frame <= sent,
            Release::AfterNext => false,
        });
        if let Some(held) = due.and_then(|at| self.held.remove(at)) {
            return Ok(Some(self.deliver(&held.frame, buffer)));
        }
        loop {
            let mut frame = vec![0; MAX_FRAME.max(buffer.len())];
            let Some(length) = self.inner.receive(&mut frame, deadline)? else { return Ok(None) };
            frame.truncate(length);
            // Answers that waited for this one to overtake them.
            let overtaken = self.held.iter().filter(|held| held.release == Release::AfterNext).count();
            let Some(frame) = self.falsify(frame) else { continue };
            for held in self.held.iter_mut().filter(|held| held.release == Release::AfterNext).take(overtaken)
            {
                held.release = Release::Now;
            }
            return Ok(Some(self.deliver(&frame, buffer)));
        }
    }
}

#[cfg(test)]
mod tests;
