//! One request as a sequence of messages, whatever kind it is.

use super::info::Info;
use super::request::{MailboxError, MailboxRequest, Operation};
use super::sdo::Sdo;
use crate::wire::coe::{AbortCode, ObjectAddress};

/// What follows from a message that came in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// It isn't ours: drop and count it, keep waiting.
    Stray,
    /// It was an emergency; it is kept and nothing changes.
    Kept,
    /// Send the next message.
    Send,
    /// Ours, but more comes without asking.
    More,
    /// The request succeeded.
    Done,
    /// The request failed; where a code is given, the SubDevice still has to be told.
    Failed(MailboxError, Option<AbortCode>),
}

pub(super) fn failed(error: MailboxError) -> Outcome {
    Outcome::Failed(error, None)
}

pub(super) fn failed_with(error: MailboxError, code: AbortCode) -> Outcome {
    Outcome::Failed(error, Some(code))
}

/// The state of the request in hand.
#[derive(Clone, Copy, Debug)]
pub(super) enum Transfer {
    Upload(Sdo),
    Download(Sdo),
    Info(Info),
}

impl Transfer {
    pub(super) fn new(operation: Operation) -> Self {
        match operation {
            Operation::Upload { object, access } => Transfer::Upload(Sdo::new(object, access)),
            Operation::Download { object, access } => Transfer::Download(Sdo::new(object, access)),
            operation => Transfer::Info(Info::new(operation)),
        }
    }

    /// The object to name in an abort; SDO Information has none.
    pub(super) fn object(&self) -> Option<ObjectAddress> {
        match self {
            Transfer::Upload(sdo) | Transfer::Download(sdo) => Some(sdo.object()),
            Transfer::Info(_) => None,
        }
    }

    /// Writes the next message behind the mailbox header; returns its length.
    pub(super) fn write(&mut self, message: &mut [u8], request: &MailboxRequest) -> usize {
        match self {
            Transfer::Upload(sdo) => sdo.write_upload(message),
            Transfer::Download(sdo) => sdo.write_download(message, &request.data),
            Transfer::Info(info) => info.write(message),
        }
    }

    /// Takes a CoE message.
    pub(super) fn read(&mut self, message: &[u8], request: &mut MailboxRequest) -> Outcome {
        match self {
            Transfer::Upload(sdo) => sdo.read_upload(message, &mut request.data),
            Transfer::Download(sdo) => sdo.read_download(message, request.data.len()),
            Transfer::Info(info) => info.read(message, &mut request.data),
        }
    }
}
