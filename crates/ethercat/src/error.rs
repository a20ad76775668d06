//! What can go wrong in set-up: each error names what was expected, what was found, and where.

use alloc::boxed::Box;
use alloc::string::String;
use core::fmt;

use crate::eeprom::{EepromError, EepromWriteError};
use crate::fmmu::FmmuError;
use crate::image::PlanError;
use crate::mailbox::{MailboxError, Operation, UnusableMailbox};
use crate::mapping::MappingError;
use crate::start_up::StartUpError;
use crate::state::StateError;
use crate::topology::TopologyError;
use crate::wire::LinkError;
use crate::wire::sii::ImageTooShort;

pub use crate::found::{AccessError, Found, Unexpected};
pub use crate::mismatch::Mismatch;

/// Why no SubDevice was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoSubDevices {
    /// The interface has no link.
    LinkDown,
    /// Frames came back exactly as they were sent: the cable is looped, or leads to a hub or switch.
    Reflected,
    /// Frames of another MainDevice arrived, none of our own.
    AnotherMainDevice,
    /// Nothing came back.
    NothingBack,
    /// Frames passed a SubDevice but none counted them.
    Unanswered,
}

impl fmt::Display for NoSubDevices {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            NoSubDevices::LinkDown => "the link is down (cable out, or no power at the other end)",
            NoSubDevices::Reflected => {
                "own frames came back unchanged (the cable leads to no SubDevice: a loop, a hub or a switch)"
            }
            NoSubDevices::AnotherMainDevice => {
                "frames of another MainDevice arrived, none of our own came back"
            }
            NoSubDevices::NothingBack => "nothing came back (wrong interface, the segment has no power, a ring whose other end is plugged in, too, or the cable to it damages every frame: change that)",
            NoSubDevices::Unanswered => "frames came back, but their working counter was 0",
        })
    }
}

/// Receive times that can't be true.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DcError {
    /// A frame was longer behind a port than any segment is long.
    BranchTooLong {
        /// The SubDevice.
        position: u16,
        /// Its port.
        port: u8,
        /// Time between leaving and coming back, ns.
        found_ns: u32,
        /// The most that is possible, ns.
        limit_ns: u32,
    },
    /// A frame was shorter behind a port than within the SubDevices there.
    BranchTooShort {
        /// The SubDevice.
        position: u16,
        /// Its port.
        port: u8,
        /// Time between leaving and coming back, ns.
        found_ns: u32,
        /// Time spent in the SubDevices there, ns.
        inside_ns: u32,
    },
}

impl fmt::Display for DcError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            DcError::BranchTooLong { position, port, found_ns, limit_ns } => write!(
                f,
                "SubDevice {position}: distributed clock: the frame came back to port {port} after {found_ns} ns, \
                 at most {limit_ns} ns are possible"
            ),
            DcError::BranchTooShort { position, port, found_ns, inside_ns } => write!(
                f,
                "SubDevice {position}: distributed clock: the frame came back to port {port} after {found_ns} ns, \
                 but was {inside_ns} ns in the SubDevices there"
            ),
        }
    }
}

impl core::error::Error for DcError {}

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

impl From<StartUpError> for SetUpError {
    fn from(error: StartUpError) -> Self {
        SetUpError::StartUp(Box::new(error))
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
    /// Its processor reads no requests.
    #[error(
        "SubDevice {position} takes no request for a state (register 0x0120): its chip answers and its processor doesn't; its firmware hangs or \
         is missing: power it off and on"
    )]
    NoFirmware {
        /// The SubDevice.
        position: u16,
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
    /// An EEPROM could not be written.
    #[error(transparent)]
    EepromWrite(#[from] EepromWriteError),
    /// An EEPROM that was written whole reads otherwise.
    #[error(
        "SubDevice {position}: EEPROM word 0x{word:04x} reads 0x{found:04x} after all was written, 0x{expected:04x} was \
         expected: write it again, or the backup"
    )]
    EepromDiffers {
        /// The SubDevice.
        position: u16,
        /// The first word that differs.
        word: u32,
        /// Written.
        expected: u16,
        /// Read back.
        found: u16,
    },
    /// A SubDevice takes no files in this state.
    #[error("SubDevice {position} takes no files in {state}: {lacks}")]
    NoFiles {
        /// The SubDevice.
        position: u16,
        /// BOOT or PRE-OP.
        state: crate::wire::AlState,
        /// What its SII doesn't have.
        lacks: &'static str,
    },
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
    #[error("SubDevice {position} can't be used: {cause}")]
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
    StartUp(Box<StartUpError>),
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
