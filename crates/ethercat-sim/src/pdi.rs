//! The line between the simulated ESC (hardware) and the application that runs behind it (firmware).
//!
//! Everything that a SubDevice's firmware does passes through a [`Pdi`], as on the real chip: the built-in
//! applications ([`Application`]) as well as a foreign one in another process.

use omnibase_ethercat_wire::HostTime;
use std::path::Path;

/// The AL event request word (register 0x0220), which the ESC returns with every PDI access.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AlEvent(pub u32);

/// The process-data interface: the firmware's view of the ESC's 64 KiB of registers and memory.
///
/// Reads and writes have the chip's side effects: reading AL control clears its event, reading the last byte of
/// a written mailbox empties it, writing the last byte of a read mailbox fills it, buffers swap, and so on.
/// Addresses that are not writable from this side are left alone.
pub trait Pdi {
    /// Reads `data.len()` bytes from `address`; returns the AL event word.
    fn read(&mut self, address: u16, data: &mut [u8]) -> AlEvent;
    /// Writes `data` to `address`; returns the AL event word.
    fn write(&mut self, address: u16, data: &[u8]) -> AlEvent;
}

/// Firmware that runs in the simulation.
///
/// The segment calls [`Application::run`] when the AL event word became non-zero, when SYNC0 or SYNC1 fired, and
/// at the instant that the last call asked for. Same calls, same bits: no clock, no randomness of its own.
pub trait Application: Send {
    /// The device got power: forget everything.
    fn power_on(&mut self, pdi: &mut dyn Pdi, now: HostTime);

    /// The device lost power: what it drives gets none any more.
    fn power_off(&mut self) {}

    /// Does what is due at `now`; returns when it wants to run again even if nothing happens (`None`: never).
    fn run(&mut self, pdi: &mut dyn Pdi, event: AlEvent, now: HostTime) -> Option<HostTime>;

    /// Whether it was there since it was last asked, as the accesses of a processor's loop tell its chip (PDI watchdog). What
    /// runs in this process is, for as long as it is called.
    fn was_there(&mut self) -> bool {
        true
    }

    /// The socket at which it is waited for, where it is a program that isn't connected.
    fn awaited_at(&self) -> Option<&Path> {
        None
    }

    /// A fault that only firmware can have; unknown ones are ignored and `false` comes back.
    fn inject(&mut self, fault: &ApplicationFault, now: HostTime) -> bool;
}

/// Faults of the application behind the ESC.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ApplicationFault {
    /// Report this AL status code and fall back to SAFE-OP (or below).
    AlError(u16),
    /// A drive fault with this error code (object 0x603F) and an emergency.
    DriveFault(u16),
    /// Mailbox requests stay unanswered while `true`.
    MailboxSilence(bool),
    /// The firmware does nothing at all while `true`.
    Frozen(bool),
    /// The safety input takes the torque from the motor (IEC 61800-5-2, STO) while `true`; nobody is told but by the
    /// status word.
    SafeTorqueOff(bool),
    /// A brake at the motor's shaft holds so many per mille of the rated torque while the motor has no current: little of it
    /// for a worn one; 0, as at the beginning, is none.
    Brake(u16),
    /// Somebody turns the motor's shaft by so many per mille of the rated torque, until the next push; 0 lets go.
    Push(i16),
}
