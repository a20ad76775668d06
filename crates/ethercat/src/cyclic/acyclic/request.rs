//! What can be asked beside the cycle, and how it ends.

use alloc::vec::Vec;
use core::time::Duration;

use crate::found::Found;
use crate::mailbox::{MailboxError, MailboxRequest};
use crate::wire::spoken;

/// What a request wants.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum AcyclicWork {
    /// An SDO or SDO Information request.
    Mailbox(MailboxRequest),
    /// Access to registers.
    Registers {
        /// Which way.
        way: RegisterAccess,
        /// First register.
        register: u16,
        /// As many bytes as shall be accessed: what to write, or to be overwritten with what was read.
        data: Vec<u8>,
    },
}

/// Which way register data go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RegisterAccess {
    /// From the SubDevice.
    Read,
    /// To the SubDevice.
    Write,
    /// From every SubDevice, in one datagram: the bits of all of them ORed.
    ReadAll,
    /// To every SubDevice, in one datagram.
    WriteAll,
}

/// A request to one SubDevice, or by way of its share of the spare datagrams to all.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AcyclicRequest {
    /// The asker's number; comes back with the completion.
    pub tag: u64,
    /// Position of the SubDevice.
    pub position: u16,
    /// What to do.
    pub work: AcyclicWork,
}

/// A request that has ended; gives its buffer back.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AcyclicCompletion {
    /// The asker's number.
    pub tag: u64,
    /// Position of the SubDevice.
    pub position: u16,
    /// The work; on success its data are the result.
    pub work: AcyclicWork,
    /// How it ended.
    pub result: Result<(), AcyclicError>,
}

/// Why a request failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AcyclicError {
    /// No SubDevice stands there.
    #[error("there is no SubDevice {position}")]
    NoSubDevice {
        /// Position.
        position: u16,
    },
    /// The SubDevice speaks no CoE.
    #[error("SubDevice {position} has no CoE mailbox")]
    NoMailbox {
        /// Position.
        position: u16,
    },
    /// The mailbox request failed.
    #[error(transparent)]
    Mailbox(#[from] MailboxError),
    /// Nobody took the register access, or no frame came back with it.
    #[error("register 0x{register:04x} was not accessed within {}: {}", spoken(*.after), .found.against(1))]
    Register {
        /// First register.
        register: u16,
        /// The last that came back.
        found: Found,
        /// How long it was tried.
        after: Duration,
    },
    /// More bytes than the spare datagram carries.
    #[error("{found} bytes don't fit into the spare datagram of {limit}")]
    TooLong {
        /// Bytes asked.
        found: usize,
        /// The most that fit.
        limit: usize,
    },
}
