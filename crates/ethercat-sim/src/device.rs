//! What a device does behind its communication: the kinds of device.

pub mod axis;
pub mod drive;
pub mod esi;
pub mod generic;
mod image;
pub mod panel;
pub mod parameters;
pub mod servo;
pub mod simple;

use crate::dictionary::Dictionary;
use omnibase_ethercat_wire::coe::{AbortCode, Emergency, ObjectAddress};
use omnibase_ethercat_wire::{AlState, AlStatusCode, HostTime};

/// What distinguishes one piece from another of its kind.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Piece {
    /// Station alias; 0 is none.
    pub alias: u16,
    /// Serial number; 0 is none.
    pub serial: u32,
    /// What its switch for explicit device identification shows, where it has one.
    pub identification: Option<u16>,
    /// Local clock at power-on, ns.
    pub dc_offset_ns: u64,
    /// How much faster than virtual time its quartz runs, parts per million; slower where negative.
    pub dc_drift_ppm: f64,
}

/// Whether the outputs in the dictionary may be acted upon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outputs {
    /// The device isn't in OP: outputs are safe.
    Safe,
    /// In OP, and new ones arrived since the last moment.
    New,
    /// In OP, with those of the last moment.
    Held,
}

/// The instant for which a device computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Moment {
    /// Now.
    pub now: HostTime,
    /// Outputs.
    pub outputs: Outputs,
    /// Time from one set of outputs to the next, ns; `None` where the bus doesn't say.
    pub cycle_ns: Option<u32>,
}

/// The application of a SubDevice: everything that isn't communication.
///
/// Values go through the dictionary. Same calls, same bits: no clock, no randomness of its own.
pub trait Device: Send {
    /// The device got power; the dictionary holds its defaults.
    fn power_on(&mut self, dictionary: &mut Dictionary, now: HostTime);

    /// The device lost power: a motor has no torque any more.
    fn power_off(&mut self) {}

    /// Moves on to `moment`: takes outputs from the dictionary, leaves inputs there. Doesn't allocate.
    fn run(&mut self, dictionary: &mut Dictionary, moment: Moment);

    /// When the device wants to move on between two beats of its process data; `None` where it needn't.
    fn due(&self) -> Option<HostTime> {
        None
    }

    /// Moves on to `now` with what it was told last. Doesn't allocate.
    fn tick(&mut self, _: &mut Dictionary, _now: HostTime) {}

    /// Whether an SDO may write this value, which fits its entry.
    fn check_write(&self, _: &Dictionary, _: ObjectAddress, _: &[u8]) -> Result<(), AbortCode> {
        Ok(())
    }

    /// An SDO wrote this entry.
    fn written(&mut self, _: &mut Dictionary, _: ObjectAddress) {}

    /// The AL state became `state`, on request or (with a code) by itself.
    fn state_changed(&mut self, _: &mut Dictionary, _: AlState, _: AlStatusCode) {}

    /// A fault with this error code comes up; `false` where the device knows no faults.
    fn fault(&mut self, _: &mut Dictionary, _: u16) -> bool {
        false
    }

    /// Its safety input takes the torque from the motor, or no longer; `false` where the device has none.
    fn safe_torque_off(&mut self, _: bool) -> bool {
        false
    }

    /// Its motor's brake holds so many per mille of the rated torque while the motor has no current; `false` where nothing can.
    fn brake(&mut self, _per_mille: u16) -> bool {
        false
    }

    /// Somebody turns its motor's shaft by so many per mille of the rated torque; `false` where nobody can.
    fn push(&mut self, _per_mille: i16) -> bool {
        false
    }

    /// The oldest emergency that the device wants to send.
    fn take_emergency(&mut self) -> Option<Emergency> {
        None
    }
}
