//! The cycle: process data out and in, clocks, states, and everything that runs beside it in spare datagrams.
//!
//! ```text
//! exchange:  outputs -> prebuilt frames -> send all -> receive all -> check -> inputs
//!            then at most one step each of: transition or diagnosis, acyclic work
//! ```
//!
//! - One thread, no allocation, no lock, no clock: the deadline of an exchange is its time.
//! - A frame is taken only when every datagram in it has the command, index, address and length that were sent in
//!   this very cycle. The indices of a frame's datagrams together are its sequence number of at least 24 bits, so
//!   that a frame which is late by 256 cycles isn't taken for a new one (docs/decisions/0002-frame-sequence-number.md).
//! - Inputs change all together or not at all: never where a frame is missing or a working counter is wrong.
//! - Frames of slow SubDevices rest in between: what they brought stays, and who is missing is seen at their next turn.
//! - Lost frames and wrong counters are values, not errors.
//! - A SubDevice that lost power is named within two cycles; [`CyclicBus::recover`] brings it back beside the cycle.

mod acyclic;
mod batch;
mod clock;
mod counters;
mod diagnosis;
mod error;
mod frame;
mod handover;
mod outcome;
mod recovery;
mod reference;
mod report;
mod sync;
#[cfg(test)]
mod tests;
mod transition;
mod wire;

use alloc::vec::Vec;

use crate::image::{FEWEST_DATAGRAMS, FILLER_LENGTH, ImagePlan, Member, ProcessImage, Role};
use crate::mailbox::Mailbox;
use crate::procedure::Answer;
use crate::wire::bytes::u16_at;
use crate::wire::{Address, AlState, Command, HostTime, Link, LinkError};

use acyclic::Acyclic;
use batch::{BATCH_FRAMES, Batch};
use clock::ClockReading;
use diagnosis::{Diagnosis, Finding, is_process_data};
use frame::{CyclicFrame, Flight, MOST_DATAGRAMS, Purpose};
use recovery::Observed;
use transition::{Progress, Transition, View};
use wire::Exchanger;

pub use acyclic::{AcyclicCompletion, AcyclicError, AcyclicRequest, AcyclicWork, CAPACITY, RegisterAccess};
pub use clock::{DcFollower, FollowerGains, HostToDc};
pub use counters::{CommandSet, CycleCounters, DatagramCount};
pub use diagnosis::Health;
pub use error::{Programmed, TransitionError};
pub use handover::{ClockDirection, Handover};
pub use outcome::{Exchange, Freshness, SegmentStatus, TransitionStatus};
pub use recovery::{Comeback, RecoveryError};
pub use transition::{Goal, Step, TransitionOptions};

/// What a [`CyclicBus`] is made of; set-up code fills it.
#[derive(Clone, Debug)]
pub struct CyclicParts {
    /// All SubDevices by position.
    pub members: Vec<Member>,
    /// The image and frames that were planned from them.
    pub plan: ImagePlan,
    /// Each SubDevice's mailbox with its message counter as it stands; may be shorter than `members`.
    pub mailboxes: Vec<Option<Mailbox>>,
}

/// A stretch of the image and its place in a frame.
#[derive(Clone, Copy, Debug)]
struct Carry {
    frame: u16,
    /// First byte in the frame.
    at: u16,
    length: u16,
    /// First byte in the image.
    offset: u32,
}

impl Carry {
    fn in_frame(&self) -> core::ops::Range<usize> {
        usize::from(self.at)..usize::from(self.at) + usize::from(self.length)
    }

    fn in_image(&self) -> core::ops::Range<usize> {
        self.offset as usize..self.offset as usize + usize::from(self.length)
    }
}

/// A segment in cyclic exchange.
#[derive(Debug)]
pub struct CyclicBus<L> {
    exchanger: Exchanger<L>,
    /// Which bytes of the outputs go where.
    outputs: Vec<Carry>,
    /// Which bytes of the inputs come from where.
    inputs: Vec<Carry>,
    members: Vec<Member>,
    plan: ImagePlan,
    /// The first frames are those of the plan.
    planned: usize,
    /// Number of the present cycle, those that were left out counted; it says whose turn it is.
    cycle: u64,
    /// The frame to which acyclic work is appended.
    spare_frame: usize,
    first_batch_frame: usize,
    batch: Batch,
    acyclic: Acyclic,
    diagnosis: Diagnosis,
    transition: Option<Transition>,
    phase: TransitionStatus,
    clock: ClockReading,
    /// The last frame brought a reading.
    clock_is_new: bool,
    clock_slot: Option<usize>,
    steer_slot: Option<usize>,
    status_slot: Option<usize>,
    /// Who is being set to the reference's time to become the reference.
    pending_reference: Option<u16>,
    /// The reference started anew or was away with nobody to lead in its place: its clock is neither read, nor written
    /// by the host, nor distributed until it has the time that it would show.
    reference_is_unset: bool,
    /// Who became the reference that way, before its own way was over.
    promoted_reference: Option<u16>,
    /// Exchanges in a row of which no frame came back.
    nothing_back: u64,
    status: Option<SegmentStatus>,
    last: Exchange,
}

impl<L: Link> CyclicBus<L> {
    /// Builds every frame; nothing is sent yet.
    pub fn new(link: L, parts: CyclicParts) -> Self {
        let CyclicParts { members, plan, mailboxes } = parts;
        let mut frames = Vec::with_capacity(plan.frames.len() + 1 + BATCH_FRAMES);
        for planned in &plan.frames {
            let mut frame = CyclicFrame::new(planned.datagrams.len() + 1);
            frame.turn = planned.turn;
            for datagram in &planned.datagrams {
                let purpose = Purpose::Planned(datagram.role);
                frame.push(purpose, datagram.command, datagram.address, datagram.length);
                if let Some(slot) = frame.slots_mut().last_mut() {
                    (slot.expected, slot.accepted) = (datagram.expected, datagram.expected);
                }
            }
            frames.push(frame);
        }
        let planned = frames.len();
        let spare_frame = match plan.frames.iter().position(|frame| frame.carries_spare) {
            Some(number) => number,
            None => {
                let mut frame = CyclicFrame::new(FEWEST_DATAGRAMS);
                for _ in 1..FEWEST_DATAGRAMS {
                    frame.push(Purpose::Filler, Command::Nop, Address::broadcast(0), FILLER_LENGTH);
                }
                frames.push(frame);
                planned
            }
        };
        let first_batch_frame = frames.len();
        frames.extend((0..BATCH_FRAMES).map(|_| CyclicFrame::new(MOST_DATAGRAMS)));
        let carries = |wanted: fn(Role) -> Option<usize>| -> Vec<Carry> {
            let planned = frames[..planned].iter().enumerate();
            let slots =
                planned.flat_map(|(number, frame)| frame.slots().iter().map(move |slot| (number, slot)));
            let carry = |(number, slot): (usize, &frame::Slot)| {
                let Purpose::Planned(role) = slot.purpose else { return None };
                let (offset, data) = (wanted(role)? as u32, slot.data());
                Some(Carry { frame: number as u16, at: data.start as u16, length: data.len() as u16, offset })
            };
            slots.filter_map(carry).collect()
        };
        let outputs = carries(|role| match role {
            Role::Outputs { offset } | Role::Both { offset } => Some(offset),
            _ => None,
        });
        let inputs = carries(|role| match role {
            Role::Inputs { offset } | Role::Both { offset } => Some(offset),
            _ => None,
        });
        let slot_of = |role: Role| {
            let first = plan.frames.first()?;
            first.datagrams.iter().position(|datagram| datagram.role == role)
        };
        let stations = members.iter().map(|member| member.station);
        let mailboxes = mailboxes.into_iter().chain(core::iter::repeat_with(|| None));
        CyclicBus {
            exchanger: Exchanger::new(link, frames),
            outputs,
            inputs,
            planned,
            cycle: 0,
            spare_frame,
            first_batch_frame,
            batch: Batch::new(members.len()),
            acyclic: Acyclic::new(stations.zip(mailboxes), plan.spare_length),
            diagnosis: Diagnosis::new(members.len(), plan.placements.len()),
            transition: None,
            phase: TransitionStatus::Standby,
            clock: ClockReading::default(),
            clock_is_new: false,
            clock_slot: slot_of(Role::Clock),
            steer_slot: slot_of(Role::SteerClock),
            status_slot: slot_of(Role::Status),
            pending_reference: None,
            reference_is_unset: false,
            promoted_reference: None,
            nothing_back: 0,
            status: None,
            last: Exchange::Lost { lost: 0, sent: 0 },
            members,
            plan,
        }
    }

    /// Sends the outputs, waits for all frames until `deadline`, and takes the inputs if all is right.
    ///
    /// Then everything that goes on beside the process data is moved one step. `deadline` counts as the time of
    /// this cycle for every timeout, so it has to rise from cycle to cycle.
    pub fn exchange(&mut self, image: &mut ProcessImage, deadline: HostTime) -> Result<Exchange, LinkError> {
        self.cycle += 1;
        self.load(image, deadline);
        let sent = self.exchanger.exchange(deadline);
        self.last = self.judge(image, deadline);
        self.finish(deadline);
        sent.map(|_| self.last)
    }

    fn load(&mut self, image: &ProcessImage, now: HostTime) {
        for frame in &mut self.exchanger.frames[..self.planned] {
            frame.flight = if frame.turn.is_due(self.cycle) { Flight::Sent } else { Flight::Idle };
        }
        self.load_clock(now);
        for carry in &self.outputs {
            let frame = &mut self.exchanger.frames[usize::from(carry.frame)];
            if frame.flight == Flight::Sent
                && let Some(outputs) = image.outputs.get(carry.in_image())
            {
                frame.data_mut(carry.in_frame()).copy_from_slice(outputs);
            }
        }
        if let Some(request) = self.acyclic.next(now) {
            let frame = &mut self.exchanger.frames[self.spare_frame];
            if frame.push(Purpose::Spare, request.command, request.address, request.length) {
                frame.flight = Flight::Sent;
                if let Some(slot) = frame.slots().last().copied() {
                    self.acyclic.fill(frame.data_mut(slot.data()));
                }
            }
        }
        if !self.batch.is_finished() {
            self.batch.fill(&mut self.exchanger.frames[self.first_batch_frame..]);
        }
    }

    /// The clock datagram leaves with the time that the reference is expected to show: where the reference doesn't
    /// fill it in (lost, or on the other side of a broken ring), nobody behind it is told nonsense.
    #[inline]
    fn load_clock(&mut self, now: HostTime) {
        let (Some(number), Some(frame)) = (self.clock_slot, self.exchanger.frames.first_mut()) else {
            return;
        };
        let Some(expected) = self.clock.expected(now) else { return };
        let range = frame.slots()[number].data();
        let bytes = expected.0.to_le_bytes();
        let data = frame.data_mut(range);
        let length = data.len().min(bytes.len());
        data[..length].copy_from_slice(&bytes[..length]);
    }

    fn judge(&mut self, image: &mut ProcessImage, now: HostTime) -> Exchange {
        let frames = &mut self.exchanger.frames[..self.planned];
        let (mut sent, mut back, mut right) = (0, 0, true);
        for frame in frames.iter_mut() {
            sent += usize::from(frame.flight != Flight::Idle);
            if frame.flight == Flight::Back {
                back += 1;
                right &= frame.read_counters();
            }
        }
        self.read_segment(now);
        self.nothing_back = if back == 0 && sent > 0 { self.nothing_back + 1 } else { 0 };
        if back != sent {
            return Exchange::Lost { lost: (sent - back) as u16, sent: sent as u16 };
        }
        if right {
            self.take_inputs(image);
            return Exchange::Complete;
        }
        self.judge_counters(image)
    }

    /// Reference time and AL status, from the first frame.
    fn read_segment(&mut self, now: HostTime) {
        self.status = None;
        self.clock_is_new = false;
        let Some(frame) = self.exchanger.frames[..self.planned].first() else { return };
        if frame.flight != Flight::Back {
            return;
        }
        if let Some(slot) = self.clock_slot.map(|number| &frame.slots()[number])
            && slot.received > 0
            && !self.reference_is_unset
        {
            self.clock.take_at(&frame.back[slot.data()], now);
            self.clock_is_new = true;
        }
        if let Some(slot) = self.status_slot.map(|number| &frame.slots()[number]) {
            let bits = u16_at(&frame.back[..], slot.data().start);
            self.status = Some(SegmentStatus { answered: slot.received, bits });
        }
    }

    fn take_inputs(&mut self, image: &mut ProcessImage) {
        for carry in &self.inputs {
            let frame = &mut self.exchanger.frames[usize::from(carry.frame)];
            if frame.flight == Flight::Back
                && let Some(inputs) = image.inputs.get_mut(carry.in_image())
            {
                frame.taken_in = self.cycle;
                inputs.copy_from_slice(&frame.back[carry.in_frame()]);
            }
        }
    }

    /// Some counter isn't as expected: only those of process data decide about the inputs.
    #[cold]
    fn judge_counters(&mut self, image: &mut ProcessImage) -> Exchange {
        let mut partial = false;
        let back = |frame: &&mut CyclicFrame| frame.flight == Flight::Back;
        let frames = self.exchanger.frames[..self.planned].iter_mut().filter(back);
        for slot in frames.flat_map(|frame| frame.slots_mut()) {
            if is_process_data(slot.purpose) && slot.received != slot.expected {
                slot.short_counts += 1;
            }
        }
        // Someone who is coming back answers again already; that must not hide that someone else went.
        let all_answer = self.status.is_some_and(|status| usize::from(status.answered) == self.members.len());
        let frames = self.exchanger.frames[..self.planned].iter().enumerate();
        for (number, frame) in frames.filter(|(_, frame)| frame.flight == Flight::Back) {
            for (datagram, slot) in frame.slots().iter().enumerate() {
                if !is_process_data(slot.purpose) || slot.received == slot.expected {
                    continue;
                }
                let most = slot.accepted + if all_answer { slot.leeway } else { 0 };
                if !(slot.accepted..=most.min(slot.expected)).contains(&slot.received) {
                    self.exchanger.counters.working_counter_errors += 1;
                    let (frame, datagram) = (number as u16, datagram as u16);
                    let (expected, received) = (slot.expected, slot.received);
                    return Exchange::ShortCount { frame, datagram, expected, received };
                }
                partial = true;
            }
        }
        if !partial {
            self.take_inputs(image);
            return Exchange::Complete;
        }
        self.exchanger.counters.working_counter_errors += 1;
        self.take_inputs_of_the_well(image);
        Exchange::Without { not_operational: self.diagnosis.not_operational() as u16 }
    }

    /// The inputs of missing SubDevices stay as they were, and so does a byte that they share with others.
    fn take_inputs_of_the_well(&mut self, image: &mut ProcessImage) {
        for carry in &self.inputs {
            let frame = &mut self.exchanger.frames[usize::from(carry.frame)];
            if frame.flight != Flight::Back {
                continue;
            }
            frame.taken_in = self.cycle;
            let (mut start, end) = (carry.in_image().start, carry.in_image().end);
            for held in self.diagnosis.held().iter().cloned().chain(core::iter::once(end..end)) {
                let stop = held.start.clamp(start, end);
                if let Some(inputs) = image.inputs.get_mut(start..stop) {
                    let from = carry.in_frame().start + start - carry.in_image().start;
                    inputs.copy_from_slice(&frame.back[from..from + stop - start]);
                }
                start = held.end.clamp(stop, end);
            }
        }
    }

    /// Answers for acyclic work and batches, then one step of whatever is on the way.
    fn finish(&mut self, now: HostTime) {
        if self.acyclic.is_waiting() {
            self.take_acyclic(now);
        }
        if !self.batch.is_finished() {
            self.batch.collect(&mut self.exchanger.frames[self.first_batch_frame..]);
            for frame in &mut self.exchanger.frames[self.first_batch_frame..] {
                frame.flight = Flight::Idle;
            }
        }
        self.keep_reference();
        if self.transition.is_some() {
            self.advance_transition(now);
        } else if self.phase == TransitionStatus::Reached(Goal::Op) {
            let healthy = self.last == Exchange::Complete
                && self.status.is_some_and(|status| {
                    usize::from(status.answered) == self.members.len() && status.bits == AlState::Op.bits()
                });
            if !(healthy && self.diagnosis.is_quiet()) && self.planned > 0 {
                self.diagnose();
            }
        }
    }

    #[cold]
    fn take_acyclic(&mut self, now: HostTime) {
        let time = match self.reference_is_unset {
            true => self.clock.expected(now),
            false => self.clock.last().filter(|_| self.clock_is_new),
        };
        let seen = Observed {
            time,
            is_distributed: self.clock_is_new && self.pending_reference.is_none(),
            answered: self.status.map(|status| status.answered),
            expected: self.members.len() as u16,
            cycle: self.cycle,
        };
        let frame = &mut self.exchanger.frames[self.spare_frame];
        let answered = frame.flight == Flight::Back && {
            frame.read_counters();
            true
        };
        match frame.slots().last().copied().filter(|slot| slot.purpose == Purpose::Spare) {
            Some(slot) if answered => {
                let (working_counter, data) = (slot.received, &frame.back[slot.data()]);
                self.acyclic.answer(Answer::Returned { working_counter, data }, seen, now);
            }
            _ => self.acyclic.answer(Answer::Lost, seen, now),
        }
        let kept = frame.slots().iter().take_while(|slot| slot.purpose != Purpose::Spare).count();
        frame.truncate(kept);
        if self.spare_frame >= self.planned {
            frame.flight = Flight::Idle;
        }
    }

    #[cold]
    fn advance_transition(&mut self, now: HostTime) {
        let Some(transition) = &mut self.transition else { return };
        let mut view = View {
            members: &self.members,
            clock_use: self.plan.clock,
            batch: &mut self.batch,
            acyclic: &mut self.acyclic,
            status: self.status,
            health: self.diagnosis.health(),
            clock: self.clock.last(),
            cycle: self.cycle,
            turns: &self.plan.turns,
            exchange: self.last,
            now,
        };
        let goal = transition.goal();
        self.phase = match transition.advance(&mut view) {
            Progress::Going => TransitionStatus::Moving { goal, step: transition.step() },
            Progress::Done => TransitionStatus::Reached(goal),
            Progress::Failed(error) => TransitionStatus::Failed(error),
        };
        if !matches!(self.phase, TransitionStatus::Moving { .. }) {
            self.transition = None;
            self.batch.begin(1);
        }
    }

    #[cold]
    fn diagnose(&mut self) {
        let mut finding = Finding {
            members: &self.members,
            plans: &self.plan.frames,
            placements: &self.plan.placements,
            frames: &mut self.exchanger.frames[..self.planned],
            status: self.status,
            all_back: !matches!(self.last, Exchange::Lost { .. }),
            cycle: self.exchanger.counters.cycles,
        };
        self.diagnosis.advance(&mut finding, &mut self.batch);
    }

    /// Begins the way to `goal`; every exchange moves it on, [`CyclicBus::transition`] tells how far.
    ///
    /// Outputs must be valid from here on: SubDevices see them from SAFE-OP.
    pub fn request(&mut self, goal: Goal, options: TransitionOptions, now: HostTime) {
        self.batch.begin(1);
        self.acyclic.end_writing();
        self.diagnosis.reset(&mut self.exchanger.frames[..self.planned]);
        self.lead_on();
        self.phase = if self.members.is_empty() {
            TransitionStatus::Reached(goal)
        } else {
            let transition = Transition::new(goal, options, &self.members, now);
            let step = transition.step();
            self.transition = Some(transition);
            TransitionStatus::Moving { goal, step }
        };
    }
}
