//! The SubDevice's stack: what firmware does between the ESC and the device's application.
//!
//! [`Firmware`] runs a [`Device`] behind any [`Pdi`]: AL state machine with its checks, mailbox with CoE server,
//! process data, synchronisation. It is driven by events and costs little in a cycle: one read of the outputs, one
//! write of the inputs, one read of SYNC0's acknowledge.

mod checks;
mod coe;
mod foe;
mod mailbox;
mod process_data;
mod state_machine;

pub use checks::{ProcessSyncManager, SmActivation};
pub use foe::{FileStore, Files};
pub use mailbox::MailboxProtocols;
pub use process_data::{PdoRules, SyncMonitoring, Synchronization};

use crate::device::{Device, Moment, Outputs};
use crate::dictionary::Dictionary;
use crate::pdi::{AlEvent, Application, ApplicationFault, Pdi};
use coe::Served;
use mailbox::MailboxServer;
use omnibase_ethercat_wire::bytes::u16_at;
use omnibase_ethercat_wire::register::{self as reg, al_event};
use omnibase_ethercat_wire::sii::MailboxArea;
use omnibase_ethercat_wire::{AlState, AlStatusCode, HostTime};
use process_data::ProcessData;
use state_machine::StateMachine;

/// How long a device takes to change its state, ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TransitionTimes {
    /// One step between INIT, PRE-OP and SAFE-OP, up or down.
    pub step_ns: u64,
    /// How long the device waits for outputs (and SYNC0) on its way to OP.
    pub output_timeout_ns: u64,
}

impl Default for TransitionTimes {
    fn default() -> Self {
        TransitionTimes { step_ns: 500_000, output_timeout_ns: 100_000_000 }
    }
}

/// Who answers AL control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StateControl {
    /// Firmware, with checks.
    Firmware,
    /// The chip: AL status repeats AL control, acknowledge bit included ("device emulation").
    Emulated,
}

/// What the stack must know of the device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FirmwareConfig {
    /// Who answers AL control.
    pub state_control: StateControl,
    /// What its switch for explicit device identification shows; `None` tells the alias, as devices without one do.
    pub identification: Option<u16>,
    /// Mailboxes and what answers in them.
    pub mailbox: Option<(MailboxArea, MailboxProtocols)>,
    /// Mailboxes in BOOT; `None` where the device has no BOOT.
    pub bootstrap: Option<MailboxArea>,
    /// SyncManagers with process data.
    pub process_data: Vec<ProcessSyncManager>,
    /// Which PDOs go together.
    pub pdo_rules: PdoRules,
    /// How process data are synchronised.
    pub synchronization: Synchronization,
    /// Durations.
    pub times: TransitionTimes,
}

/// The firmware of a SubDevice.
pub struct Firmware {
    config: FirmwareConfig,
    dictionary: Dictionary,
    device: Box<dyn Device>,
    states: StateMachine,
    mailbox: Option<MailboxServer>,
    process: ProcessData,
    injected: Option<AlStatusCode>,
    silent: bool,
}

impl Firmware {
    /// Firmware for `device`, whose objects stand in `dictionary`.
    pub fn new(config: FirmwareConfig, dictionary: Dictionary, device: Box<dyn Device>) -> Self {
        let mailbox = config.mailbox.map(|(area, protocols)| MailboxServer::new(area, protocols));
        let process = ProcessData::new(&config, &dictionary);
        Firmware {
            config,
            dictionary,
            device,
            states: StateMachine::default(),
            mailbox,
            process,
            injected: None,
            silent: false,
        }
    }

    /// The same with files, taken over FoE in BOOT; nothing changes for a device without a mailbox.
    pub fn with_files(mut self, store: FileStore) -> Self {
        if let Some(mailbox) = &mut self.mailbox {
            mailbox.serve_files(store);
        }
        self
    }

    /// The dictionary with its present values.
    pub fn dictionary(&self) -> &Dictionary {
        &self.dictionary
    }

    /// The present AL state.
    pub fn state(&self) -> AlState {
        self.states.state()
    }

    fn mailbox_is_on(&self) -> bool {
        matches!(self.states.state(), AlState::PreOp | AlState::SafeOp | AlState::Op | AlState::Bootstrap)
    }

    /// Sets which events wake the application.
    fn write_event_mask(&self, pdi: &mut dyn Pdi) {
        let mut mask = al_event::AL_CONTROL | al_event::SM_CHANGED;
        if self.mailbox_is_on() && self.mailbox.is_some() {
            mask |= al_event::sync_manager(0) | al_event::sync_manager(1);
        }
        if matches!(self.states.state(), AlState::SafeOp | AlState::Op) {
            mask |= al_event::WATCHDOG | self.process.events();
        }
        pdi.write(reg::AL_EVENT_MASK, &mask.to_le_bytes());
    }

    fn run_mailbox(&mut self, pdi: &mut dyn Pdi, event: u32, now: HostTime) {
        let (on, state) = (self.mailbox_is_on(), self.states.state());
        let Some(mailbox) = &mut self.mailbox else { return };
        if !on {
            return;
        }
        while let Some(emergency) = self.device.take_emergency().filter(|_| state != AlState::Bootstrap) {
            mailbox.push_emergency(emergency);
        }
        if event & al_event::sync_manager(0) != 0
            && mailbox.accepts()
            && mailbox.receive(pdi).is_some()
            && !self.silent
        {
            if state == AlState::PreOp {
                // Nothing else moves the device on before SAFE-OP, and uploads want present values.
                let moment = Moment { now, outputs: Outputs::Safe, cycle_ns: None };
                self.device.run(&mut self.dictionary, moment);
            }
            let mut served = Served {
                room: mailbox.room(),
                dictionary: &mut self.dictionary,
                device: self.device.as_mut(),
                state,
                max_process_data: self.process.max_bytes(),
            };
            mailbox.answer(&mut served);
        }
        if mailbox.has_messages() {
            mailbox.send(pdi);
        }
    }

    /// The terminals of a chip without firmware: they follow its memory while a SyncManager is on.
    fn run_terminals(&mut self, pdi: &mut dyn Pdi, event: u32, now: HostTime) {
        if event & al_event::AL_CONTROL != 0 {
            let mut control = [0; 2];
            pdi.read(reg::AL_CONTROL, &mut control);
            if let Some(state) = AlState::from_bits(u16_at(&control, 0)) {
                self.states.force(state);
                self.device.state_changed(&mut self.dictionary, state, AlStatusCode::NO_ERROR);
            }
        }
        if event & al_event::SM_CHANGED != 0 {
            state_machine::acknowledge_changes(pdi);
            if self.process.any_on(pdi) {
                self.process.start_unchecked(pdi, &self.dictionary, now);
            } else {
                self.process.stop();
            }
        }
        if self.process.is_due(now) {
            self.run_process_data(pdi, self.process.output_events(), now);
        }
    }
}

impl Application for Firmware {
    fn power_on(&mut self, pdi: &mut dyn Pdi, now: HostTime) {
        self.dictionary.restore_defaults();
        self.states = StateMachine::default();
        self.process = ProcessData::new(&self.config, &self.dictionary);
        self.injected = None;
        if let (Some(mailbox), Some((area, _))) = (&mut self.mailbox, self.config.mailbox) {
            mailbox.reset_at(area);
        }
        self.device.power_on(&mut self.dictionary, now);
        pdi.write(reg::AL_STATUS_CODE, &[0; 2]);
        pdi.write(reg::AL_STATUS, &AlState::Init.bits().to_le_bytes());
        self.write_event_mask(pdi);
    }

    fn power_off(&mut self) {
        self.device.power_off();
    }

    fn run(&mut self, pdi: &mut dyn Pdi, event: AlEvent, now: HostTime) -> Option<HostTime> {
        let AlEvent(event) = event;
        if self.config.state_control == StateControl::Emulated {
            self.run_terminals(pdi, event, now);
            return self.process.due();
        }
        if event & al_event::AL_CONTROL != 0 {
            self.request_state(pdi, now);
        }
        if event & al_event::SM_CHANGED != 0 {
            self.sync_managers_changed(pdi);
        }
        if event & al_event::WATCHDOG != 0 {
            self.watchdog_expired(pdi);
        }
        if let Some(code) = self.injected.take() {
            let below = self.states.state().min(AlState::SafeOp);
            self.fall(pdi, below, code);
        }
        if self.device.due().is_some_and(|due| due <= now) {
            self.device.tick(&mut self.dictionary, now);
        }
        if event & self.process.events() != 0 || self.process.is_due(now) {
            self.run_process_data(pdi, event, now);
        }
        if self.states.is_due(now) {
            self.finish_transition(pdi, now);
        }
        if self.mailbox.is_some() {
            self.run_mailbox(pdi, event, now);
        }
        earlier(earlier(self.states.due(), self.process.due()), self.device.due())
    }

    fn inject(&mut self, fault: &ApplicationFault, _: HostTime) -> bool {
        match fault {
            // A chip alone has no error of its own.
            ApplicationFault::AlError(_) if self.config.state_control == StateControl::Emulated => {
                return false;
            }
            ApplicationFault::AlError(code) => self.injected = Some(AlStatusCode(*code)),
            ApplicationFault::DriveFault(code) => return self.device.fault(&mut self.dictionary, *code),
            ApplicationFault::MailboxSilence(silent) => self.silent = *silent,
            // Who calls it sees to that.
            ApplicationFault::Frozen(_) => {}
            ApplicationFault::SafeTorqueOff(active) => return self.device.safe_torque_off(*active),
            ApplicationFault::Brake(per_mille) => return self.device.brake(*per_mille),
            ApplicationFault::Push(per_mille) => return self.device.push(*per_mille),
        }
        true
    }
}

fn earlier(one: Option<HostTime>, other: Option<HostTime>) -> Option<HostTime> {
    match (one, other) {
        (Some(one), Some(other)) => Some(one.min(other)),
        _ => one.or(other),
    }
}
