//! Everything that takes one SubDevice from INIT to OP, as data.
//!
//! The first bring-up and a later recovery of one SubDevice run the same list.

mod failure;
mod runner;

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::time::Duration;

pub use failure::{ObjectBytes, ProgrammedRegisters, SlotMismatch, StartUpError, StartUpFailure};
pub use runner::StartUpRunner;

pub use crate::mailbox::SdoAccess;

use crate::wire::AlState;
use crate::wire::coe::ObjectAddress;

/// Whether a SubDevice may refuse a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// It is an error.
    IsError,
    /// It is taken as an answer: some devices bar this register.
    IsTolerated,
}

/// Whether what was written is read back and compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadBack {
    /// Read and compared; a difference is an error.
    Compare,
    /// Not read (write-only objects, commands).
    Skip,
}

/// One SDO to be written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SdoWrite {
    /// The object.
    pub object: ObjectAddress,
    /// Its value, little endian.
    pub data: Vec<u8>,
    /// The whole object from this subindex in one transfer.
    pub access: SdoAccess,
    /// Whether the SubDevice may abort it: with [`ReadBack::Compare`] this says that the object must have the
    /// value, whoever gave it.
    pub refusal: Refusal,
    /// Whether to compare afterwards.
    pub read_back: ReadBack,
    /// Where it was asked, in the user's words ("robot.toml line 12"); shared with errors.
    pub origin: Option<Arc<str>>,
}

/// One step of a SubDevice's start-up.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StartUpStep {
    /// Write registers and check the working counter.
    Registers {
        /// First register.
        register: u16,
        /// Bytes.
        data: Vec<u8>,
        /// What it programs, for messages.
        what: &'static str,
        /// Whether it may be refused.
        refusal: Refusal,
    },
    /// Measure and write the offset (0x0920) that makes the local clock show the segment's time. The first
    /// bring-up does this for all clocks at once, from one latched frame.
    ClockOffset {
        /// Propagation delay from the reference clock, ns.
        delay_ns: u32,
    },
    /// Write one SDO.
    Sdo(SdoWrite),
    /// Arm SYNC0 (and SYNC1) as the configuration says; the clock must be locked and process data must flow.
    ArmSync,
    /// Ask for a state and wait for it.
    State {
        /// The state.
        state: AlState,
        /// The longest wait.
        timeout: Duration,
    },
}

/// The steps in their order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StartUpList {
    /// The steps.
    pub steps: Vec<StartUpStep>,
}

impl StartUpStep {
    /// Whether process data must flow before it: arming SYNC, SAFE-OP and OP.
    pub fn needs_cycle(&self) -> bool {
        match self {
            StartUpStep::ArmSync => true,
            StartUpStep::State { state, .. } => matches!(state, AlState::SafeOp | AlState::Op),
            _ => false,
        }
    }
}
