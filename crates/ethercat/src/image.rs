//! The process image: where each SubDevice's data stand, and which datagrams of which frames carry them.
//!
//! All outputs stand in one stretch of the logical address space and all inputs in another. Where every SubDevice
//! allows LRW, the inputs and outputs of each SubDevice share logical addresses instead, so that one datagram of
//! the longer of both serves both ways (12 bytes of header and the shorter half are saved).
//!
//! SubDevices whose data go in the same cycles stand together, and each such [`Turn`] has frames of its own.
//!
//! A SyncManager's data are never torn over two datagrams unless they are longer than one can carry.

mod fit;
mod frames;
mod member;
#[cfg(test)]
mod tests;
mod turns;

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use crate::address_range;
use crate::config::LrwPermission;
use crate::process_data::{Direction, LogicalBits};
use crate::subdevice::SubDevice;

pub use fit::CycleFit;
pub use frames::{DatagramPlan, FramePlan, Role, Touch};
pub(crate) use frames::{FEWEST_DATAGRAMS, FILLER_LENGTH};
pub use member::{Area, Member, Packing};
pub use turns::Turn;

/// Logical address of the first byte of the image.
pub const LOGICAL_START: u32 = 0x0001_0000;
/// The most frames that one cycle may need: the first datagram's index must tell them apart.
pub const MAX_FRAMES: usize = 128;

/// How process data travel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// LWR for outputs, LRD for inputs.
    Separate,
    /// LRW for both.
    Combined,
}

/// What the cycle does with the reference clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ClockUse {
    /// No clock is distributed.
    #[default]
    None,
    /// The reference clock is distributed; the cycle may follow it.
    Distribute {
        /// Position of the reference clock.
        reference: u16,
    },
    /// The reference clock follows the host: it is written each cycle, then distributed.
    Steer {
        /// Position of the reference clock.
        reference: u16,
    },
}

impl ClockUse {
    /// Position of the reference clock.
    pub fn reference(self) -> Option<u16> {
        match self {
            ClockUse::None => None,
            ClockUse::Distribute { reference } | ClockUse::Steer { reference } => Some(reference),
        }
    }
}

/// Why no image can be planned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlanError {
    /// More process data than frames of one cycle.
    #[error("the process data need {needed} frames a cycle, the limit is {limit}")]
    TooManyFrames {
        /// Frames needed.
        needed: usize,
        /// Limit.
        limit: usize,
    },
    /// The clock's SubDevice isn't there or has no clock.
    #[error("SubDevice {position} was chosen as reference clock and has no distributed clock")]
    NoReferenceClock {
        /// Position.
        position: u16,
    },
}

/// Where one SyncManager's process data stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Placement {
    /// Position of the SubDevice.
    pub position: u16,
    /// Its SyncManager.
    pub sync_manager: u8,
    /// The way of the data.
    pub direction: Direction,
    /// Byte offset in [`ProcessImage::outputs`] or [`ProcessImage::inputs`].
    pub offset: usize,
    /// Its bits in the logical address space.
    pub logical: LogicalBits,
}

impl Placement {
    /// Bytes of the image that the data touch.
    pub fn bytes(&self) -> core::ops::Range<usize> {
        let end = u32::from(self.logical.start_bit) + self.logical.bit_length;
        self.offset..self.offset + end.div_ceil(8) as usize
    }
}

/// One direction's stretch of the logical address space.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Region {
    /// Logical address of its first byte.
    pub start: u32,
    /// Bytes.
    pub length: usize,
}

/// The whole layout of a cycle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImagePlan {
    /// How process data travel.
    pub transport: Transport,
    /// What is done with the reference clock.
    pub clock: ClockUse,
    /// Outputs.
    pub outputs: Region,
    /// Inputs; with [`Transport::Combined`] the same addresses as the outputs.
    pub inputs: Region,
    /// Where each SyncManager's data stand, by position.
    pub placements: Vec<Placement>,
    /// In which cycles each SubDevice's data go, by position.
    pub turns: Vec<Turn>,
    /// The frames, those of every cycle first.
    pub frames: Vec<FramePlan>,
    /// Data bytes that the one datagram of acyclic work may carry.
    pub spare_length: usize,
}

impl ImagePlan {
    /// Plans the image and the frames of all SubDevices, which stand in the order of their positions.
    pub fn new(members: &[Member], clock: ClockUse) -> Result<Self, PlanError> {
        if let Some(position) = clock.reference()
            && members.get(usize::from(position)).is_none_or(|member| member.clock.is_none())
        {
            return Err(PlanError::NoReferenceClock { position });
        }
        let both_ways = members.iter().any(|member| !member.areas.is_empty());
        let combined = both_ways && members.iter().all(|member| member.lrw == LrwPermission::Allowed);
        let start =
            members.first().map_or(LOGICAL_START, |first| address_range::logical_start(first.station));
        let mut plan = ImagePlan {
            transport: if combined { Transport::Combined } else { Transport::Separate },
            clock,
            outputs: Region { start, length: 0 },
            inputs: Region { start, length: 0 },
            placements: Vec::new(),
            turns: turns::spread(members),
            frames: Vec::new(),
            spare_length: members.iter().map(Member::longest_acyclic).max().unwrap_or(0),
        };
        if combined {
            plan.place_combined(members)
        } else {
            plan.place_separate(members)
        }
        plan.placements.sort_by_key(|placement| (placement.position, placement.sync_manager));
        plan.frames = frames::plan(&plan, members);
        let needed = plan.frames.len();
        if needed > MAX_FRAMES {
            return Err(PlanError::TooManyFrames { needed, limit: MAX_FRAMES });
        }
        Ok(plan)
    }

    fn place_separate(&mut self, members: &[Member]) {
        let mut cursor = BitCursor::new(self.outputs.start);
        for (member, begins) in self.by_turn(members) {
            cursor.align_if(begins);
            self.place(member, Direction::Outputs, &mut cursor);
        }
        self.outputs.length = cursor.length(self.outputs.start);
        let start = cursor.next_byte();
        let mut cursor = BitCursor::new(start);
        self.inputs.start = start;
        for (member, begins) in self.by_turn(members) {
            cursor.align_if(begins);
            self.place(member, Direction::Inputs, &mut cursor);
        }
        self.inputs.length = cursor.length(start);
    }

    /// A SubDevice takes its outputs out of a datagram before it puts its inputs in, so its own may overlap; those
    /// of different SubDevices may not, for one would read the other's inputs as outputs.
    fn place_combined(&mut self, members: &[Member]) {
        let mut cursor = BitCursor::new(self.outputs.start);
        for (member, begins) in self.by_turn(members) {
            cursor.align_if(begins);
            let ways = |way| member.areas.iter().any(|area| area.direction == way);
            let mut inputs = cursor;
            if ways(Direction::Outputs) && ways(Direction::Inputs) {
                cursor.align();
                inputs = cursor;
            }
            self.place(member, Direction::Outputs, &mut cursor);
            self.place(member, Direction::Inputs, &mut inputs);
            cursor = cursor.max(inputs);
        }
        let length = cursor.length(self.outputs.start);
        (self.outputs.length, self.inputs.length) = (length, length);
    }

    /// The members in the order in which their data stand, and whether a turn begins with each: bytes are of one turn.
    fn by_turn<'a>(&self, members: &'a [Member]) -> Vec<(&'a Member, bool)> {
        let mut order: Vec<_> = members.iter().zip(&self.turns).collect();
        order.sort_by_key(|(_, turn)| **turn);
        let begins = |n: usize| n > 0 && order[n - 1].1 != order[n].1;
        (0..order.len()).map(|n| (order[n].0, begins(n))).collect()
    }

    fn place(&mut self, member: &Member, direction: Direction, cursor: &mut BitCursor) {
        let start = match direction {
            Direction::Outputs => self.outputs.start,
            Direction::Inputs => self.inputs.start,
        };
        for area in member.areas.iter().filter(|area| area.direction == direction) {
            let logical = cursor.take(area);
            self.placements.push(Placement {
                position: member.position,
                sync_manager: area.sync_manager,
                direction,
                offset: (logical.address - start) as usize,
                logical,
            });
        }
    }

    /// An image of this plan's size, all zero.
    pub fn image(&self) -> ProcessImage {
        ProcessImage {
            outputs: vec![0; self.outputs.length].into_boxed_slice(),
            inputs: vec![0; self.inputs.length].into_boxed_slice(),
        }
    }

    /// Where the data of the SubDevice at `position` stand, by SyncManager.
    pub fn placements_of(&self, position: u16) -> &[Placement] {
        let start = self.placements.partition_point(|placement| placement.position < position);
        let end = self.placements.partition_point(|placement| placement.position <= position);
        &self.placements[start..end]
    }

    /// Tells each SubDevice's SyncManagers where their data stand; its FMMUs follow from that.
    pub fn apply(&self, subdevices: &mut [SubDevice]) {
        for subdevice in subdevices {
            let placements = self.placements_of(subdevice.position);
            for sync_manager in &mut subdevice.sync_managers {
                let mine = |placement: &&Placement| placement.sync_manager == sync_manager.index;
                sync_manager.logical = placements.iter().find(mine).map(|placement| placement.logical);
            }
        }
    }
}

/// The process data as bytes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ProcessImage {
    /// What the MainDevice sends; the application writes it before each exchange.
    pub outputs: Box<[u8]>,
    /// What the SubDevices sent last; only a complete exchange changes it.
    pub inputs: Box<[u8]>,
}

/// The next free bit of the logical address space.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct BitCursor {
    address: u32,
    bit: u8,
}

impl BitCursor {
    fn new(address: u32) -> Self {
        BitCursor { address, bit: 0 }
    }

    fn align(&mut self) {
        *self = BitCursor::new(self.next_byte());
    }

    fn align_if(&mut self, begins: bool) {
        if begins {
            self.align();
        }
    }

    fn next_byte(&self) -> u32 {
        self.address + u32::from(self.bit > 0)
    }

    fn length(&self, start: u32) -> usize {
        (self.next_byte() - start) as usize
    }

    /// Takes the bits of an area: small ones share a byte where the SubDevice can map bits.
    fn take(&mut self, area: &Area) -> LogicalBits {
        let fits = u32::from(self.bit) + area.bit_length <= 8;
        if area.packing == Packing::Bytes || !fits {
            self.align();
        }
        let logical = LogicalBits { address: self.address, start_bit: self.bit, bit_length: area.bit_length };
        let end = u32::from(self.bit) + area.bit_length;
        self.address += end / 8;
        self.bit = (end % 8) as u8;
        if area.packing == Packing::Bytes {
            self.align();
        }
        logical
    }
}
