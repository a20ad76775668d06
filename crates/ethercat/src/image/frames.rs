//! Which datagrams of which frames carry the image, and the working counter that each must bring back.

use alloc::vec;
use alloc::vec::Vec;

use super::{ClockUse, ImagePlan, Member, Placement, Region, Transport, Turn};
use crate::subdevice::{DcWidth, Direction};
use crate::wire::frame::{DATAGRAM_OVERHEAD, FIRST_DATAGRAM, MAX_FRAME};
use crate::wire::{Address, Command, register};

/// Datagrams that every frame has at least: their indices together are its sequence number.
pub(crate) const FEWEST_DATAGRAMS: usize = 3;
/// Data bytes of the NOP that fills a frame up to [`FEWEST_DATAGRAMS`].
pub(crate) const FILLER_LENGTH: usize = 2;
const FILLER: usize = FILLER_LENGTH + DATAGRAM_OVERHEAD;
const STATUS_LENGTH: usize = 2;
/// Bytes of datagrams in a frame, room for fillers kept.
const CAPACITY: usize = MAX_FRAME - FIRST_DATAGRAM - (FEWEST_DATAGRAMS - 1) * FILLER;

/// What a datagram of the cycle is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Writes the host's time to the reference clock.
    SteerClock,
    /// Distributes the reference clock.
    Clock,
    /// Outputs from this byte of the image on.
    Outputs {
        /// Byte offset in the outputs.
        offset: usize,
    },
    /// Inputs from this byte of the image on.
    Inputs {
        /// Byte offset in the inputs.
        offset: usize,
    },
    /// Both from this byte of the image on.
    Both {
        /// Byte offset in outputs and inputs.
        offset: usize,
    },
    /// AL status of all SubDevices.
    Status,
    /// Nothing: its index carries a part of the frame's sequence number.
    Filler,
}

/// A SubDevice that a datagram touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Touch {
    /// Position of the SubDevice.
    pub position: u16,
    /// What it adds to the working counter: 1 for reading, 1 for writing, and 2 for writing by LRW.
    pub count: u16,
}

/// One datagram of the cycle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DatagramPlan {
    /// What it is for.
    pub role: Role,
    /// Command.
    pub command: Command,
    /// Address.
    pub address: Address,
    /// Data bytes.
    pub length: usize,
    /// Expected working counter.
    pub expected: u16,
    /// Who adds what to it; empty where all SubDevices or none are meant.
    pub touches: Vec<Touch>,
}

impl DatagramPlan {
    fn new(role: Role, command: Command, address: Address, length: usize) -> Self {
        DatagramPlan { role, command, address, length, expected: 0, touches: Vec::new() }
    }

    fn bytes(&self) -> usize {
        self.length + DATAGRAM_OVERHEAD
    }
}

/// One frame of the cycle.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FramePlan {
    /// In which cycles it goes.
    pub turn: Turn,
    /// Its datagrams in order.
    pub datagrams: Vec<DatagramPlan>,
    /// Whether the datagram of acyclic work is appended to this frame when there is one.
    pub carries_spare: bool,
}

impl FramePlan {
    fn bytes(&self) -> usize {
        self.datagrams.iter().map(DatagramPlan::bytes).sum()
    }
}

/// Bytes that belong together, and who is touched by them.
struct Piece {
    start: usize,
    end: usize,
    touches: Vec<Touch>,
}

/// Data of the same byte, and both ways of one SubDevice, can't be parted.
fn pieces(placements: &mut Vec<&Placement>, transport: Transport) -> Vec<Piece> {
    placements.sort_by_key(|placement| placement.offset);
    let mut pieces: Vec<Piece> = Vec::new();
    for placement in placements {
        let bytes = placement.bytes();
        let count = match (transport, placement.direction) {
            (Transport::Combined, Direction::Outputs) => 2,
            _ => 1,
        };
        let touch = Touch { position: placement.position, count };
        match pieces.last_mut() {
            Some(last) if bytes.start < last.end => {
                last.end = last.end.max(bytes.end);
                last.touches.push(touch);
            }
            _ => pieces.push(Piece { start: bytes.start, end: bytes.end, touches: vec![touch] }),
        }
    }
    pieces
}

/// A SubDevice counts once per datagram and direction, however many of its SyncManagers are touched.
fn add_touches(datagram: &mut DatagramPlan, touches: &[Touch], transport: Transport) {
    for touch in touches {
        let known = datagram.touches.iter_mut().find(|known| known.position == touch.position);
        match known {
            None => datagram.touches.push(*touch),
            Some(known) if transport == Transport::Combined => known.count |= touch.count,
            Some(_) => {}
        }
    }
    datagram.expected = datagram.touches.iter().map(|touch| touch.count).sum();
}

struct Filling<'a> {
    frames: Vec<FramePlan>,
    /// Bytes kept free at the end of the first frame.
    reserved: usize,
    plan: &'a ImagePlan,
    /// In which cycles what is carried goes.
    turn: Turn,
}

impl Filling<'_> {
    fn room(&self) -> usize {
        let used = self.frames.last().map_or(CAPACITY, FramePlan::bytes);
        let reserved = if self.frames.len() == 1 { self.reserved } else { 0 };
        CAPACITY.saturating_sub(used + reserved)
    }

    /// Carries one direction's pieces, one datagram per frame.
    fn carry(&mut self, pieces: Vec<Piece>, command: Command, region: Region, role: fn(usize) -> Role) {
        let mut open = false;
        for piece in pieces {
            let mut start = piece.start;
            while start < piece.end {
                let overhead = if open { 0 } else { DATAGRAM_OVERHEAD };
                let whole = piece.end - start;
                let room = self.room().saturating_sub(overhead);
                let fits_elsewhere = whole <= CAPACITY - DATAGRAM_OVERHEAD;
                if whole > room && (fits_elsewhere || room == 0) {
                    self.frames.push(FramePlan { turn: self.turn, ..FramePlan::default() });
                    open = false;
                    continue;
                }
                let end = start + whole.min(room);
                let Some(frame) = self.frames.last_mut() else { return };
                if !open {
                    let address = Address::Logical(region.start + start as u32);
                    frame.datagrams.push(DatagramPlan::new(role(start), command, address, 0));
                    open = true;
                }
                if let Some(datagram) = frame.datagrams.last_mut() {
                    datagram.length += end - start;
                    add_touches(datagram, &piece.touches, self.plan.transport);
                }
                start = end;
            }
        }
    }
}

impl Filling<'_> {
    /// Carries everything of one turn.
    fn carry_all(&mut self, turn: Turn) {
        let plan = self.plan;
        let all = |way: Option<Direction>| -> Vec<&Placement> {
            let of_turn = plan.placements.iter().filter(|one| plan.turns[usize::from(one.position)] == turn);
            of_turn.filter(|one| way.is_none_or(|way| one.direction == way)).collect()
        };
        match plan.transport {
            Transport::Combined => {
                let pieces = pieces(&mut all(None), plan.transport);
                self.carry(pieces, Command::Lrw, plan.outputs, |offset| Role::Both { offset });
            }
            Transport::Separate => {
                let outputs = pieces(&mut all(Some(Direction::Outputs)), plan.transport);
                self.carry(outputs, Command::Lwr, plan.outputs, |offset| Role::Outputs { offset });
                let inputs = pieces(&mut all(Some(Direction::Inputs)), plan.transport);
                self.carry(inputs, Command::Lrd, plan.inputs, |offset| Role::Inputs { offset });
            }
        }
    }
}

/// Lays out the frames of a cycle; none where there is no SubDevice.
pub(super) fn plan(plan: &ImagePlan, members: &[Member]) -> Vec<FramePlan> {
    if members.is_empty() {
        return Vec::new();
    }
    let mut first = FramePlan::default();
    if let Some(reference) = plan.clock.reference() {
        let member = &members[usize::from(reference)];
        let length = if member.clock == Some(DcWidth::Bits32) { 4 } else { 8 };
        let address = Address::station(member.station, register::DC_SYSTEM_TIME);
        if matches!(plan.clock, ClockUse::Steer { .. }) {
            let mut steer = DatagramPlan::new(Role::SteerClock, Command::Fpwr, address, length);
            steer.expected = 1;
            first.datagrams.push(steer);
        }
        let mut clock = DatagramPlan::new(Role::Clock, Command::Frmw, address, length);
        clock.expected = members.iter().filter(|member| member.clock.is_some()).count() as u16;
        first.datagrams.push(clock);
    }
    let reserved = STATUS_LENGTH + DATAGRAM_OVERHEAD;
    let mut filling = Filling { frames: vec![first], reserved, plan, turn: Turn::EACH_CYCLE };
    let mut turns = plan.turns.clone();
    turns.push(Turn::EACH_CYCLE);
    turns.sort();
    turns.dedup();
    for turn in turns {
        if turn != filling.turn {
            filling.turn = turn;
            filling.frames.push(FramePlan { turn, ..FramePlan::default() });
        }
        filling.carry_all(turn);
    }
    let mut frames = filling.frames;
    let mut status =
        DatagramPlan::new(Role::Status, Command::Brd, Address::broadcast(register::AL_STATUS), STATUS_LENGTH);
    status.expected = members.len() as u16;
    frames[0].datagrams.push(status);
    for frame in &mut frames {
        while frame.datagrams.len() < FEWEST_DATAGRAMS {
            let address = Address::broadcast(0);
            frame.datagrams.push(DatagramPlan::new(Role::Filler, Command::Nop, address, FILLER_LENGTH));
        }
    }
    let spare = plan.spare_length + DATAGRAM_OVERHEAD;
    let goes_always = |frame: &&mut FramePlan| frame.turn == Turn::EACH_CYCLE;
    let fits = |frame: &&mut FramePlan| frame.bytes() + spare <= MAX_FRAME - FIRST_DATAGRAM;
    if let Some(frame) = frames.iter_mut().rev().filter(goes_always).find(fits) {
        frame.carries_spare = true;
    }
    frames
}
