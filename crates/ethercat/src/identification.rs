//! Explicit device identification: the number that a switch on the device shows (ETG.1020, "Explicit Device Identification").
//!
//! Where the SII says so, the SubDevice puts the number into its AL status code when bit 5 of AL control asks for it, or
//! shows it at an address of its memory.

use alloc::vec::Vec;
use core::time::Duration;

use crate::bus::{Bus, Warning};
use crate::error::SetUpError;
use crate::procedure::{Answer, DatagramRequest, Next, Procedure};
use crate::state::{AlStatus, Application};
use crate::subdevice::SubDevice;
use crate::transaction::{Access, Target};
use crate::wire::bytes::u16_at;
use crate::wire::{AlState, Clock, HostTime, Link, register, sii};

/// The longest wait for the number.
const TIMEOUT: Duration = Duration::from_millis(500);
/// Pause between two looks.
const PAUSE: Duration = Duration::from_millis(1);

/// Where a SubDevice says that its identification is.
enum Source {
    AlStatusCode,
    Memory(u16),
}

fn source(subdevice: &SubDevice) -> Option<Source> {
    let general = subdevice.sii.general.as_ref().filter(|_| subdevice.broken.is_none())?;
    if general.flags & sii::FLAG_IDENT_AL_STATUS != 0 && subdevice.application == Application::Controller {
        return Some(Source::AlStatusCode);
    }
    let is_shown = general.flags & sii::FLAG_IDENT_MEMORY != 0 && general.identification_address != 0;
    is_shown.then_some(Source::Memory(general.identification_address))
}

impl<L: Link, C: Clock> Bus<L, C> {
    /// Reads the identification of all that have one; they are in INIT.
    pub(crate) fn read_identifications(&mut self) -> Result<(), SetUpError> {
        let mut asked = Vec::new();
        let mut shown = Vec::new();
        for subdevice in &self.subdevices {
            match source(subdevice) {
                Some(Source::AlStatusCode) => asked.push(Identification::new(subdevice.target())),
                Some(Source::Memory(address)) => {
                    shown.push(Access::read("reading the identification", subdevice.target(), address, 2));
                }
                None => {}
            }
        }
        let told = self.transactor.drive(&mut asked)?;
        for (one, number) in asked.iter().zip(told) {
            let position = one.target.position;
            match number {
                Some(number) => self.identified(position, number),
                None => self.warnings.push(Warning::NoIdentification { position }),
            }
        }
        for access in shown {
            let Some(position) = access.position else { continue };
            match self.transactor.perform_one(access) {
                Ok(read) => self.identified(position, u16_at(&read.data, 0)),
                Err(SetUpError::Access(_)) => self.warnings.push(Warning::NoIdentification { position }),
                Err(other) => return Err(other),
            }
        }
        Ok(())
    }

    fn identified(&mut self, position: u16, number: u16) {
        if let Some(one) = self.subdevices.get_mut(usize::from(position)) {
            one.identification = Some(number);
        }
    }
}

/// What the next datagram is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Ask,
    Look,
    /// Without the request, so that its echo is gone again.
    TakeBack,
}

/// Asks one SubDevice in INIT for its number.
#[derive(Debug)]
struct Identification {
    target: Target,
    stage: Stage,
    deadline: Option<HostTime>,
    wait_until: Option<HostTime>,
    number: Option<u16>,
    over: bool,
}

impl Identification {
    fn new(target: Target) -> Self {
        Identification {
            target,
            stage: Stage::Ask,
            deadline: None,
            wait_until: None,
            number: None,
            over: false,
        }
    }
}

impl Procedure for Identification {
    type Output = Option<u16>;

    fn next(&mut self, now: HostTime) -> Next<Self::Output> {
        let deadline = *self.deadline.get_or_insert(now + TIMEOUT);
        if self.over || now >= deadline + TIMEOUT {
            return Next::Done(self.number);
        }
        if now >= deadline {
            self.stage = Stage::TakeBack;
        }
        if let Some(instant) = self.wait_until.take_if(|instant| now < *instant) {
            self.wait_until = Some(instant);
            return Next::WaitUntil(instant);
        }
        let station = self.target.station;
        Next::Send(match self.stage {
            Stage::Ask | Stage::TakeBack => DatagramRequest::write(station, register::AL_CONTROL, 2),
            Stage::Look => DatagramRequest::read(station, register::AL_STATUS, AlStatus::LENGTH),
        })
    }

    fn fill(&self, data: &mut [u8]) {
        let request = if self.stage == Stage::Ask { AlState::IDENTIFICATION } else { 0 };
        if self.stage != Stage::Look {
            data.copy_from_slice(&(AlState::Init.bits() | request).to_le_bytes());
        }
    }

    fn answer(&mut self, answer: Answer<'_>, now: HostTime) {
        let Ok(data) = answer.data(1) else {
            self.wait_until = Some(now + PAUSE);
            return;
        };
        match self.stage {
            Stage::Ask => self.stage = Stage::Look,
            Stage::TakeBack => self.over = true,
            Stage::Look => match AlStatus::read(data) {
                Some(status) if status.bits & AlState::IDENTIFICATION != 0 => {
                    self.number = Some(status.code.0);
                    self.stage = Stage::TakeBack;
                }
                _ => self.wait_until = Some(now + PAUSE),
            },
        }
    }
}
