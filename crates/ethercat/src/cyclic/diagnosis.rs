//! Who is it? A wrong working counter or state is followed by one round of questions to the SubDevices.

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use super::SegmentStatus;
use super::batch::{Access, Batch, ItemState};
use super::frame::{CyclicFrame, Flight, Purpose};
use crate::found::Found;
use crate::image::{FramePlan, Member, Placement, Role};
use crate::subdevice::Direction;
use crate::wire::bytes::u16_at;
use crate::wire::{AlState, AlStatusCode, register};

/// Cycles between two rounds while something stays wrong in the same way.
const ROUND_INTERVAL: u64 = 100;
/// A SubDevice that answered none of so many rounds in a row is away; before, frames may have suffered on their way.
const CERTAIN: u8 = 3;

/// What everybody is asked: AL status and its code.
const ASKED: Access = Access::Read { register: register::AL_STATUS, length: 6 };

/// How a SubDevice is, as far as the last round of questions tells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Health {
    /// In OP.
    #[default]
    Operational,
    /// It doesn't answer at its station address: without power, cut off, or restarted; see
    /// [`super::CyclicBus::is_certain`].
    Silent,
    /// Others answer at its station address, too, as a part of the segment does that was plugged in with the addresses of another
    /// start: nothing that is read there can be believed.
    NotAlone,
    /// It answers, but not from OP.
    NotOperational {
        /// AL status (0x0130), error bit included.
        status: u16,
        /// AL status code (0x0134).
        code: AlStatusCode,
    },
}

/// Finds culprits and remembers them.
#[derive(Clone, Debug)]
pub(super) struct Diagnosis {
    health: Vec<Health>,
    /// Rounds in a row that each left unanswered.
    unanswered: Vec<u8>,
    not_operational: usize,
    asking: bool,
    /// What was wrong when the last round began; `None` asks again at once.
    signature: Option<u64>,
    next_round: u64,
    suspects: Vec<bool>,
    /// Bytes of the inputs that stay as they are because their SubDevices aren't operational, by rising offset.
    held: Vec<Range<usize>>,
}

/// What the present cycle showed.
pub(super) struct Finding<'a> {
    pub members: &'a [Member],
    pub plans: &'a [FramePlan],
    pub placements: &'a [Placement],
    pub frames: &'a mut [CyclicFrame],
    pub status: Option<SegmentStatus>,
    /// Whether every frame of process data came back.
    pub all_back: bool,
    pub cycle: u64,
}

impl Finding<'_> {
    /// The way in which something is wrong; 0 for nothing.
    fn signature(&self) -> u64 {
        if !self.all_back {
            return 0;
        }
        let mut signature = 0u64;
        for slot in self.frames.iter().flat_map(|frame| frame.slots()) {
            if is_process_data(slot.purpose) && slot.received != slot.expected {
                signature =
                    signature.wrapping_mul(0x100_0000_01B3).wrapping_add(u64::from(slot.received) + 1);
            }
        }
        if let Some(status) = self.status
            && (usize::from(status.answered) != self.members.len() || status.bits != AlState::Op.bits())
        {
            let state = u64::from(status.answered) << 16 | u64::from(status.bits);
            signature = signature.wrapping_mul(0x100_0000_01B3).wrapping_add(state + 1);
        }
        signature
    }
}

pub(super) fn is_process_data(purpose: Purpose) -> bool {
    matches!(purpose, Purpose::Planned(Role::Outputs { .. } | Role::Inputs { .. } | Role::Both { .. }))
}

impl Diagnosis {
    pub fn new(members: usize, input_areas: usize) -> Self {
        Diagnosis {
            health: vec![Health::Operational; members],
            unanswered: vec![0; members],
            not_operational: 0,
            asking: false,
            signature: None,
            next_round: 0,
            suspects: vec![false; members],
            held: Vec::with_capacity(input_areas),
        }
    }

    pub fn health(&self) -> &[Health] {
        &self.health
    }

    /// Whether the SubDevice at `position` isn't operational beyond doubt: it said so itself, or was asked often enough.
    pub fn is_certain(&self, position: u16) -> bool {
        let position = usize::from(position);
        match self.health.get(position) {
            None | Some(Health::Operational) => false,
            Some(Health::NotOperational { .. }) => true,
            Some(Health::Silent | Health::NotAlone) => self.unanswered[position] >= CERTAIN,
        }
    }

    /// Whether somebody is taken for silent who wasn't asked often enough.
    fn is_in_doubt(&self) -> bool {
        self.unanswered.iter().any(|rounds| (1..CERTAIN).contains(rounds))
    }

    /// Bytes of the inputs that belong to SubDevices which aren't operational, by rising offset.
    pub fn held(&self) -> &[Range<usize>] {
        &self.held
    }

    /// SubDevices that aren't [`Health::Operational`].
    pub fn not_operational(&self) -> usize {
        self.not_operational
    }

    /// Forgets everything: another state than OP is no illness.
    pub fn reset(&mut self, frames: &mut [CyclicFrame]) {
        self.health.fill(Health::Operational);
        self.unanswered.fill(0);
        (self.not_operational, self.asking, self.signature, self.next_round) = (0, false, None, 0);
        self.held.clear();
        for slot in frames.iter_mut().flat_map(|frame| frame.slots_mut()) {
            slot.accepted = slot.expected;
        }
    }

    /// Whether there is nothing to do.
    pub fn is_quiet(&self) -> bool {
        !self.asking && self.not_operational == 0
    }

    /// Begins a round where something new is wrong, takes the answers of one that is over.
    #[cold]
    pub fn advance(&mut self, finding: &mut Finding<'_>, batch: &mut Batch) {
        if self.asking {
            self.judge(batch);
        }
        if !batch.is_finished() {
            return;
        }
        if self.asking {
            self.asking = false;
            self.hold(finding.placements);
            self.learn(finding);
        }
        let signature = finding.signature();
        if signature == 0 {
            if finding.all_back && self.not_operational > 0 {
                self.reset(finding.frames);
            }
            return;
        }
        if Some(signature) == self.signature && finding.cycle < self.next_round {
            if self.is_in_doubt() {
                self.ask_again(finding.members, batch);
            }
            return;
        }
        self.signature = Some(signature);
        self.next_round = finding.cycle + ROUND_INTERVAL;
        self.ask(finding, batch);
    }

    /// Those who didn't answer are asked again at once.
    fn ask_again(&mut self, members: &[Member], batch: &mut Batch) {
        self.asking = true;
        batch.begin(1);
        for (member, rounds) in members.iter().zip(&self.unanswered) {
            if (1..CERTAIN).contains(rounds) {
                batch.add(member.position, member.station, ASKED);
            }
        }
    }

    /// Those whom a short datagram touches are asked first: with many SubDevices a round takes several cycles.
    fn ask(&mut self, finding: &Finding<'_>, batch: &mut Batch) {
        self.asking = true;
        batch.begin(1);
        self.suspects.fill(false);
        for (frame, plan) in finding.frames.iter().zip(finding.plans) {
            for (slot, datagram) in frame.slots().iter().zip(&plan.datagrams) {
                if is_process_data(slot.purpose) && slot.received != slot.expected {
                    for touch in &datagram.touches {
                        self.suspects[usize::from(touch.position)] = true;
                    }
                }
            }
        }
        for wanted in [true, false] {
            let members = finding.members.iter().zip(&self.suspects);
            for (member, _) in members.filter(|(_, suspect)| **suspect == wanted) {
                batch.add(member.position, member.station, ASKED);
            }
        }
    }

    fn judge(&mut self, batch: &Batch) {
        for item in batch.items() {
            let position = usize::from(item.position);
            let (Some(health), Some(unanswered)) =
                (self.health.get_mut(position), self.unanswered.get_mut(position))
            else {
                continue;
            };
            let status = u16_at(&item.data, 0);
            if matches!(item.state, ItemState::Answered) {
                *unanswered = 0;
            }
            *health = match item.state {
                // Where no frame came back nothing is known of anybody.
                ItemState::Open { .. }
                | ItemState::Sent { .. }
                | ItemState::Failed { found: Found::Nothing } => continue,
                ItemState::Failed { found: Found::WorkingCounter(counter) } => {
                    *unanswered = unanswered.saturating_add(1);
                    if counter > 1 { Health::NotAlone } else { Health::Silent }
                }
                ItemState::Answered if status == AlState::Op.bits() => Health::Operational,
                ItemState::Answered => {
                    Health::NotOperational { status, code: AlStatusCode(u16_at(&item.data, 4)) }
                }
            };
        }
        self.not_operational = self.health.iter().filter(|health| **health != Health::Operational).count();
    }

    fn hold(&mut self, placements: &[Placement]) {
        self.held.clear();
        for placement in placements {
            let operational = self.health.get(usize::from(placement.position)) == Some(&Health::Operational);
            if !operational
                && placement.direction == Direction::Inputs
                && self.held.len() < self.held.capacity()
            {
                self.held.push(placement.bytes());
            }
        }
        self.held.sort_unstable_by_key(|bytes| bytes.start);
    }

    /// Accepts the working counters of this very cycle from now on, where the culprits explain them: a SubDevice
    /// that is silent adds nothing, one that isn't in OP may add something or nothing. Any other counter is
    /// wrong again and begins a new round.
    fn learn(&mut self, finding: &mut Finding<'_>) {
        if !finding.all_back {
            self.signature = None;
            return;
        }
        for (frame, plan) in finding.frames.iter_mut().zip(finding.plans) {
            let goes = frame.flight != Flight::Idle;
            for (slot, datagram) in frame.slots_mut().iter_mut().zip(&plan.datagrams) {
                slot.accepted = slot.expected;
                if !is_process_data(slot.purpose) {
                    continue;
                }
                let (mut silent, mut doubtful) = (0, 0);
                for touch in &datagram.touches {
                    match self.health.get(usize::from(touch.position)) {
                        Some(Health::Silent) => silent += touch.count,
                        Some(Health::NotOperational { .. }) => doubtful += touch.count,
                        _ => {}
                    }
                }
                let most = slot.expected - silent;
                // What its next turn brings is known where nobody may or may not add to it.
                if !goes && doubtful == 0 {
                    slot.accepted = most;
                } else if (most - doubtful..=most).contains(&slot.received) {
                    slot.accepted = slot.received;
                }
            }
        }
    }
}
