//! Runs one SubDevice's start-up list, datagram by datagram.

use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;

use super::{ReadBack, Refusal, SdoWrite, StartUpStep};
use crate::error::Found;
use crate::mailbox::{Completion, Mailbox, MailboxError, MailboxRequest, Operation};
use crate::procedure::{Answer, Next, Procedure, Request};
use crate::state::{Application, StateChange, StateError};
use crate::transaction::Target;
use crate::wire::bytes::u64_at;
use crate::wire::coe::ObjectAddress;
use crate::wire::{AlState, DcTime, HostTime, register};

/// Attempts at writing registers.
const ATTEMPTS: u32 = 4;
/// Pause between them.
const PAUSE: core::time::Duration = core::time::Duration::from_millis(1);
/// Bytes from the system time (0x0910) to the end of its offset (0x0927).
const CLOCK_LENGTH: usize = 24;
/// Bytes that a read back may have beyond what was written before it is refused.
const READ_BACK_SLACK: usize = 256;

/// Which step of a start-up list failed, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StartUpError {
    /// The SubDevice.
    pub position: u16,
    /// Why.
    pub cause: StartUpFailure,
}

/// Registers as they were programmed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProgrammedRegisters {
    /// What they are.
    pub what: &'static str,
    /// The first.
    pub register: u16,
    /// Bytes.
    pub data: Vec<u8>,
}

/// Why a step of a start-up list failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StartUpFailure {
    /// Registers could not be written.
    Registers {
        /// What they program.
        what: &'static str,
        /// First register.
        register: u16,
        /// What came back.
        found: Found,
    },
    /// A state was not reached.
    State {
        /// Which, and why.
        error: StateError,
        /// The registers that were programmed before, for these are the usual cause.
        programmed: Vec<ProgrammedRegisters>,
    },
    /// An SDO step for a SubDevice without a mailbox that speaks CoE.
    NoMailbox {
        /// The object.
        object: ObjectAddress,
        /// Where it was asked.
        origin: Option<String>,
    },
    /// An SDO was refused or not answered.
    Sdo {
        /// What was tried.
        operation: Operation,
        /// Why it failed.
        error: MailboxError,
        /// Where it was asked.
        origin: Option<String>,
    },
    /// What was read back isn't what was written.
    ReadBack {
        /// The object.
        object: ObjectAddress,
        /// Written.
        written: Vec<u8>,
        /// Read back.
        read: Vec<u8>,
        /// The SubDevice's answer to the writing, where it refused.
        refusal: Option<MailboxError>,
        /// Where it was asked.
        origin: Option<String>,
    },
    /// A step that only the cycle can do (arming SYNC) was given to the set-up.
    NeedsCycle,
}

/// Little-endian bytes as a number where they are one, else as they are.
struct Value<'a>(&'a [u8]);

impl fmt::Display for Value<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0.len() {
            1 | 2 | 4 | 8 => {
                f.write_str("0x")?;
                self.0.iter().rev().try_for_each(|byte| write!(f, "{byte:02x}"))
            }
            length => write!(f, "{length} bytes {:02x?}", &self.0[..length.min(32)]),
        }
    }
}

impl fmt::Display for StartUpError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let StartUpFailure::State { error, programmed } = &self.cause {
            write!(f, "{error}; programmed:")?;
            return programmed.iter().try_for_each(|ProgrammedRegisters { what, register, data }| {
                write!(f, " {what} (0x{register:04x}) {data:02x?}")
            });
        }
        write!(f, "SubDevice {}: ", self.position)?;
        let origin = match &self.cause {
            StartUpFailure::Registers { what, register, found } => {
                write!(
                    f,
                    "{what} (register 0x{register:04x}): {found} where working counter 1 was expected"
                )?;
                &None
            }
            StartUpFailure::NoMailbox { object, origin } => {
                write!(f, "SDO {object} was asked, but the SubDevice has no CoE mailbox")?;
                origin
            }
            StartUpFailure::Sdo { operation, error, origin } => {
                write!(f, "{operation}: {error}")?;
                origin
            }
            StartUpFailure::ReadBack { object, written, read, refusal, origin } => {
                let (written, read) = (Value(written), Value(read));
                write!(f, "SDO {object}: {written} was written, {read} read back")?;
                if let Some(refusal) = refusal {
                    write!(f, "; the writing was refused: {refusal}")?;
                }
                origin
            }
            StartUpFailure::NeedsCycle => {
                f.write_str("arming SYNC needs process data that flow")?;
                &None
            }
            StartUpFailure::State { .. } => &None,
        };
        match origin {
            Some(origin) => write!(f, " ({origin})"),
            None => Ok(()),
        }
    }
}

impl core::error::Error for StartUpError {}

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
/// The set-up drives it beside those of all other SubDevices; a recovery drives it in the cycle's spare datagram.
#[derive(Debug)]
pub struct StartUpRunner {
    target: Target,
    application: Application,
    steps: Vec<StartUpStep>,
    next: usize,
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
        StartUpRunner {
            target,
            application,
            steps,
            next: 0,
            mailbox,
            activity: Activity::Begin,
            wait_until: None,
            reference_time: None,
            delay_ns: 0,
            outcome: None,
        }
    }

    /// The steps that are still to be done, the present one first.
    pub fn remaining(&self) -> &[StartUpStep] {
        &self.steps[self.next.min(self.steps.len())..]
    }

    /// The segment's time in the frame whose answer is given next; [`StartUpStep::ClockOffset`] needs it.
    pub fn set_reference_time(&mut self, time: DcTime) {
        self.reference_time = Some(time);
    }

    /// Gives the mailbox back.
    pub fn into_mailbox(self) -> Option<Mailbox> {
        self.mailbox
    }

    fn step_done(&mut self) {
        self.next += 1;
        self.activity = Activity::Begin;
    }

    fn programmed(&self) -> Vec<ProgrammedRegisters> {
        let done = self.steps.iter().take(self.next);
        done.filter_map(|step| match step {
            StartUpStep::Registers { register, data, what, .. } => {
                Some(ProgrammedRegisters { what, register: *register, data: data.clone() })
            }
            _ => None,
        })
        .collect()
    }

    fn sdo(&self) -> Option<&SdoWrite> {
        match self.steps.get(self.next) {
            Some(StartUpStep::Sdo(sdo)) => Some(sdo),
            _ => None,
        }
    }

    /// Begins the present step.
    fn begin(&mut self, now: HostTime) {
        self.activity = match self.steps.get(self.next) {
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
                let request = MailboxRequest::new(operation, sdo.data.clone());
                self.start_request(request, now);
                Activity::Write
            }
        };
    }

    fn start_request(&mut self, request: MailboxRequest, now: HostTime) {
        let started = self.mailbox.as_mut().is_some_and(|mailbox| mailbox.start(request, now).is_ok());
        if let (false, Some(sdo)) = (started, self.sdo()) {
            let (object, origin) = (sdo.object, sdo.origin.clone());
            self.outcome = Some(Err(StartUpFailure::NoMailbox { object, origin }));
        }
    }

    fn completed(&mut self, completion: Option<Completion>, now: HostTime) {
        let Some(sdo) = self.sdo().cloned() else { return };
        let (object, origin) = (sdo.object, sdo.origin.clone());
        let (result, request) = match completion {
            Some(Completion { request, result }) => (result, Some(request)),
            None => (Err(MailboxError::Reset), None),
        };
        let operation = match self.activity {
            Activity::Write => Operation::Download { object, access: sdo.access },
            _ => Operation::Upload { object, access: sdo.access },
        };
        let tolerated = sdo.refusal == Refusal::IsTolerated
            && matches!(result, Err(MailboxError::Aborted { .. }))
            && matches!(self.activity, Activity::Write);
        let refusal = match result {
            Ok(()) => None,
            Err(error) if tolerated => Some(error),
            Err(error) => {
                self.outcome = Some(Err(StartUpFailure::Sdo { operation, error, origin }));
                return;
            }
        };
        match (&mut self.activity, sdo.read_back) {
            (Activity::ReadBack { refusal }, _) => {
                let refusal = refusal.take();
                let read = request.map(|request| request.data).unwrap_or_default();
                if read != sdo.data {
                    let written = sdo.data;
                    let cause = StartUpFailure::ReadBack { object, written, read, refusal, origin };
                    self.outcome = Some(Err(cause));
                    return;
                }
                self.step_done();
            }
            (_, ReadBack::Skip) => self.step_done(),
            (_, ReadBack::Compare) => {
                let buffer = Vec::with_capacity(sdo.data.len() + READ_BACK_SLACK);
                let request = MailboxRequest::new(Operation::Upload { object, access: sdo.access }, buffer);
                self.start_request(request, now);
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
                    return Next::Send(Request::write(station, *register, data.len()));
                }
                Activity::ReadClock { .. } => {
                    return Next::Send(Request::read(station, register::DC_SYSTEM_TIME, CLOCK_LENGTH));
                }
                Activity::WriteOffset { .. } => {
                    return Next::Send(Request::write(station, register::DC_SYSTEM_TIME_OFFSET, 8));
                }
                Activity::State(change) => match change.next(now) {
                    Next::Send(request) => return Next::Send(request),
                    Next::WaitUntil(instant) => return Next::WaitUntil(instant),
                    Next::Done(Ok(_)) => self.step_done(),
                    Next::Done(Err(error)) => {
                        let programmed = self.programmed();
                        self.outcome = Some(Err(StartUpFailure::State { error, programmed }));
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
