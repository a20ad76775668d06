//! What can be asked of a SubDevice's mailbox, and how it can end.

use super::short_text::ShortText;
use crate::wire::coe::{AbortCode, ObjectAddress, info};
use crate::wire::foe::FoeErrorCode;
use crate::wire::mailbox::error_text;
use crate::wire::spoken;
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

/// How long one message waits for its answer where nothing else is said.
pub const DEFAULT_TIMEOUT: Duration = Duration::from_secs(2);

/// One entry, or the whole object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoAccess {
    /// One subindex.
    Entry,
    /// Complete access.
    Complete,
}

/// Which of the SubDevice's object lists is meant (ETG.1000.6, "SDO Information").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum ObjectList {
    /// Every object.
    All = 1,
    /// Objects that can be mapped into an RxPDO.
    RxMappable = 2,
    /// Objects that can be mapped into a TxPDO.
    TxMappable = 3,
    /// Objects to keep for replacing a device.
    Backup = 4,
    /// Objects that are used as parameters at start.
    Settings = 5,
}

/// What a [`MailboxRequest`] asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operation {
    /// Read an object.
    Upload {
        /// The object.
        object: ObjectAddress,
        /// One entry or all.
        access: SdoAccess,
    },
    /// Write the request's data to an object.
    Download {
        /// The object.
        object: ObjectAddress,
        /// One entry or all.
        access: SdoAccess,
    },
    /// The lengths of the five object lists: five `u16`.
    ListLengths,
    /// The indices of one object list: `u16` each.
    List(ObjectList),
    /// An object's description, see [`super::ObjectDescription`].
    DescribeObject {
        /// Its index.
        index: u16,
    },
    /// An entry's description, see [`super::EntryDescription`].
    DescribeEntry {
        /// The entry.
        object: ObjectAddress,
        /// Which values to describe too, bits of [`super::EntryDescription`]; 0 for none.
        value_info: u8,
    },
    /// Read the request's file (FoE).
    ReadFile,
    /// Write the request's data to its file (FoE).
    WriteFile,
}

impl Operation {
    /// Whether the request's data go to the SubDevice.
    pub(super) fn is_write(self) -> bool {
        matches!(self, Operation::Download { .. } | Operation::WriteFile)
    }

    pub(super) fn list_type(self) -> u16 {
        match self {
            Operation::List(list) => list as u16,
            _ => info::LIST_LENGTHS,
        }
    }
}

impl fmt::Display for Operation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Operation::Upload { object, access: SdoAccess::Entry } => write!(f, "SDO read of {object}"),
            Operation::Upload { object, access: SdoAccess::Complete } => {
                write!(f, "SDO read of {object} with complete access")
            }
            Operation::Download { object, access: SdoAccess::Entry } => write!(f, "SDO write to {object}"),
            Operation::Download { object, access: SdoAccess::Complete } => {
                write!(f, "SDO write to {object} with complete access")
            }
            Operation::ListLengths => f.write_str("reading the lengths of the object lists"),
            Operation::List(list) => write!(f, "reading object list {}", *list as u16),
            Operation::DescribeObject { index } => write!(f, "reading the description of object {index:04x}"),
            Operation::DescribeEntry { object, .. } => write!(f, "reading the description of entry {object}"),
            Operation::ReadFile => f.write_str("reading a file"),
            Operation::WriteFile => f.write_str("writing a file"),
        }
    }
}

/// Which file, and by what right.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FileAccess {
    /// The file's name as the SubDevice knows it.
    pub name: String,
    /// Its password; 0 where it has none.
    pub password: u32,
}

/// A request, with the buffer that carries its data in or its result out.
///
/// Nothing is allocated while it runs: an answer longer than the buffer's capacity is refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MailboxRequest {
    /// What is asked.
    pub operation: Operation,
    /// The file that it is about; empty where it is about none.
    pub file: FileAccess,
    /// A download's data, or (after success) the result of everything else.
    pub data: Vec<u8>,
    /// How long each message waits for its answer; a transfer of many segments may take longer in all. `None`: as the
    /// mailbox is used to.
    pub timeout: Option<Duration>,
}

impl MailboxRequest {
    /// Reads one entry into `buffer`, whose capacity is the most that is accepted.
    pub fn upload(object: ObjectAddress, buffer: Vec<u8>) -> Self {
        MailboxRequest::new(Operation::Upload { object, access: SdoAccess::Entry }, buffer)
    }

    /// Writes `data` to one entry.
    pub fn download(object: ObjectAddress, data: Vec<u8>) -> Self {
        MailboxRequest::new(Operation::Download { object, access: SdoAccess::Entry }, data)
    }

    /// Any operation with its buffer.
    pub fn new(operation: Operation, buffer: Vec<u8>) -> Self {
        MailboxRequest { operation, file: FileAccess::default(), data: buffer, timeout: None }
    }

    /// Reads a file into `buffer`, whose capacity is the most that is accepted.
    pub fn read_file(file: FileAccess, buffer: Vec<u8>) -> Self {
        MailboxRequest { file, ..MailboxRequest::new(Operation::ReadFile, buffer) }
    }

    /// Writes `data` to a file.
    pub fn write_file(file: FileAccess, data: Vec<u8>) -> Self {
        MailboxRequest { file, ..MailboxRequest::new(Operation::WriteFile, data) }
    }

    /// The same request with another timeout for each message.
    pub fn with_timeout(self, timeout: Duration) -> Self {
        MailboxRequest { timeout: Some(timeout), ..self }
    }
}

/// A request that has ended; gives its buffer back.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Completion {
    /// The request; on success its `data` is the result.
    pub request: MailboxRequest,
    /// How it ended.
    pub result: Result<(), MailboxError>,
}

/// What a request was waiting for when its time ran out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Waiting {
    /// For the SubDevice to take the previous message out of its mailbox.
    MailboxEmpty,
    /// For the answer.
    Answer,
    /// For a reply that got lost to be given again.
    Repeat,
}

impl fmt::Display for Waiting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Waiting::MailboxEmpty => "the SubDevice to empty its receive mailbox",
            Waiting::Answer => "the answer",
            Waiting::Repeat => "a lost answer to be repeated",
        })
    }
}

/// Why a mailbox request failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MailboxError {
    /// The SubDevice doesn't answer at its station address at all.
    #[error("the SubDevice did not answer at its station address for {}", spoken(*.after))]
    Unreachable {
        /// How long it was tried.
        after: Duration,
    },
    /// Frames don't come back: nobody knows what the SubDevice would say.
    #[error("no frame came back for {}: frames are lost on their way", spoken(*.after))]
    Unheard {
        /// How long it was tried.
        after: Duration,
    },
    /// The SubDevice is there, its mailbox is silent.
    #[error("timeout after {} waiting for {waiting}", spoken(*.after))]
    Timeout {
        /// For what.
        waiting: Waiting,
        /// How long.
        after: Duration,
    },
    /// The SubDevice aborted the transfer.
    #[error("{object} aborted: {code}")]
    Aborted {
        /// The object.
        object: ObjectAddress,
        /// Its reason.
        code: AbortCode,
    },
    /// The SubDevice refused an SDO Information request.
    #[error("SDO Information refused: {code}")]
    InfoRefused {
        /// Its reason.
        code: AbortCode,
    },
    /// The SubDevice sent a mailbox error reply.
    #[error("mailbox error 0x{detail:04x}: {}", error_text(*.detail))]
    Refused {
        /// Detail code.
        detail: u16,
    },
    /// A segment came with the wrong toggle bit.
    #[error("{object}: segment behind byte {offset} came with the wrong toggle bit")]
    Toggle {
        /// The object.
        object: ObjectAddress,
        /// Bytes transferred before it.
        offset: usize,
    },
    /// The bytes don't add up to the announced size.
    #[error("{object}: {announced} bytes were announced, {received} came")]
    SizeMismatch {
        /// The object.
        object: ObjectAddress,
        /// Announced size.
        announced: usize,
        /// Bytes that came.
        received: usize,
    },
    /// The answer doesn't fit into the request's buffer.
    #[error("the answer has at least {needed} bytes, the buffer holds {limit}")]
    TooLong {
        /// Bytes needed, as far as known.
        needed: usize,
        /// The buffer's capacity.
        limit: usize,
    },
    /// The data to write is longer than an SDO can announce.
    #[error("{found} bytes are more than an SDO can carry")]
    DataTooLong {
        /// Bytes to write.
        found: usize,
    },
    /// The file's name doesn't fit into one message, and FoE knows no second one for it.
    #[error(
        "the file's name has {found} bytes, this SubDevice's mailbox has room for {room}: give it a shorter one"
    )]
    NameTooLong {
        /// Bytes of the name.
        found: usize,
        /// Bytes that fit.
        room: usize,
    },
    /// A fragment of an SDO Information answer is missing.
    #[error("fragments left: expected {expected}, found {found}")]
    FragmentLost {
        /// Fragments that should have been left.
        expected: u16,
        /// Fragments that the message says are left.
        found: u16,
    },
    /// An answer belongs to the request but makes no sense.
    #[error("malformed answer: {what}")]
    Malformed {
        /// What is wrong with it.
        what: &'static str,
    },
    /// The SubDevice refused a file, or broke its transfer off.
    #[error("FoE error {code}{}, at packet {packet}", Quoted(.text))]
    FileRefused {
        /// Its reason.
        code: FoeErrorCode,
        /// The packet that was in hand; 0 before the first.
        packet: u32,
        /// The beginning of its own words.
        text: ShortText,
    },
    /// A packet of a file came that wasn't awaited.
    #[error("packet {found} of the file came, packet {expected} was awaited")]
    PacketNumber {
        /// Awaited.
        expected: u32,
        /// Came.
        found: u32,
    },
    /// The SubDevice kept saying that it needs more time.
    #[error("the SubDevice answered {times} times in a row that it is busy, at packet {packet}")]
    Busy {
        /// How often.
        times: u32,
        /// The packet that was in hand.
        packet: u32,
    },
    /// The mailbox was reset while the request ran: the SubDevice lost power or went to INIT.
    #[error("the mailbox was reset")]
    Reset,
}

impl MailboxError {
    /// Whether the SubDevice itself answered no, or what can't be taken; any other error says nothing of what was asked.
    pub fn is_refusal(&self) -> bool {
        matches!(
            self,
            MailboxError::Aborted { .. }
                | MailboxError::InfoRefused { .. }
                | MailboxError::Refused { .. }
                | MailboxError::TooLong { .. }
                | MailboxError::Malformed { .. }
                | MailboxError::SizeMismatch { .. }
        )
    }
}

/// A device's own words, where it has any.
struct Quoted<'a>(&'a ShortText);

impl fmt::Display for Quoted<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.bytes().is_empty() { Ok(()) } else { write!(f, " (\"{}\")", self.0) }
    }
}
