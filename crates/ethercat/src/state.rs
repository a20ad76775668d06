//! Application layer states: asking for one, waiting for it, and saying why it was refused.

use core::fmt;
use core::time::Duration;

use crate::found::Found;
use crate::found::Target;
use crate::procedure::{Answer, DatagramRequest, Next, Procedure};
use crate::wire::bytes::u16_at;
use crate::wire::{AlState, AlStatusCode, HostTime, register, spoken};

/// Pause between two looks at the state.
const POLL_PAUSE: Duration = Duration::from_millis(1);
/// Looks in a row that may go unanswered before the SubDevice counts as gone.
const FAILURE_LIMIT: u32 = 20;

/// The longest wait for each state (ETG.2000, default time-outs of the states).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StateTimeouts {
    /// To INIT, from any state.
    pub init: Duration,
    /// INIT to PRE-OP or BOOT.
    pub pre_op: Duration,
    /// PRE-OP to SAFE-OP.
    pub safe_op: Duration,
    /// SAFE-OP to OP.
    pub op: Duration,
}

impl Default for StateTimeouts {
    fn default() -> Self {
        StateTimeouts {
            init: Duration::from_secs(5),
            pre_op: Duration::from_secs(3),
            safe_op: Duration::from_secs(10),
            op: Duration::from_secs(10),
        }
    }
}

impl StateTimeouts {
    /// The longest wait for `state`.
    pub fn of(&self, state: AlState) -> Duration {
        match state {
            AlState::Init => self.init,
            AlState::PreOp | AlState::Bootstrap => self.pre_op,
            AlState::SafeOp => self.safe_op,
            AlState::Op => self.op,
        }
    }
}

/// AL status and its code, as one read of 0x0130 to 0x0135 gives them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AlStatus {
    /// Register 0x0130.
    pub bits: u16,
    /// Register 0x0134.
    pub code: AlStatusCode,
}

impl AlStatus {
    /// Bytes to read from register 0x0130.
    pub const LENGTH: usize = 6;

    /// Reads the six bytes; `None` where there are fewer.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        (bytes.len() >= Self::LENGTH)
            .then(|| AlStatus { bits: u16_at(bytes, 0), code: AlStatusCode(u16_at(bytes, 4)) })
    }

    /// The state; `None` for a value that is no state.
    pub fn state(self) -> Option<AlState> {
        AlState::from_bits(self.bits)
    }

    /// The error bit is set.
    pub fn has_error(self) -> bool {
        self.bits & AlState::ERROR != 0
    }
}

impl fmt::Display for AlStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.state() {
            Some(state) => write!(f, "{state}")?,
            None => write!(f, "AL status 0x{:04x}", self.bits)?,
        }
        if self.has_error() {
            write!(f, " with error {}", self.code)?;
            let cause = self.code.probable_cause();
            if !cause.is_empty() {
                write!(f, " ({cause})")?;
            }
        }
        Ok(())
    }
}

/// Whether a SubDevice has an application that answers state requests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Application {
    /// It has: the error bit means an error.
    #[default]
    Controller,
    /// The controller chip copies AL control to AL status (device emulation, 0x0141 bit 0): the bit set there is
    /// an echo of the acknowledge bit.
    Emulated,
}

/// Why a state was not reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StateError {
    /// The SubDevice.
    pub position: u16,
    /// The state that was asked.
    pub requested: AlState,
    /// The last that was seen of its state.
    pub status: Option<AlStatus>,
    /// What went wrong.
    pub cause: StateFailure,
}

/// What went wrong with a change of state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StateFailure {
    /// The SubDevice refused.
    Refused,
    /// It did not get there in time.
    Timeout(Duration),
    /// It did not answer.
    NoAnswer(Found),
}

impl fmt::Display for StateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SubDevice {}: {} ", self.position, self.requested)?;
        match self.cause {
            StateFailure::Refused => f.write_str("refused")?,
            StateFailure::Timeout(limit) => write!(f, "not reached within {}", spoken(limit))?,
            StateFailure::NoAnswer(found) => {
                write!(f, "not reached: {}", found.against(1))?;
            }
        }
        match self.status {
            Some(status) => write!(f, "; it is in {status}"),
            None => f.write_str("; its state was never read"),
        }
    }
}

impl core::error::Error for StateError {}

/// What the next datagram is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Look for an error of before.
    Before,
    /// Acknowledge it.
    Acknowledge,
    /// See it gone.
    Acknowledged,
    /// Ask for the state.
    Ask,
    /// Wait for it.
    Wait,
}

/// Asks one SubDevice for a state and waits for it.
#[derive(Debug)]
pub struct StateChange {
    target: Target,
    requested: AlState,
    application: Application,
    timeout: Duration,
    deadline: Option<HostTime>,
    phase: Stage,
    wait_until: Option<HostTime>,
    failures: u32,
    status: Option<AlStatus>,
    outcome: Option<Result<AlStatus, StateFailure>>,
}

impl StateChange {
    /// A change of `target` to `requested` within `timeout`.
    pub fn new(target: Target, application: Application, requested: AlState, timeout: Duration) -> Self {
        StateChange {
            target,
            requested,
            application,
            timeout,
            deadline: None,
            phase: Stage::Before,
            wait_until: None,
            failures: 0,
            status: None,
            outcome: None,
        }
    }

    fn erroneous(&self, status: AlStatus) -> bool {
        status.has_error() && self.application == Application::Controller
    }

    fn control(&self) -> u16 {
        match (self.phase, self.status.and_then(AlStatus::state)) {
            (Stage::Acknowledge, state) => state.unwrap_or(AlState::Init).bits() | AlState::ERROR,
            _ => self.requested.bits(),
        }
    }

    fn take_status(&mut self, status: AlStatus, now: HostTime) {
        self.status = Some(status);
        let reached = status.state() == Some(self.requested) && !self.erroneous(status);
        match self.phase {
            Stage::Before if self.erroneous(status) => self.phase = Stage::Acknowledge,
            Stage::Before => self.phase = Stage::Ask,
            Stage::Acknowledged if !self.erroneous(status) => self.phase = Stage::Ask,
            Stage::Wait if reached => self.outcome = Some(Ok(status)),
            Stage::Wait if self.erroneous(status) => self.outcome = Some(Err(StateFailure::Refused)),
            _ => self.wait_until = Some(now + POLL_PAUSE),
        }
    }
}

impl Procedure for StateChange {
    type Output = Result<AlStatus, StateError>;

    fn next(&mut self, now: HostTime) -> Next<Self::Output> {
        let deadline = *self.deadline.get_or_insert(now + self.timeout);
        if self.outcome.is_none() && now >= deadline {
            self.outcome = Some(Err(StateFailure::Timeout(self.timeout)));
        }
        if let Some(outcome) = self.outcome {
            let (position, requested, status) = (self.target.position, self.requested, self.status);
            return Next::Done(outcome.map_err(|cause| StateError { position, requested, status, cause }));
        }
        if let Some(instant) = self.wait_until {
            if now < instant {
                return Next::WaitUntil(instant.min(deadline));
            }
            self.wait_until = None;
        }
        let station = self.target.station;
        Next::Send(match self.phase {
            Stage::Acknowledge | Stage::Ask => DatagramRequest::write(station, register::AL_CONTROL, 2),
            _ => DatagramRequest::read(station, register::AL_STATUS, AlStatus::LENGTH),
        })
    }

    fn fill(&self, data: &mut [u8]) {
        if let Stage::Acknowledge | Stage::Ask = self.phase {
            data.copy_from_slice(&self.control().to_le_bytes());
        }
    }

    fn answer(&mut self, answer: Answer<'_>, now: HostTime) {
        let data = match answer.data(1) {
            Ok(data) => data,
            Err(found) => {
                self.failures += 1;
                if self.failures >= FAILURE_LIMIT {
                    self.outcome = Some(Err(StateFailure::NoAnswer(found)));
                }
                // A processor that has yet to read the request before takes none, and shows by its status that it is there.
                if let Stage::Acknowledge | Stage::Ask = self.phase {
                    self.phase = Stage::Before;
                }
                self.wait_until = Some(now + POLL_PAUSE);
                return;
            }
        };
        self.failures = 0;
        match self.phase {
            Stage::Acknowledge => self.phase = Stage::Acknowledged,
            Stage::Ask => self.phase = Stage::Wait,
            _ => {
                if let Some(status) = AlStatus::read(data) {
                    self.take_status(status, now);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Answers every look with `bits` and every write with success; the control words that were written.
    fn change(application: Application, bits: u16) -> (Result<AlStatus, StateError>, Vec<u16>) {
        let target = Target { position: 4, station: 0x1005 };
        let mut change = StateChange::new(target, application, AlState::PreOp, Duration::from_secs(3));
        let (mut now, mut written) = (HostTime(0), Vec::new());
        loop {
            match change.next(now) {
                Next::Done(result) => return (result, written),
                Next::WaitUntil(instant) => now = instant,
                Next::Send(request) => {
                    let mut data = vec![0; request.length];
                    change.fill(&mut data);
                    if request.length == 2 {
                        written.push(u16_at(&data, 0));
                    } else {
                        data[..2].copy_from_slice(&bits.to_le_bytes());
                    }
                    change.answer(Answer::Returned { working_counter: 1, data: &data }, now);
                }
            }
        }
    }

    #[test]
    fn the_error_bit_of_an_emulated_status_is_an_echo() {
        let (result, written) = change(Application::Emulated, 0x12);
        assert_eq!((result.map(AlStatus::state), written), (Ok(Some(AlState::PreOp)), vec![2]));
        // With an application the same word is an error, which is acknowledged but stays.
        let (result, written) = change(Application::Controller, 0x12);
        assert_eq!(written, [0x12]);
        let error = result.unwrap_err();
        assert_eq!(error.cause, StateFailure::Timeout(Duration::from_secs(3)));
        assert_eq!(
            error.to_string(),
            "SubDevice 4: PRE-OP not reached within 3 s; it is in PRE-OP with error 0x0000 no error"
        );
    }

    #[test]
    fn a_subdevice_that_is_gone_is_named_long_before_the_timeout() {
        let target = Target { position: 4, station: 0x1005 };
        let mut change =
            StateChange::new(target, Application::Controller, AlState::SafeOp, Duration::from_secs(10));
        let mut now = HostTime(0);
        let error = loop {
            match change.next(now) {
                Next::Done(result) => break result.unwrap_err(),
                Next::WaitUntil(instant) => now = instant,
                Next::Send(_) => change.answer(Answer::Returned { working_counter: 0, data: &[] }, now),
            }
        };
        assert_eq!(error.cause, StateFailure::NoAnswer(Found::WorkingCounter(0)));
        assert!(now < HostTime(1_000_000_000), "{now:?}");
    }
}
