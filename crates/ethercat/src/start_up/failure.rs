//! How a start-up list can fail.

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt;

use crate::found::Found;
use crate::mailbox::{MailboxError, Operation};
use crate::state::StateError;
use crate::wire::coe::ObjectAddress;

/// Which step of a start-up list failed, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StartUpError {
    /// The SubDevice.
    pub position: u16,
    /// Why.
    pub cause: StartUpFailure,
}

/// A slot with another module than is expected there; ident 0 is none at all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SlotMismatch {
    /// The slot, from 1.
    pub slot: usize,
    /// Ident of the module that is expected (0xF030).
    pub expected: u32,
    /// Ident of the module that is there (0xF050).
    pub detected: u32,
}

impl fmt::Display for SlotMismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let SlotMismatch { slot, expected, detected } = self;
        match (expected, detected) {
            (_, 0) => write!(
                f,
                "slot {slot} is empty, module 0x{expected:08x} is expected there: plug it in, or take it out of the list (0xF030)"
            ),
            (0, _) => write!(
                f,
                "slot {slot} holds module 0x{detected:08x}, none is expected there: take it out, or put it into the list (0xF030)"
            ),
            _ => write!(
                f,
                "slot {slot} holds module 0x{detected:08x}, 0x{expected:08x} is expected there: plug that in, or put the one that \
                 is there into the list (0xF030)"
            ),
        }
    }
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
        /// The registers that were programmed before, for these are the usual cause. Empty on a way back to OP: it
        /// programs what did well before.
        programmed: Vec<ProgrammedRegisters>,
    },
    /// An SDO step for a SubDevice without a mailbox that speaks CoE.
    NoMailbox {
        /// The object.
        object: ObjectAddress,
        /// Where it was asked.
        origin: Option<Arc<str>>,
    },
    /// An SDO was refused or not answered.
    Sdo {
        /// What was tried.
        operation: Operation,
        /// Why it failed.
        error: MailboxError,
        /// What is in the slot, where the list of modules (0xF030) was refused for it.
        slot: Option<SlotMismatch>,
        /// Where it was asked.
        origin: Option<Arc<str>>,
    },
    /// What was read back isn't what was written.
    ReadBack {
        /// The object.
        object: ObjectAddress,
        /// Written.
        written: ObjectBytes,
        /// Read back.
        read: ObjectBytes,
        /// The SubDevice's answer to the writing, where it refused.
        refusal: Option<MailboxError>,
        /// Where it was asked.
        origin: Option<Arc<str>>,
    },
    /// A step that only the cycle can do (arming SYNC) was given to the set-up.
    NeedsCycle,
}

/// The first bytes of an object's value, and how many it has: errors of a running cycle ask for no memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ObjectBytes {
    length: usize,
    first: [u8; ObjectBytes::SHOWN],
}

impl ObjectBytes {
    /// The most bytes that are kept.
    pub const SHOWN: usize = 16;

    /// What is kept of `bytes`.
    pub fn new(bytes: &[u8]) -> Self {
        let mut first = [0; ObjectBytes::SHOWN];
        let shown = bytes.len().min(ObjectBytes::SHOWN);
        first[..shown].copy_from_slice(&bytes[..shown]);
        ObjectBytes { length: bytes.len(), first }
    }

    /// The first bytes, as many as are kept.
    pub fn first(&self) -> &[u8] {
        &self.first[..self.length.min(ObjectBytes::SHOWN)]
    }
}

/// A little-endian number where it is one, else bytes.
impl fmt::Display for ObjectBytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.length {
            1 | 2 | 4 | 8 => {
                f.write_str("0x")?;
                self.first().iter().rev().try_for_each(|byte| write!(f, "{byte:02x}"))
            }
            length => write!(f, "{length} bytes {:02x?}", self.first()),
        }
    }
}

/// Bytes of registers, no more of them than a person reads.
struct RegisterBytes<'a>(&'a [u8]);

impl fmt::Display for RegisterBytes<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let RegisterBytes(bytes) = self;
        match (bytes.len(), bytes.get(..ObjectBytes::SHOWN)) {
            (length, Some(_)) if bytes.iter().all(|byte| *byte == 0) => write!(f, "{length} bytes, all zero"),
            (length, Some(first)) if length > first.len() => {
                write!(f, "{length} bytes, the first {first:02x?}")
            }
            _ => write!(f, "{bytes:02x?}"),
        }
    }
}

impl fmt::Display for StartUpError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let StartUpFailure::State { error, programmed } = &self.cause {
            write!(f, "{error}{}", if programmed.is_empty() { "" } else { "; programmed:" })?;
            return programmed.iter().try_for_each(|ProgrammedRegisters { what, register, data }| {
                write!(f, " {what} (0x{register:04x}) {}", RegisterBytes(data))
            });
        }
        write!(f, "SubDevice {}: ", self.position)?;
        let origin = match &self.cause {
            StartUpFailure::Registers { what, register, found } => {
                write!(f, "{what} (register 0x{register:04x}): {}", found.against(1))?;
                &None
            }
            StartUpFailure::NoMailbox { object, origin } => {
                write!(f, "SDO {object} was asked, but the SubDevice has no CoE mailbox")?;
                origin
            }
            StartUpFailure::Sdo { operation, error, slot, origin } => {
                write!(f, "{operation}: {error}")?;
                if let Some(slot) = slot {
                    write!(f, "; {slot}")?;
                }
                origin
            }
            StartUpFailure::ReadBack { object, written, read, refusal, origin } => {
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
