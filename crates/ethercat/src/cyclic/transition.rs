//! From PRE-OP to OP and back while process data flow: one step after the other, advanced by each exchange.

mod goal;

use core::time::Duration;

use super::acyclic::Acyclic;
use super::batch::{ATTEMPTS, Access, Batch, Item, ItemState};
use super::diagnosis::Health;
use super::error::{Programmed, TransitionError};
use super::sync::Sync0;
use super::{Exchange, SegmentStatus};
use crate::config::DcConfig;
use crate::found::Found;
use crate::image::{ClockUse, Member, Turn};
use crate::subdevice::{DcWidth, Direction};
use crate::sync_manager::ACTIVATE;
use crate::wire::bytes::{u16_at, u32_at};
use crate::wire::{AlState, AlStatusCode, DcTime, HostTime, register};

pub use goal::{Goal, Step, TransitionOptions};

/// What a transition can see.
pub(super) struct View<'a> {
    pub members: &'a [Member],
    pub clock_use: ClockUse,
    pub batch: &'a mut Batch,
    pub acyclic: &'a mut Acyclic,
    pub status: Option<SegmentStatus>,
    /// As it was known in OP.
    pub health: &'a [Health],
    pub clock: Option<DcTime>,
    /// Number of the cycle, and whose process data go in which.
    pub cycle: u64,
    pub turns: &'a [Turn],
    pub exchange: Exchange,
    pub now: HostTime,
}

/// How far it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Progress {
    Going,
    Done,
    Failed(TransitionError),
}

/// A transition in progress.
#[derive(Clone, Debug)]
pub(super) struct Transition {
    options: TransitionOptions,
    goal: Goal,
    step: Step,
    since: HostTime,
    /// The step's accesses are in the batch.
    loaded: bool,
    /// A wait ended with an error or a timeout; every SubDevice is being asked for its state.
    inquiring: bool,
    /// Good looks or exchanges in a row.
    good: u32,
    /// The farthest clock of the last look.
    worst: Option<(u16, i32)>,
    /// The reference's time when SYNC0 was armed.
    armed: DcTime,
    /// The last of all first SYNC0s.
    first_sync: DcTime,
    /// A wrong working counter while complete exchanges were waited for.
    short: Option<TransitionError>,
    /// Steps that switch SyncManagers for OP alone: as many as the SubDevice with the most of them has.
    most_op_only: u8,
    /// The way back goes on after an error and reports the first one.
    first_error: Option<TransitionError>,
}

impl Transition {
    pub fn new(goal: Goal, options: TransitionOptions, members: &[Member], now: HostTime) -> Self {
        let step = match goal {
            Goal::Op => Step::LockClocks,
            Goal::PreOp | Goal::Init => Step::Ask(AlState::PreOp),
        };
        Transition {
            options,
            goal,
            step,
            since: now,
            loaded: false,
            inquiring: false,
            good: 0,
            worst: None,
            armed: DcTime(0),
            first_sync: DcTime(0),
            short: None,
            most_op_only: members.iter().map(|member| member.op_only.len() as u8).max().unwrap_or(0),
            first_error: None,
        }
    }

    pub fn step(&self) -> Step {
        self.step
    }

    pub fn goal(&self) -> Goal {
        self.goal
    }

    /// Position and difference (ns) of the clock that was farthest away at the last look.
    pub fn worst_clock(&self) -> Option<(u16, i32)> {
        self.worst
    }

    fn following(&self) -> Option<Step> {
        let up = self.goal == Goal::Op;
        Some(match self.step {
            Step::LockClocks => Step::SyncOff,
            Step::SyncOff if up => Step::CyclicControl,
            Step::SyncOff => Step::OpOnly(0),
            Step::OpOnly(number) if number + 1 < self.most_op_only => Step::OpOnly(number + 1),
            Step::OpOnly(_) if up => Step::Ask(AlState::Op),
            Step::OpOnly(_) if self.goal == Goal::Init => Step::Ask(AlState::Init),
            Step::OpOnly(_) => return None,
            Step::CyclicControl => Step::Sync0Cycle,
            Step::Sync0Cycle => Step::Sync1Cycle,
            Step::Sync1Cycle => Step::StartTime,
            Step::StartTime => Step::SyncOn,
            Step::SyncOn => Step::Ask(AlState::SafeOp),
            Step::Ask(state) => Step::Await(state),
            Step::Await(state) if up => Step::Settle(state),
            Step::Await(AlState::PreOp) => Step::SyncOff,
            Step::Await(_) => return None,
            Step::Settle(AlState::SafeOp) => Step::Sdos,
            Step::Sdos => Step::OpOnly(0),
            Step::Settle(_) => return None,
        })
    }

    fn go_on(&mut self, now: HostTime) -> Option<Progress> {
        let Some(next) = self.following() else {
            return Some(self.first_error.take().map_or(Progress::Done, Progress::Failed));
        };
        self.step = next;
        self.since = now;
        (self.loaded, self.inquiring) = (false, false);
        self.good = 0;
        self.short = None;
        None
    }

    fn fail(&mut self, error: TransitionError, now: HostTime) -> Option<Progress> {
        if self.goal == Goal::Op {
            return Some(Progress::Failed(error));
        }
        self.first_error.get_or_insert(error);
        self.go_on(now)
    }

    /// Does what this exchange made possible.
    pub fn advance(&mut self, view: &mut View<'_>) -> Progress {
        // Steps that have nothing to do are passed at once; there are fewer steps than this.
        for _ in 0..16 {
            if !view.batch.is_finished() {
                return Progress::Going;
            }
            let step = self.step;
            let ended = match step {
                Step::LockClocks => self.lock_clocks(view),
                Step::Await(state) => self.wait_for(state, view),
                Step::Settle(state) => self.settle(state, view),
                Step::Sdos => self.write_sdos(view),
                _ => self.write(view),
            };
            if let Some(progress) = ended {
                return progress;
            }
        }
        Progress::Going
    }

    fn lock_clocks(&mut self, view: &mut View<'_>) -> Option<Progress> {
        let followers = |member: &&Member| match view.clock_use {
            ClockUse::None => false,
            ClockUse::Distribute { reference } => member.clock.is_some() && member.position != reference,
            ClockUse::Steer { .. } => member.clock.is_some(),
        };
        if self.loaded {
            if let Some(failed) = refused(view, view.now - self.since) {
                return self.fail(failed, view.now);
            }
            let difference = |item: &Item| register::signed_difference(u32_at(&item.data, 0));
            self.worst = view
                .batch
                .items()
                .iter()
                .map(|item| (item.position, difference(item)))
                .max_by_key(|(_, difference)| difference.unsigned_abs());
            let within =
                self.worst.is_none_or(|(_, worst)| worst.unsigned_abs() < self.options.lock_limit_ns);
            self.good = if within { self.good + 1 } else { 0 };
            if self.good >= self.options.lock_rounds {
                return self.go_on(view.now);
            }
            let after = view.now - self.since;
            if after >= self.options.lock_timeout {
                let (position, difference_ns) = self.worst.unwrap_or_default();
                let limit_ns = self.options.lock_limit_ns;
                let error = TransitionError::NotLocked { position, difference_ns, limit_ns, after };
                return self.fail(error, view.now);
            }
        }
        view.batch.begin(ATTEMPTS);
        for member in view.members.iter().filter(followers) {
            let register = register::DC_SYSTEM_TIME_DIFFERENCE;
            view.batch.add(member.position, member.station, Access::Read { register, length: 4 });
        }
        self.loaded = true;
        if view.batch.is_finished() { self.go_on(view.now) } else { Some(Progress::Going) }
    }

    /// The steps that write the same register of many SubDevices.
    fn write(&mut self, view: &mut View<'_>) -> Option<Progress> {
        if self.loaded {
            if self.step != Step::CyclicControl
                && let Some(failed) = refused(view, view.now - self.since)
            {
                return self.fail(failed, view.now);
            }
            return self.go_on(view.now);
        }
        if self.step == Step::StartTime && view.members.iter().any(|member| Sync0::of(member.sync).is_some())
        {
            let Some(clock) = view.clock else {
                let after = view.now - self.since;
                if after < self.options.settle_timeout {
                    return Some(Progress::Going);
                }
                return self.fail(TransitionError::ClockSilent { after }, view.now);
            };
            self.armed = clock;
            self.first_sync = clock + self.options.sync_margin;
        }
        let optional = self.step == Step::CyclicControl;
        view.batch.begin(if optional { 2 } else { ATTEMPTS });
        for (member, turn) in view.members.iter().zip(view.turns) {
            if let Some(access) = self.access(member, *turn, view.cycle) {
                view.batch.add(member.position, member.station, access);
            }
        }
        self.loaded = true;
        if view.batch.is_finished() { self.go_on(view.now) } else { Some(Progress::Going) }
    }

    fn access(&mut self, member: &Member, turn: Turn, cycle: u64) -> Option<Access> {
        if let Step::Ask(state) = self.step {
            // On the way back errors are acknowledged by the way, for a SubDevice in error obeys nothing else.
            let acknowledge = if self.goal == Goal::Op { 0 } else { AlState::ERROR };
            let word = state.bits() | acknowledge;
            return Some(Access::write(register::AL_CONTROL, &word.to_le_bytes()));
        }
        if let Step::OpOnly(number) = self.step {
            let index = *member.op_only.get(usize::from(number))?;
            let register = register::SM + register::SM_SIZE * u16::from(index) + ACTIVATE;
            return Some(Access::write(register, &[u8::from(self.goal == Goal::Op)]));
        }
        let sync0 = Sync0::of(member.sync)?;
        Some(match self.step {
            Step::SyncOff => Access::write(register::DC_ACTIVATION, &[0]),
            Step::CyclicControl => {
                Access::write(register::DC_CYCLIC_CONTROL, &[member.assign_activate as u8])
            }
            Step::Sync0Cycle => Access::write(register::DC_SYNC0_CYCLE, &sync0.cycle_ns.to_le_bytes()),
            Step::Sync1Cycle => {
                let DcConfig::Sync0And1 { sync1_cycle_ns, .. } = member.sync else { return None };
                Access::write(register::DC_SYNC1_CYCLE, &sync1_cycle_ns.to_le_bytes())
            }
            Step::StartTime => {
                let start = sync0.start(turn, cycle, self.armed, self.options.sync_margin);
                if turn != Turn::EACH_CYCLE {
                    self.first_sync = self.first_sync.max(start);
                }
                let bytes = start.0.to_le_bytes();
                let length = if member.clock == Some(DcWidth::Bits32) { 4 } else { 8 };
                Access::write(register::DC_START_TIME, &bytes[..length])
            }
            Step::SyncOn => Access::write(register::DC_ACTIVATION, &[(member.assign_activate >> 8) as u8]),
            _ => return None,
        })
    }

    fn wait_for(&mut self, state: AlState, view: &mut View<'_>) -> Option<Progress> {
        let up = self.goal == Goal::Op;
        let after = view.now - self.since;
        let limits = view.members.iter().map(|member| self.limit(state, member));
        let (first, last) = limits
            .fold((self.options.state_timeout, Duration::ZERO), |(first, last), limit| {
                (first.min(limit), last.max(limit))
            });
        let timed_out = after >= first;
        if self.inquiring {
            self.inquiring = false;
            if let Some(error) = self.culprit(state, view, up.then_some(after)) {
                return self.fail(error, view.now);
            }
            if after >= last || self.are_all_in(state, view) {
                return self.go_on(view.now);
            }
        }
        let status = view.status.filter(|status| usize::from(status.answered) == view.members.len());
        let reached = |bits: u16| if up { bits == state.bits() } else { bits & 0x0F == state.bits() };
        if status.is_some_and(|status| reached(status.bits)) {
            return self.go_on(view.now);
        }
        let error = up && view.status.is_some_and(|status| status.bits & AlState::ERROR != 0);
        // Who was plugged in meanwhile answers what all are asked: then each member is asked by itself.
        let are_more = view.status.is_some_and(|status| usize::from(status.answered) > view.members.len());
        if error || timed_out || are_more {
            view.batch.begin(1);
            for member in view.members {
                let access = Access::Read { register: register::AL_STATUS, length: 6 };
                view.batch.add(member.position, member.station, access);
            }
            self.inquiring = true;
        }
        Some(Progress::Going)
    }

    fn settle(&mut self, state: AlState, view: &mut View<'_>) -> Option<Progress> {
        let slowest = view.turns.iter().map(|turn| u32::from(turn.every)).max().unwrap_or(1);
        // Who takes process data in OP alone doesn't count in SAFE-OP.
        let are_some_off =
            state == AlState::SafeOp && view.members.iter().any(|member| !member.op_only.is_empty());
        let is_good = match view.exchange {
            Exchange::Complete => true,
            Exchange::ShortCount { .. } => are_some_off,
            _ => false,
        };
        if let Exchange::ShortCount { frame, datagram, expected, received } = view.exchange {
            self.short = Some(TransitionError::ProcessData { frame, datagram, expected, received });
        } else if self.good > slowest {
            self.short = None;
        }
        self.good = if is_good { self.good + 1 } else { 0 };
        let synced = match (state, view.clock) {
            (AlState::SafeOp, Some(clock)) => clock >= self.first_sync,
            _ => true,
        };
        if self.good >= self.options.settle_cycles.max(slowest) && synced {
            return self.go_on(view.now);
        }
        let after = view.now - self.since;
        if after < self.options.settle_timeout {
            return Some(Progress::Going);
        }
        if !matches!(view.exchange, Exchange::Lost { .. })
            && let Some(error) = self.short.take()
        {
            // Some SubDevices take outputs in OP only: whether they do is theirs to judge.
            if state == AlState::SafeOp {
                return self.go_on(view.now);
            }
            return self.fail(error, view.now);
        }
        let error = match view.exchange {
            Exchange::Complete if !synced => TransitionError::ClockSilent { after },
            _ => TransitionError::FramesLost { after },
        };
        self.fail(error, view.now)
    }

    /// Until the last SubDevice's are written, or one fails; whoever asks for another state meanwhile ends it.
    fn write_sdos(&mut self, view: &mut View<'_>) -> Option<Progress> {
        if !self.loaded {
            view.acyclic.begin_writing();
            self.loaded = true;
        }
        match view.acyclic.written()? {
            Ok(()) => self.go_on(view.now),
            Err(error) => self.fail(TransitionError::Sdo(error), view.now),
        }
    }

    /// Whether every member was just seen in a state, on the way up without an error.
    fn are_all_in(&self, state: AlState, view: &View<'_>) -> bool {
        let mask = if self.goal == Goal::Op { AlState::ERROR | 0x0F } else { 0x0F };
        let is_in = |item: &Item| {
            matches!(item.state, ItemState::Answered) && u16_at(&item.data, 0) & mask == state.bits()
        };
        view.batch.items().iter().all(is_in)
    }

    /// The longest wait for a SubDevice's state.
    fn limit(&self, state: AlState, member: &Member) -> Duration {
        let own = member.timeouts.of(state).filter(|_| self.goal == Goal::Op);
        own.unwrap_or(self.options.state_timeout)
    }

    /// The first SubDevice that is in error, or (where the time since it was asked is beyond its limit) not in the state.
    fn culprit(&self, target: AlState, view: &View<'_>, after: Option<Duration>) -> Option<TransitionError> {
        view.batch.items().iter().find_map(|item| {
            let position = item.position;
            let member = view.members.get(usize::from(position))?;
            let after = after.filter(|after| *after >= self.limit(target, member));
            if !matches!(item.state, ItemState::Answered) {
                return after.map(|after| TransitionError::Unreachable { position, after });
            }
            let status = u16_at(&item.data, 0);
            let code = AlStatusCode(u16_at(&item.data, 4));
            let programmed = programmed(member);
            // On the way down a chip without a processor repeats the acknowledgement: it refuses nothing where it is.
            let is_there = status & 0x0F == target.bits() && code == AlStatusCode(0);
            let is_repeated = is_there && self.goal != Goal::Op;
            if status & AlState::ERROR != 0 && !is_repeated {
                return Some(TransitionError::StateRefused { position, target, status, code, programmed });
            }
            let after = after.filter(|_| status & 0x0F != target.bits())?;
            Some(TransitionError::StateTimeout { position, target, status, after, programmed })
        })
    }
}

fn refused(view: &View<'_>, after: Duration) -> Option<TransitionError> {
    let are_all_there = view.status.is_some_and(|status| usize::from(status.answered) >= view.members.len());
    let is_away = |position: u16| {
        !are_all_there
            || view.health.get(usize::from(position)).is_some_and(|health| *health == Health::Silent)
    };
    view.batch.items().iter().find_map(|item| match item.state {
        ItemState::Failed { found } => {
            let (position, register) = (item.position, item.register);
            Some(match found {
                Found::Nothing => TransitionError::RegisterUnheard { position, register },
                // Every chip has this one, but takes no request where its firmware hasn't read the last.
                Found::WorkingCounter(0) if register == register::AL_CONTROL && is_away(position) => {
                    TransitionError::Unreachable { position, after }
                }
                Found::WorkingCounter(working_counter) => {
                    TransitionError::RegisterRefused { position, register, working_counter }
                }
            })
        }
        _ => None,
    })
}

/// What a SubDevice was given, for messages.
fn programmed(member: &Member) -> Programmed {
    Programmed {
        output_bytes: member.byte_length(Direction::Outputs),
        input_bytes: member.byte_length(Direction::Inputs),
        sync: member.sync,
    }
}
