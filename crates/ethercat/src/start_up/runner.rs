//! Runs one SubDevice's start-up list, datagram by datagram.

use alloc::vec::Vec;
use core::ops::Range;

use super::{
    ObjectBytes, ProgrammedRegisters, ReadBack, Refusal, SdoWrite, StartUpError, StartUpFailure, StartUpStep,
};
use crate::found::Found;
use crate::found::Target;
use crate::mailbox::{Completion, Mailbox, MailboxError, MailboxRequest, Operation};
use crate::procedure::{Answer, DatagramRequest, Next, Procedure};
use crate::state::{Application, StateChange};
use crate::wire::bytes::u64_at;
use crate::wire::{AlState, DcTime, HostTime, register};

/// Attempts at writing registers.
const ATTEMPTS: u32 = 4;
/// Pause between them.
const PAUSE: core::time::Duration = core::time::Duration::from_millis(1);
/// Bytes from the system time (0x0910) to the end of its offset (0x0927).
const CLOCK_LENGTH: usize = 24;
/// Bytes that a read back may have beyond what was written before it is refused.
const READ_BACK_SLACK: usize = 256;

/// What the present step is doing.
#[derive(Debug)]
enum Activity {
    /// Nothing yet.
    Begin,
    /// Writing registers; how often it failed.
    Registers { failures: u32 },
    /// Reading what the local clock shows, and its offset.
    ReadClock { failures: u32 },
    /// Writing the offset.
    WriteOffset { offset: u64, failures: u32 },
    /// Changing state.
    State(StateChange),
    /// Writing an SDO.
    Write,
    /// Reading it back; the refusal of the writing, where it was tolerated.
    ReadBack { refusal: Option<MailboxError> },
}

/// Runs steps of one SubDevice's start-up list.
///
/// The set-up drives it beside those of all other SubDevices; a recovery drives it in the cycle's spare datagram. Once it
/// is made it asks for no memory, however its steps end.
#[derive(Debug)]
pub struct StartUpRunner {
    target: Target,
    application: Application,
    steps: Vec<StartUpStep>,
    /// The present step.
    next: usize,
    /// Behind the last step that is to be run.
    end: usize,
    /// Carries the values of SDOs out and back in.
    buffer: Vec<u8>,
    mailbox: Option<Mailbox>,
    activity: Activity,
    wait_until: Option<HostTime>,
    reference_time: Option<DcTime>,
    delay_ns: u32,
    outcome: Option<Result<(), StartUpFailure>>,
}

impl StartUpRunner {
    /// A runner of `steps` for `target`; SDO steps go through `mailbox`.
    pub fn new(
        target: Target,
        application: Application,
        steps: Vec<StartUpStep>,
        mailbox: Option<Mailbox>,
    ) -> Self {
        let lengths = steps.iter().map(|step| match step {
            StartUpStep::Sdo(sdo) => sdo.data.len() + READ_BACK_SLACK,
            _ => 0,
        });
        StartUpRunner {
            target,
            application,
            next: 0,
            end: steps.len(),
            buffer: Vec::with_capacity(lengths.max().unwrap_or(0)),
            steps,
            mailbox,
            activity: Activity::Begin,
            wait_until: None,
            reference_time: None,
            delay_ns: 0,
            outcome: None,
        }
    }

    /// Begins anew with these steps of its list alone.
    pub(crate) fn run(&mut self, steps: Range<usize>) {
        (self.next, self.end) = (steps.start, steps.end);
        self.activity = Activity::Begin;
        (self.wait_until, self.reference_time, self.outcome) = (None, None, None);
    }

    /// What step `number` writes, to change it; empty where it is no step of registers.
    pub(crate) fn registers_mut(&mut self, number: usize) -> &mut [u8] {
        match self.steps.get_mut(number) {
            Some(StartUpStep::Registers { data, .. }) => data,
            _ => &mut [],
        }
    }

    /// The segment's time in the frame whose answer is given next; [`StartUpStep::ClockOffset`] needs it.
    pub fn set_reference_time(&mut self, time: DcTime) {
        self.reference_time = Some(time);
    }

    /// Gives the mailbox back.
    pub fn into_mailbox(self) -> Option<Mailbox> {
        self.mailbox
    }

    /// Gives the mailbox back in the midst of a step, with nothing in hand.
    pub(crate) fn give_up(&mut self) -> Option<Mailbox> {
        let mut mailbox = self.mailbox.take()?;
        mailbox.cancel();
        if let Some(completion) = mailbox.take_completion() {
            self.buffer = completion.request.data;
        }
        Some(mailbox)
    }

    /// The mailbox, to be handed in and taken out.
    pub(crate) fn mailbox_mut(&mut self) -> &mut Option<Mailbox> {
        &mut self.mailbox
    }

    fn step_done(&mut self) {
        self.next += 1;
        self.activity = Activity::Begin;
    }

    /// The registers that were programmed before the present step.
    pub(crate) fn programmed(&self) -> Vec<ProgrammedRegisters> {
        let done = self.steps.iter().take(self.next);
        done.filter_map(|step| match step {
            StartUpStep::Registers { register, data, what, .. } => {
                Some(ProgrammedRegisters { what, register: *register, data: data.clone() })
            }
            _ => None,
        })
        .collect()
    }

    /// Begins the present step.
    fn begin(&mut self, now: HostTime) {
        self.activity = match self.steps[..self.end].get(self.next) {
            None => {
                self.outcome = Some(Ok(()));
                return;
            }
            Some(StartUpStep::Registers { .. }) => Activity::Registers { failures: 0 },
            Some(StartUpStep::ClockOffset { delay_ns }) => {
                self.delay_ns = *delay_ns;
                Activity::ReadClock { failures: 0 }
            }
            Some(StartUpStep::State { state, timeout }) => {
                if let (AlState::PreOp | AlState::Init, Some(mailbox)) = (*state, &mut self.mailbox) {
                    mailbox.reset();
                }
                Activity::State(StateChange::new(self.target, self.application, *state, *timeout))
            }
            Some(StartUpStep::ArmSync) => {
                self.outcome = Some(Err(StartUpFailure::NeedsCycle));
                return;
            }
            Some(StartUpStep::Sdo(sdo)) => {
                let operation = Operation::Download { object: sdo.object, access: sdo.access };
                self.buffer.clear();
                self.buffer.extend_from_slice(&sdo.data);
                self.start_request(operation, now);
                Activity::Write
            }
        };
    }

    fn start_request(&mut self, operation: Operation, now: HostTime) {
        let request = MailboxRequest::new(operation, core::mem::take(&mut self.buffer));
        let refused = match &mut self.mailbox {
            Some(mailbox) => mailbox.start(request, now).err(),
            None => Some(request),
        };
        let Some(request) = refused else { return };
        self.buffer = request.data;
        if let Some(StartUpStep::Sdo(SdoWrite { object, origin, .. })) = self.steps.get(self.next) {
            let (object, origin) = (*object, origin.clone());
            self.outcome = Some(Err(StartUpFailure::NoMailbox { object, origin }));
        }
    }

    fn completed(&mut self, completion: Option<Completion>, now: HostTime) {
        let Some(StartUpStep::Sdo(sdo)) = self.steps.get(self.next) else { return };
        let SdoWrite { object, access, .. } = *sdo;
        let result = match completion {
            Some(Completion { request, result }) => {
                self.buffer = request.data;
                result
            }
            None => Err(MailboxError::Reset),
        };
        let is_write = matches!(self.activity, Activity::Write);
        let is_tolerated = sdo.refusal == Refusal::IsTolerated
            && matches!(result, Err(MailboxError::Aborted { .. }))
            && is_write;
        let refusal = match result {
            Ok(()) => None,
            Err(error) if is_tolerated => Some(error),
            Err(error) => {
                let operation = match is_write {
                    true => Operation::Download { object, access },
                    false => Operation::Upload { object, access },
                };
                let origin = sdo.origin.clone();
                self.outcome = Some(Err(StartUpFailure::Sdo { operation, error, slot: None, origin }));
                return;
            }
        };
        match (&mut self.activity, sdo.read_back) {
            (Activity::ReadBack { .. }, _) if self.buffer == sdo.data => self.step_done(),
            (Activity::ReadBack { refusal }, _) => {
                let refusal = refusal.take();
                let (written, read) = (ObjectBytes::new(&sdo.data), ObjectBytes::new(&self.buffer));
                let origin = sdo.origin.clone();
                let cause = StartUpFailure::ReadBack { object, written, read, refusal, origin };
                self.outcome = Some(Err(cause));
            }
            (_, ReadBack::Skip) => self.step_done(),
            (_, ReadBack::Compare) => {
                self.start_request(Operation::Upload { object, access }, now);
                self.activity = Activity::ReadBack { refusal };
            }
        }
    }

    /// Counts a failed access; true where it is to be given up.
    fn gives_up(&mut self, found: Found, now: HostTime) -> bool {
        self.wait_until = Some(now + PAUSE);
        let (Activity::Registers { failures }
        | Activity::ReadClock { failures }
        | Activity::WriteOffset { failures, .. }) = &mut self.activity
        else {
            return false;
        };
        *failures += 1;
        if *failures < ATTEMPTS {
            return false;
        }
        let (what, register) = match (&self.activity, self.steps.get(self.next)) {
            (_, Some(StartUpStep::Registers { refusal: Refusal::IsTolerated, .. }))
                if matches!(found, Found::WorkingCounter(_)) =>
            {
                self.step_done();
                return true;
            }
            (_, Some(StartUpStep::Registers { what, register, .. })) => (*what, *register),
            (Activity::ReadClock { .. }, _) => ("reading the clock", register::DC_SYSTEM_TIME),
            _ => ("setting the clock's offset", register::DC_SYSTEM_TIME_OFFSET),
        };
        self.outcome = Some(Err(StartUpFailure::Registers { what, register, found }));
        true
    }
}

impl Procedure for StartUpRunner {
    type Output = Result<(), StartUpError>;

    fn next(&mut self, now: HostTime) -> Next<Self::Output> {
        loop {
            if let Some(outcome) = self.outcome.take() {
                let position = self.target.position;
                return Next::Done(outcome.map_err(|cause| StartUpError { position, cause }));
            }
            if let Some(instant) = self.wait_until {
                if now < instant {
                    return Next::WaitUntil(instant);
                }
                self.wait_until = None;
            }
            let station = self.target.station;
            match &mut self.activity {
                Activity::Begin => self.begin(now),
                Activity::Registers { .. } => {
                    let Some(StartUpStep::Registers { register, data, .. }) = self.steps.get(self.next)
                    else {
                        self.step_done();
                        continue;
                    };
                    return Next::Send(DatagramRequest::write(station, *register, data.len()));
                }
                Activity::ReadClock { .. } => {
                    return Next::Send(DatagramRequest::read(
                        station,
                        register::DC_SYSTEM_TIME,
                        CLOCK_LENGTH,
                    ));
                }
                Activity::WriteOffset { .. } => {
                    return Next::Send(DatagramRequest::write(station, register::DC_SYSTEM_TIME_OFFSET, 8));
                }
                Activity::State(change) => match change.next(now) {
                    Next::Send(request) => return Next::Send(request),
                    Next::WaitUntil(instant) => return Next::WaitUntil(instant),
                    Next::Done(Ok(_)) => self.step_done(),
                    Next::Done(Err(error)) => {
                        // What was programmed is the set-up's to say: this may be the cycle.
                        let cause = StartUpFailure::State { error, programmed: Vec::new() };
                        self.outcome = Some(Err(cause));
                    }
                },
                Activity::Write | Activity::ReadBack { .. } => {
                    let next = match &mut self.mailbox {
                        Some(mailbox) => mailbox.next(now),
                        None => Next::Done(None),
                    };
                    match next {
                        Next::Send(request) => return Next::Send(request),
                        Next::WaitUntil(instant) => return Next::WaitUntil(instant),
                        Next::Done(completion) => self.completed(completion, now),
                    }
                }
            }
        }
    }

    fn fill(&self, data: &mut [u8]) {
        match (&self.activity, &self.mailbox) {
            (Activity::Registers { .. }, _) => {
                if let Some(StartUpStep::Registers { data: bytes, .. }) = self.steps.get(self.next) {
                    data.copy_from_slice(bytes);
                }
            }
            (Activity::WriteOffset { offset, .. }, _) => data.copy_from_slice(&offset.to_le_bytes()),
            (Activity::State(change), _) => change.fill(data),
            (Activity::Write | Activity::ReadBack { .. }, Some(mailbox)) => mailbox.fill(data),
            _ => {}
        }
    }

    fn answer(&mut self, answer: Answer<'_>, now: HostTime) {
        match (&mut self.activity, &mut self.mailbox) {
            (Activity::State(change), _) => return change.answer(answer, now),
            (Activity::Write | Activity::ReadBack { .. }, Some(mailbox)) => {
                return mailbox.answer(answer, now);
            }
            _ => {}
        }
        let data = match answer.data(1) {
            Ok(data) => data,
            Err(found) => {
                self.gives_up(found, now);
                return;
            }
        };
        match (&self.activity, self.reference_time.take()) {
            (Activity::ReadClock { .. }, Some(reference)) => {
                let (shown, present) = (u64_at(data, 0), u64_at(data, CLOCK_LENGTH - 8));
                let should = reference.0.wrapping_add(u64::from(self.delay_ns));
                let offset = present.wrapping_add(should.wrapping_sub(shown));
                self.activity = Activity::WriteOffset { offset, failures: 0 };
            }
            // The frame carried no time of the reference clock: once more.
            (Activity::ReadClock { .. }, None) => {
                self.gives_up(Found::WorkingCounter(1), now);
            }
            _ => self.step_done(),
        }
    }
}

#[cfg(test)]
mod tests;
