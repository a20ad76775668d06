//! Which cycle the frames of a plan fit into: their time on the cable, and their way through all chips and back.

use alloc::collections::BTreeMap;
use core::fmt;
use core::time::Duration;

use super::{FramePlan, ImagePlan, Turn};
use crate::wire::frame::{DATAGRAM_OVERHEAD, FIRST_DATAGRAM, MAX_FRAME, MIN_FRAME};

/// Preamble, checksum and the silence between frames, bytes.
const WIRE_OVERHEAD: usize = 24;
/// Time of a byte at 100 Mbit/s, ns.
const BYTE_NS: u64 = 80;
/// A frame's way through one SubDevice and a short cable, there and back, where nobody measured it: two chips passed twice at
/// 300 ns and some cable come to less than a microsecond (ETG.1000.3: the delay of a chip is about 1 us at most).
const ESTIMATE_NS: u64 = 1000;
/// Bytes of an access to registers of one SubDevice beside the process data, on the way to OP and in diagnosis.
const ACCESS: usize = 8 + DATAGRAM_OVERHEAD;
/// Frames of such accesses in one cycle.
const ACCESS_FRAMES: usize = 2;
/// The part of a cycle until its frames must be back.
const SHARE: (u64, u64) = (9, 10);

/// What the frames of a cycle need.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CycleFit {
    /// Frames with process data in the fullest cycle.
    pub frames: usize,
    /// All frames of a busy cycle one behind the other on the cable: process data, a mailbox, accesses to registers.
    pub wire: Duration,
    /// From the last bit's leaving until it is back.
    pub propagation: Duration,
    /// Whether the distributed clocks measured that; else it is estimated by the number of SubDevices.
    pub is_measured: bool,
}

impl CycleFit {
    /// The shortest time after which frames can be back.
    pub fn needed(&self) -> Duration {
        self.wire + self.propagation
    }

    /// The shortest cycle that fits, whose frames must be back within nine tenths of it; whole microseconds.
    pub fn shortest(&self) -> Duration {
        let ns = self.needed().as_nanos() as u64 * SHARE.1 / SHARE.0;
        Duration::from_micros(ns.div_ceil(1000))
    }
}

impl fmt::Display for CycleFit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} us: {} {} {} us on the cable and {}{} us through all SubDevices and back, which is to happen within \
             nine tenths of a cycle",
            self.shortest().as_micros(),
            self.frames,
            if self.frames == 1 { "frame takes" } else { "frames take" },
            self.wire.as_micros(),
            if self.is_measured { "" } else { "about " },
            self.propagation.as_micros()
        )
    }
}

/// Frames and bytes of a cycle in which it is the turn of `one`: of each rate the most that can go beside it.
fn beside(one: Turn, turns: &BTreeMap<Turn, (usize, usize)>) -> (usize, usize) {
    let mut most: BTreeMap<u16, (usize, usize)> = BTreeMap::new();
    let met = turns.iter().filter(|(turn, _)| turn.meets(one));
    for (turn, (frames, bytes)) in met.filter(|(turn, _)| turn.every != one.every || **turn == one) {
        let rate = most.entry(turn.every).or_default();
        *rate = (rate.0.max(*frames), rate.1.max(*bytes));
    }
    most.values().fold((0, 0), |(frames, bytes), rate| (frames + rate.0, bytes + rate.1))
}

impl ImagePlan {
    /// Which cycle fits, for so many SubDevices; `propagation` as [`crate::Bus::propagation`] measured it.
    pub fn fit(&self, subdevices: usize, propagation: Option<Duration>) -> CycleFit {
        let on_wire = |bytes: usize| bytes.max(MIN_FRAME) + WIRE_OVERHEAD;
        let length = |frame: &FramePlan| {
            let spare = if frame.carries_spare { self.spare_length + DATAGRAM_OVERHEAD } else { 0 };
            let data: usize = frame.datagrams.iter().map(|one| one.length + DATAGRAM_OVERHEAD).sum();
            on_wire(FIRST_DATAGRAM + data + spare)
        };
        let mut turns: BTreeMap<Turn, (usize, usize)> = BTreeMap::new();
        for frame in &self.frames {
            let (frames, bytes) = turns.entry(frame.turn).or_default();
            (*frames, *bytes) = (*frames + 1, *bytes + length(frame));
        }
        let slow = turns.keys().filter(|turn| **turn != Turn::EACH_CYCLE);
        let fullest = slow.map(|turn| beside(*turn, &turns)).max_by_key(|(_, bytes)| *bytes);
        let (frames, planned) = fullest.unwrap_or_else(|| beside(Turn::EACH_CYCLE, &turns));
        let accesses = (subdevices * ACCESS).min(ACCESS_FRAMES * MAX_FRAME);
        let bytes = planned + on_wire(FIRST_DATAGRAM + accesses);
        let estimate = Duration::from_nanos(subdevices as u64 * ESTIMATE_NS);
        CycleFit {
            frames,
            wire: Duration::from_nanos(bytes as u64 * BYTE_NS),
            propagation: propagation.unwrap_or(estimate),
            is_measured: propagation.is_some(),
        }
    }
}
