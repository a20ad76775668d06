//! One request as a sequence of messages, whatever kind it is.

use super::file::File;
use super::info::Info;
use super::outcome::Outcome;
use super::request::{MailboxRequest, Operation};
use super::sdo::{self, Sdo};
use crate::wire::coe::AbortCode;
use crate::wire::mailbox::Protocol;

/// The state of the request in hand.
#[derive(Clone, Copy, Debug)]
pub(super) enum Transfer {
    Upload(Sdo),
    Download(Sdo),
    Info(Info),
    File(File),
}

impl Transfer {
    /// `longest_answer` is the most service data that the SubDevice's mailbox holds, bytes.
    pub(super) fn new(operation: Operation, longest_answer: usize) -> Self {
        match operation {
            Operation::ReadFile | Operation::WriteFile => Transfer::File(File::new(longest_answer)),
            Operation::Upload { object, access } => Transfer::Upload(Sdo::new(object, access)),
            Operation::Download { object, access } => Transfer::Download(Sdo::new(object, access)),
            operation => Transfer::Info(Info::new(operation)),
        }
    }

    /// The protocol that it speaks.
    pub(super) fn protocol(&self) -> Protocol {
        match self {
            Transfer::File(_) => Protocol::Foe,
            Transfer::Upload(_) | Transfer::Download(_) | Transfer::Info(_) => Protocol::Coe,
        }
    }

    /// Whether it is over once its message is written: nothing answers that.
    pub(super) fn ends_with_message(&self) -> bool {
        matches!(self, Transfer::File(file) if file.ends_with_message())
    }

    /// Writes the message that gives it up; its length, or `None` where there is no such message.
    pub(super) fn write_abort(&self, message: &mut [u8], code: AbortCode) -> Option<usize> {
        match self {
            Transfer::Upload(sdo) | Transfer::Download(sdo) => {
                Some(sdo::write_abort(message, sdo.object(), code))
            }
            Transfer::File(file) => Some(file.write_abort(message)),
            Transfer::Info(_) => None,
        }
    }

    /// Writes the next message behind the mailbox header; returns its length.
    pub(super) fn write(&mut self, message: &mut [u8], request: &MailboxRequest) -> usize {
        match self {
            Transfer::Upload(sdo) => sdo.write_upload(message),
            Transfer::Download(sdo) => sdo.write_download(message, &request.data),
            Transfer::Info(info) => info.write(message),
            Transfer::File(file) if request.operation.is_write() => file.write_download(message, request),
            Transfer::File(file) => file.write_upload(message, &request.file),
        }
    }

    /// Takes a message of its protocol.
    pub(super) fn read(&mut self, message: &[u8], request: &mut MailboxRequest) -> Outcome {
        match self {
            Transfer::Upload(sdo) => sdo.read_upload(message, &mut request.data),
            Transfer::Download(sdo) => sdo.read_download(message, request.data.len()),
            Transfer::Info(info) => info.read(message, &mut request.data),
            Transfer::File(file) if request.operation.is_write() => {
                file.read_download(message, request.data.len())
            }
            Transfer::File(file) => file.read_upload(message, &mut request.data),
        }
    }
}
