//! SubDevices that refuse a state, never reach it, or only echo what is written.

use omnibase_ethercat::start_up::{StartUpError, StartUpFailure};
use omnibase_ethercat::state::{AlStatus, StateError, StateFailure};
use omnibase_ethercat::wire::sii::Identity;
use omnibase_ethercat::wire::{AlState, AlStatusCode, Clock, HostTime, register};
use omnibase_ethercat::{Bus, BusOptions, SetUpError};
use omnibase_ethercat_sim::pdi::{AlEvent, Application, ApplicationFault, Pdi};
use omnibase_ethercat_sim::{EscConfig, Segment, SubDevice, in_process};

use crate::segment::{sii_of, with_mailbox};

/// Firmware with a bad habit.
enum Habit {
    /// PRE-OP is answered by INIT and this code.
    Refuses(u16),
    /// PRE-OP is never answered.
    Ignores,
    /// AL control is copied to AL status, acknowledge bit and all.
    Echoes,
    /// It is in INIT with an error from the beginning, and leaves it only by an acknowledge.
    StartsWithError(bool),
}

impl Application for Habit {
    fn power_on(&mut self, pdi: &mut dyn Pdi, _now: HostTime) {
        let error = if let Habit::StartsWithError(_) = self { 0x10 } else { 0 };
        pdi.write(register::AL_STATUS, &[1 | error, 0]);
    }

    fn run(&mut self, pdi: &mut dyn Pdi, event: AlEvent, _now: HostTime) -> Option<HostTime> {
        if event.0 & register::al_event::AL_CONTROL == 0 {
            return None;
        }
        let mut control = [0; 2];
        pdi.read(register::AL_CONTROL, &mut control);
        let (state, acknowledge) = (control[0] & 0x0F, control[0] & 0x10 != 0);
        match self {
            Habit::Refuses(code) if state == 2 => {
                pdi.write(register::AL_STATUS_CODE, &code.to_le_bytes());
                pdi.write(register::AL_STATUS, &[0x11, 0]);
            }
            Habit::Ignores if state == 2 => {}
            Habit::Echoes => {
                pdi.write(register::AL_STATUS, &control);
            }
            Habit::StartsWithError(pending) if *pending && !acknowledge => {}
            _ => {
                if let Habit::StartsWithError(pending) = self {
                    *pending = false;
                }
                pdi.write(register::AL_STATUS, &[state, 0]);
            }
        }
        None
    }

    fn inject(&mut self, _fault: &ApplicationFault, _now: HostTime) -> bool {
        false
    }
}

fn start_up(habit: Habit) -> (Result<(), SetUpError>, HostTime) {
    let identity = Identity { vendor_id: 9, product_code: 1, revision: 1, serial: 0 };
    let mut sii = with_mailbox(sii_of(identity, 0));
    if let Habit::Echoes = habit {
        // Device emulation: bit 0 of 0x0141, loaded from the first word.
        sii[1] = 1;
        sii[14] = omnibase_ethercat::wire::sii::checksum(sii[..14].try_into().unwrap());
    }
    let device = SubDevice::new(EscConfig { sii, ..EscConfig::default() }, Box::new(habit));
    let (link, clock) = in_process(Segment::line(vec![device]).unwrap());
    let mut bus = Bus::new(link, clock.clone(), BusOptions::default());
    let result = bus.scan().map(drop).and_then(|()| bus.configure(&[]));
    (result, clock.now())
}

#[test]
fn a_refusal_is_named_with_code_cause_and_what_was_programmed() {
    let (result, _) = start_up(Habit::Refuses(0x16));
    let error = result.unwrap_err();
    let SetUpError::StartUp(failed) = &error else { panic!("{error}") };
    let StartUpError { position: 0, cause: StartUpFailure::State { error: state, programmed } } = &**failed
    else {
        panic!("{error}");
    };
    let status = Some(AlStatus { bits: 0x11, code: AlStatusCode(0x16) });
    let requested = AlState::PreOp;
    assert_eq!(*state, StateError { position: 0, requested, status, cause: StateFailure::Refused });
    let mailboxes = programmed.iter().find(|one| one.what == "the mailboxes").unwrap();
    assert_eq!((mailboxes.register, mailboxes.data.len()), (0x0800, 16));
    let text = error.to_string();
    let refused = "SubDevice 0: PRE-OP refused; it is in INIT with error 0x0016 invalid mailbox configuration \
                   (SM0/SM1 don't match the SII); programmed: ";
    let mailboxes = "the mailboxes (0x0800) [00, 10, 80, 00, 26, 00, 01, 00, 80, 10, 80, 00, 22, 00, 01, 00]";
    assert!(text.starts_with(refused) && text.contains(mailboxes), "{text}");
}

#[test]
fn a_state_that_is_never_reached_is_named_after_its_time() {
    let (result, at) = start_up(Habit::Ignores);
    let SetUpError::StartUp(failed) = result.unwrap_err() else { panic!("another error") };
    let StartUpFailure::State { error, .. } = failed.cause else { panic!("another error") };
    assert!(matches!(error.cause, StateFailure::Timeout(_)), "{error}");
    let seconds = at.0 as f64 * 1e-9;
    assert!((3.0..3.5).contains(&seconds), "after {seconds} s");
}

#[test]
fn an_echoed_acknowledge_bit_is_no_error() {
    start_up(Habit::Echoes).0.unwrap();
}

#[test]
fn an_old_error_is_acknowledged() {
    start_up(Habit::StartsWithError(true)).0.unwrap();
}
