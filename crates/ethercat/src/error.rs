//! What can go wrong in set-up: each error names what was expected, what was found, and where.

use alloc::string::String;
use core::fmt;

use crate::clock_setup::DcError;
use crate::configure::Mismatch;
use crate::eeprom::EepromError;
use crate::fmmu::FmmuError;
use crate::image::PlanError;
use crate::mailbox::{MailboxError, Operation, UnusableMailbox};
use crate::mapping::MappingError;
use crate::scan::NoSubDevices;
use crate::start_up::StartUpError;
use crate::state::StateError;
use crate::topology::TopologyError;
use crate::wire::sii::ImageTooShort;
use crate::wire::{Address, Command, LinkError};

/// What came back of an access.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Found {
    /// No frame.
    Nothing,
    /// A frame with this working counter.
    WorkingCounter(u16),
}

impl fmt::Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Found::Nothing => f.write_str("the frame did not come back"),
            Found::WorkingCounter(found) => write!(f, "working counter {found}"),
        }
    }
}

impl Found {
    /// What came back against the working counter that was expected: a lost frame says nothing about a SubDevice.
    pub fn against(self, expected: u16) -> Unexpected {
        Unexpected { found: self, expected }
    }
}

/// What came back in place of what was expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unexpected {
    found: Found,
    expected: u16,
}

impl fmt::Display for Unexpected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.found {
            Found::Nothing => write!(f, "{}: it was lost on its way, nobody refused it", self.found),
            found => write!(f, "{found} where working counter {} was expected", self.expected),
        }
    }
}

/// An access to registers that failed after all its attempts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AccessError {
    /// What was accessed.
    pub what: &'static str,
    /// The SubDevice; `None` for all.
    pub position: Option<u16>,
    /// The command.
    pub command: Command,
    /// Whom and where.
    pub address: Address,
    /// Working counter expected.
    pub expected: u16,
    /// What came back.
    pub found: Found,
    /// Attempts made.
    pub attempts: u32,
}

impl fmt::Display for AccessError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.position {
            Some(position) => write!(f, "SubDevice {position}: ")?,
            None => f.write_str("all SubDevices: ")?,
        }
        let AccessError { what, command, address, expected, found, attempts, .. } = self;
        write!(f, "{what}: {} ({command}, {address}, {attempts} attempts)", found.against(*expected))
    }
}

impl core::error::Error for AccessError {}

impl SetUpError {
    /// The one SubDevice that it is about, where the others can be set up without it.
    pub(crate) fn culprit(&self) -> Option<u16> {
        match self {
            SetUpError::Mailbox { position, .. } => Some(*position),
            SetUpError::StartUp(error) => Some(error.position),
            SetUpError::State(error) => Some(error.position),
            SetUpError::Mapping(error) => Some(error.position),
            SetUpError::Fmmu(error) => Some(error.position),
            _ => None,
        }
    }
}

/// Why a segment could not be set up.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SetUpError {
    /// The link is gone.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// An access failed.
    #[error(transparent)]
    Access(#[from] AccessError),
    /// Nobody is there.
    #[error("no SubDevice found: {0}")]
    NoSubDevices(NoSubDevices),
    /// More than this MainDevice handles.
    #[error("{found} SubDevices found, at most {limit} are handled")]
    TooManySubDevices {
        /// The most.
        limit: u16,
        /// Found.
        found: u16,
    },
    /// The number of SubDevices changes from one frame to the next.
    #[error(
        "the number of SubDevices is not the same twice in {attempts} counts, the last was {last}: is a link unsteady?"
    )]
    UnstableCount {
        /// The last count.
        last: u16,
        /// Counts made.
        attempts: u32,
    },
    /// A station address did not stay.
    #[error("SubDevice {position}: station address 0x{expected:04x} was written, 0x{found:04x} read back")]
    StationAddress {
        /// The SubDevice.
        position: u16,
        /// Written.
        expected: u16,
        /// Read back.
        found: u16,
    },
    /// There is no such SubDevice.
    #[error("there is no SubDevice {position}: the segment has {count}")]
    NoSuchPosition {
        /// Asked for.
        position: u16,
        /// SubDevices in the segment.
        count: usize,
    },
    /// The ports don't make a tree.
    #[error(transparent)]
    Topology(#[from] TopologyError),
    /// An EEPROM could not be read.
    #[error(transparent)]
    Eeprom(#[from] EepromError),
    /// An EEPROM's content makes no sense at all.
    #[error("SubDevice {position}: {cause}")]
    Sii {
        /// The SubDevice.
        position: u16,
        /// Why.
        cause: ImageTooShort,
    },
    /// A state was not reached.
    #[error(transparent)]
    State(#[from] StateError),
    /// The process data don't fit into a cycle.
    #[error(transparent)]
    Image(#[from] PlanError),
    /// What is there isn't what is configured.
    #[error(transparent)]
    Mismatch(#[from] Mismatch),
    /// A mailbox can't be used.
    #[error("SubDevice {position}: {cause}")]
    Mailbox {
        /// The SubDevice.
        position: u16,
        /// Why.
        cause: UnusableMailbox,
    },
    /// A SubDevice is broken; the others do without it.
    #[error("SubDevice {position} is broken: {cause}")]
    Broken {
        /// The SubDevice.
        position: u16,
        /// Why.
        cause: String,
    },
    /// A SubDevice has no mailbox that speaks CoE, or isn't in a state in which it works.
    #[error("SubDevice {position}: {operation} was asked, but it has no CoE mailbox in its present state")]
    NoCoe {
        /// The SubDevice.
        position: u16,
        /// What was asked.
        operation: Operation,
    },
    /// A mailbox request failed.
    #[error("SubDevice {position}: {operation}: {cause}")]
    Request {
        /// The SubDevice.
        position: u16,
        /// What was asked.
        operation: Operation,
        /// Why it failed.
        cause: MailboxError,
    },
    /// A step of a SubDevice's start-up failed.
    #[error(transparent)]
    StartUp(#[from] StartUpError),
    /// A PDO map can't be used.
    #[error(transparent)]
    Mapping(#[from] MappingError),
    /// FMMUs don't suffice.
    #[error(transparent)]
    Fmmu(#[from] FmmuError),
    /// The distributed clocks say what can't be.
    #[error(transparent)]
    Dc(#[from] DcError),
}
