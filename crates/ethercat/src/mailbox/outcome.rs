//! What follows from a message of a SubDevice.

use super::request::MailboxError;
use crate::wire::coe::AbortCode;

/// What follows from a message that came in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// It isn't ours: drop and count it, keep waiting.
    Stray,
    /// It was an emergency; it is kept and nothing changes.
    Kept,
    /// Send the next message.
    Send,
    /// The same after a pause: the SubDevice is busy.
    SendLater,
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
