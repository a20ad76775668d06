//! The AL state machine: requests, checks, and falling back.

use super::{Firmware, checks, process_data::Entry};
use crate::pdi::Pdi;
use core::time::Duration;
use omnibase_ethercat_wire::bytes::u16_at;
use omnibase_ethercat_wire::register as reg;
use omnibase_ethercat_wire::{AlState, AlStatusCode, HostTime};

/// How often a device that waits for outputs looks again.
const WAIT_STEP: Duration = Duration::from_micros(500);

/// The present state, and the change on its way.
#[derive(Clone, Copy, Debug)]
pub(super) struct StateMachine {
    state: AlState,
    error: bool,
    pending: Option<Pending>,
}

#[derive(Clone, Copy, Debug)]
struct Pending {
    target: Result<AlState, AlStatusCode>,
    due: HostTime,
    /// When a device that waits for outputs gives up.
    deadline: HostTime,
}

impl Default for StateMachine {
    fn default() -> Self {
        StateMachine { state: AlState::Init, error: false, pending: None }
    }
}

impl StateMachine {
    pub fn state(&self) -> AlState {
        self.state
    }

    /// Whether the device shows an error that nobody acknowledged.
    pub fn has_error(&self) -> bool {
        self.error
    }

    /// When a change wants to be finished.
    pub fn due(&self) -> Option<HostTime> {
        self.pending.map(|pending| pending.due)
    }

    pub fn is_due(&self, now: HostTime) -> bool {
        self.pending.is_some_and(|pending| pending.due <= now)
    }

    /// The state as a chip without firmware has it.
    pub fn force(&mut self, state: AlState) {
        *self = StateMachine { state, error: false, pending: None };
    }

    /// Whether a change to a lower state is on its way.
    fn is_falling(&self) -> bool {
        self.pending.is_some_and(|pending| pending.target.is_ok_and(|target| target < self.state))
    }
}

/// Whether the standard allows the change (ETG.1000.6, state machine).
fn check_change(from: AlState, to: AlState, has_bootstrap: bool) -> Result<(), AlStatusCode> {
    use AlState::{Bootstrap, Init, Op, PreOp, SafeOp};
    match (from, to) {
        (Init, Bootstrap) if !has_bootstrap => Err(AlStatusCode::BOOTSTRAP_NOT_SUPPORTED),
        (_, Init) | (Init, PreOp | Bootstrap) | (Bootstrap, Bootstrap) => Ok(()),
        (PreOp, PreOp | SafeOp) | (SafeOp | Op, PreOp | SafeOp | Op) => Ok(()),
        _ => Err(AlStatusCode::INVALID_STATE_CHANGE),
    }
}

impl Firmware {
    /// AL control was written.
    pub(super) fn request_state(&mut self, pdi: &mut dyn Pdi, now: HostTime) {
        let mut control = [0; 2];
        pdi.read(reg::AL_CONTROL, &mut control);
        let control = u16_at(&control, 0);
        let requested = AlState::from_bits(control);
        if control & AlState::ERROR != 0 {
            if self.states.error {
                self.states.error = false;
                self.write_state(pdi, AlStatusCode::NO_ERROR);
            }
        } else if self.states.error && requested != Some(AlState::Init) {
            return;
        }
        if control & AlState::IDENTIFICATION != 0 && requested == Some(self.states.state) {
            self.identify(pdi);
            return;
        }
        let target = match requested {
            None => Err(AlStatusCode::UNKNOWN_STATE),
            Some(target) => {
                check_change(self.states.state, target, self.config.bootstrap.is_some()).map(|()| target)
            }
        };
        let step = match target {
            Ok(target) if target == self.states.state => 0,
            _ => self.config.times.step_ns,
        };
        let due = now + Duration::from_nanos(step);
        let deadline = due + Duration::from_nanos(self.config.times.output_timeout_ns);
        self.states.pending = Some(Pending { target, due, deadline });
    }

    /// Does the change that was asked for a transition's time ago.
    pub(super) fn finish_transition(&mut self, pdi: &mut dyn Pdi, now: HostTime) {
        let Some(pending) = self.states.pending.take() else { return };
        let from = self.states.state;
        let result = match pending.target {
            Err(code) => Err(code),
            Ok(target) if target == from => {
                self.states.error = false;
                self.write_state(pdi, AlStatusCode::NO_ERROR);
                return;
            }
            Ok(target) if target < from && target != AlState::Bootstrap => {
                self.leave(pdi, target, AlStatusCode::NO_ERROR);
                return;
            }
            Ok(target) => match self.check_entry(pdi, target) {
                Ok(Entry::Ready) => Ok(target),
                Ok(Entry::Waiting(_)) if now < pending.deadline => {
                    self.states.pending = Some(Pending { due: now + WAIT_STEP, ..pending });
                    return;
                }
                Ok(Entry::Waiting(code)) => Err(code),
                Err(code) => Err(code),
            },
        };
        match result {
            Ok(target) => self.enter(pdi, target, now),
            Err(code) => {
                self.states.error = true;
                self.write_state(pdi, code);
            }
        }
    }

    fn check_entry(&mut self, pdi: &mut dyn Pdi, target: AlState) -> Result<Entry, AlStatusCode> {
        match target {
            AlState::Init => Ok(Entry::Ready),
            AlState::Bootstrap => match self.config.bootstrap {
                Some(area) if checks::mailbox(pdi, &area) => Ok(Entry::Ready),
                _ => Err(AlStatusCode::INVALID_MAILBOX_BOOTSTRAP),
            },
            AlState::PreOp => match &self.mailbox {
                Some(mailbox) if !checks::mailbox(pdi, &mailbox.area()) => Err(AlStatusCode::INVALID_MAILBOX),
                Some(mailbox) if mailbox.lacks_firmware() => Err(AlStatusCode::NO_VALID_FIRMWARE),
                _ => Ok(Entry::Ready),
            },
            AlState::SafeOp => self.process.prepare(pdi, &mut self.dictionary).map(|()| Entry::Ready),
            AlState::Op => self.process.check_op_only(pdi).map(|()| self.process.ready_for_op()),
        }
    }

    fn enter(&mut self, pdi: &mut dyn Pdi, target: AlState, now: HostTime) {
        self.states.state = target;
        self.states.error = false;
        match target {
            AlState::PreOp | AlState::Bootstrap => {
                let area = match target {
                    AlState::Bootstrap => self.config.bootstrap,
                    _ => self.config.mailbox.map(|(area, _)| area),
                };
                if let (Some(mailbox), Some(area)) = (&mut self.mailbox, area) {
                    mailbox.reset_at(area);
                    mailbox.synchronize_repeat(pdi);
                }
            }
            AlState::SafeOp => self.process.start(pdi, &self.dictionary, now),
            AlState::Op => self.process.enter_op(pdi, &mut self.dictionary),
            AlState::Init => {}
        }
        self.device.state_changed(&mut self.dictionary, target, AlStatusCode::NO_ERROR);
        self.write_state(pdi, AlStatusCode::NO_ERROR);
        self.write_event_mask(pdi);
    }

    /// Goes down to `target` with an error.
    pub(super) fn fall(&mut self, pdi: &mut dyn Pdi, target: AlState, code: AlStatusCode) {
        self.states.pending = None;
        self.states.error = true;
        self.leave(pdi, target, code);
    }

    fn leave(&mut self, pdi: &mut dyn Pdi, target: AlState, code: AlStatusCode) {
        self.states.state = target;
        self.states.error = code != AlStatusCode::NO_ERROR;
        if !matches!(target, AlState::SafeOp | AlState::Op) {
            self.process.stop();
        }
        if let (AlState::Init, Some(mailbox), Some((area, _))) =
            (target, &mut self.mailbox, self.config.mailbox)
        {
            mailbox.reset_at(area);
        }
        self.device.state_changed(&mut self.dictionary, target, code);
        self.write_state(pdi, code);
        self.write_event_mask(pdi);
    }

    fn write_state(&self, pdi: &mut dyn Pdi, code: AlStatusCode) {
        let error = if self.states.error { AlState::ERROR } else { 0 };
        pdi.write(reg::AL_STATUS_CODE, &code.0.to_le_bytes());
        pdi.write(reg::AL_STATUS, &(self.states.state.bits() | error).to_le_bytes());
    }

    /// The identification, or the station alias, in the status code register, as ETG.1020's explicit identification wants it.
    fn identify(&self, pdi: &mut dyn Pdi) {
        let mut number = [0; 2];
        match self.config.identification {
            Some(identification) => number = identification.to_le_bytes(),
            None => {
                pdi.read(reg::STATION_ALIAS, &mut number);
            }
        }
        pdi.write(reg::AL_STATUS_CODE, &number);
        pdi.write(reg::AL_STATUS, &(self.states.state.bits() | AlState::IDENTIFICATION).to_le_bytes());
    }

    /// A SyncManager was switched on or off, or a mailbox message is wanted again.
    pub(super) fn sync_managers_changed(&mut self, pdi: &mut dyn Pdi) {
        let state = self.states.state;
        let on = self.mailbox_is_on();
        let mut still_on = true;
        if let (true, Some(mailbox)) = (on, &mut self.mailbox) {
            still_on = checks::mailbox_enabled(pdi);
            mailbox.check_repeat(pdi);
        }
        let stopped = match state {
            AlState::SafeOp | AlState::Op => self.process.switched_off(pdi),
            _ => None,
        };
        acknowledge_changes(pdi);
        if self.states.is_falling() {
            return;
        }
        if !still_on {
            self.fall(pdi, AlState::Init, AlStatusCode::INVALID_MAILBOX);
        } else if let Some(code) = stopped {
            self.fall(pdi, AlState::PreOp, code);
        }
    }

    /// The process-data watchdog bit of the event word is set.
    pub(super) fn watchdog_expired(&mut self, pdi: &mut dyn Pdi) {
        let mut status = [0; 2];
        pdi.read(reg::WATCHDOG_STATUS, &mut status);
        if self.states.state == AlState::Op && status[0] & 1 == 0 {
            self.fall(pdi, AlState::SafeOp, AlStatusCode::SM_WATCHDOG);
        }
    }
}

/// Reading the activation register of a SyncManager clears its part of the event.
pub(super) fn acknowledge_changes(pdi: &mut dyn Pdi) {
    let mut count = [0];
    pdi.read(reg::SM_COUNT, &mut count);
    for number in 0..u16::from(count[0].min(16)) {
        pdi.read(reg::SM + reg::SM_SIZE * number + 6, &mut [0]);
    }
}
