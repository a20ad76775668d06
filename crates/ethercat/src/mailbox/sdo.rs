//! SDO transfers: expedited, normal, segmented, up and down, complete access.

use super::outcome::{Outcome, failed, failed_with};
use super::request::{MailboxError, SdoAccess};
use crate::wire::coe::{self, AbortCode, ObjectAddress, SdoHeader, Service, sdo};
use alloc::vec::Vec;

const INITIATE: usize = coe::HEADER + coe::SDO_HEADER;
/// A segment's data start behind the CoE header and one command byte; shorter messages than ten bytes are padded.
const SEGMENT_DATA: usize = coe::HEADER + 1;

/// Where a transfer is.
#[derive(Clone, Copy, Debug)]
enum Stage {
    Initiate,
    Segment {
        /// The toggle bit of the segment in hand, 0 or [`sdo::TOGGLE`].
        toggle: u8,
        /// The announced size; some SubDevices don't announce one.
        total: Option<usize>,
    },
}

/// One SDO transfer as the client sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sdo {
    object: ObjectAddress,
    access: SdoAccess,
    phase: Stage,
    /// Bytes of a download that the SubDevice has acknowledged, or that are in the message in hand.
    sent: usize,
}

impl Sdo {
    pub(super) fn new(object: ObjectAddress, access: SdoAccess) -> Self {
        Sdo { object, access, phase: Stage::Initiate, sent: 0 }
    }

    pub(super) fn object(&self) -> ObjectAddress {
        self.object
    }

    fn complete(&self) -> u8 {
        if self.access == SdoAccess::Complete { sdo::COMPLETE_ACCESS } else { 0 }
    }

    /// With complete access SubDevices differ in the subindex that they return.
    fn is_mine(&self, object: ObjectAddress) -> bool {
        object.index == self.object.index
            && (object.subindex == self.object.subindex || self.access == SdoAccess::Complete)
    }

    /// Checks service, abort and length: what every answer has in common.
    fn open<'a>(&self, message: &'a [u8]) -> Result<&'a [u8], Outcome> {
        let service = coe::service_code(message).and_then(Service::from_code);
        // An abort travels as a request in either direction (ETG.1000.6, "Abort SDO transfer").
        if !matches!(service, Some(Service::SdoResponse | Service::SdoRequest)) {
            return Err(Outcome::Stray);
        }
        let body = &message[coe::HEADER..];
        match body.first() {
            None => return Err(Outcome::Stray),
            Some(command) if command & sdo::SPECIFIER == sdo::ABORT => {
                return Err(match SdoHeader::read(body) {
                    Some(header) if self.is_mine(header.object) => {
                        let code = AbortCode(header.value());
                        failed(MailboxError::Aborted { object: self.object, code })
                    }
                    _ => Outcome::Stray,
                });
            }
            Some(_) if service == Some(Service::SdoRequest) => return Err(Outcome::Stray),
            Some(_) => {}
        }
        Ok(body)
    }

    /// Writes the next upload message; returns its length.
    pub(super) fn write_upload(&self, message: &mut [u8]) -> usize {
        coe::write_header(message, Service::SdoRequest);
        match self.phase {
            Stage::Initiate => {
                let command = sdo::CLIENT_UPLOAD | self.complete();
                let header = SdoHeader { command, object: self.object, data: [0; 4] };
                header.write(&mut message[coe::HEADER..]);
            }
            Stage::Segment { toggle, .. } => message[coe::HEADER] = sdo::CLIENT_UPLOAD_SEGMENT | toggle,
        }
        INITIATE
    }

    /// Takes the answer to an upload message; `result` never grows beyond its capacity.
    pub(super) fn read_upload(&mut self, message: &[u8], result: &mut Vec<u8>) -> Outcome {
        let body = match self.open(message) {
            Ok(body) => body,
            Err(outcome) => return outcome,
        };
        match self.phase {
            Stage::Initiate => self.read_upload_start(body, result),
            Stage::Segment { toggle, total } => self.read_upload_segment(body, toggle, total, result),
        }
    }

    fn read_upload_start(&mut self, body: &[u8], result: &mut Vec<u8>) -> Outcome {
        let Some(header) = SdoHeader::read(body) else { return Outcome::Stray };
        if header.command & sdo::SPECIFIER != sdo::SERVER_UPLOAD || !self.is_mine(header.object) {
            return Outcome::Stray;
        }
        let sized = header.command & sdo::SIZE_INDICATED != 0;
        if header.command & sdo::EXPEDITED != 0 {
            let length = if sized { sdo::expedited_length(header.command) } else { 4 };
            if length > result.capacity() {
                return failed(MailboxError::TooLong { needed: length, limit: result.capacity() });
            }
            result.extend_from_slice(&header.data[..length]);
            return Outcome::Done;
        }
        let total = sized.then_some(header.value() as usize);
        let data = &body[coe::SDO_HEADER..];
        if let Some(total) = total {
            if total > result.capacity() {
                let error = MailboxError::TooLong { needed: total, limit: result.capacity() };
                return failed_with(error, AbortCode::OUT_OF_MEMORY);
            }
            if total <= data.len() {
                // Bytes behind the announced size are padding.
                result.extend_from_slice(&data[..total]);
                return Outcome::Done;
            }
        }
        if data.len() > result.capacity() {
            let error = MailboxError::TooLong { needed: data.len(), limit: result.capacity() };
            return failed_with(error, AbortCode::OUT_OF_MEMORY);
        }
        result.extend_from_slice(data);
        if total.is_none() && !data.is_empty() {
            return Outcome::Done;
        }
        self.phase = Stage::Segment { toggle: 0, total };
        Outcome::Send
    }

    fn read_upload_segment(
        &mut self,
        body: &[u8],
        toggle: u8,
        total: Option<usize>,
        result: &mut Vec<u8>,
    ) -> Outcome {
        let command = body[0];
        if command & sdo::SPECIFIER != sdo::SERVER_UPLOAD_SEGMENT {
            return Outcome::Stray;
        }
        if command & sdo::TOGGLE != toggle {
            let error = MailboxError::Toggle { object: self.object, offset: result.len() };
            return failed_with(error, AbortCode::TOGGLE);
        }
        let mut data = &body[1..];
        if data.len() <= 7 {
            data = &data[..data.len().min(7 - sdo::segment_unused_bytes(command))];
        }
        let last = command & sdo::LAST_SEGMENT != 0;
        let received = result.len() + data.len();
        if let Some(announced) = total
            && (received > announced || (last && received < announced))
        {
            let error = MailboxError::SizeMismatch { object: self.object, announced, received };
            return failed_with(error, AbortCode::LENGTH);
        }
        if received > result.capacity() {
            let error = MailboxError::TooLong { needed: received, limit: result.capacity() };
            return failed_with(error, AbortCode::OUT_OF_MEMORY);
        }
        result.extend_from_slice(data);
        if last {
            return Outcome::Done;
        }
        if data.is_empty() {
            // It would let a broken SubDevice keep us busy for ever.
            let error = MailboxError::Malformed { what: "a segment without data that isn't the last" };
            return failed_with(error, AbortCode::GENERAL);
        }
        self.phase = Stage::Segment { toggle: toggle ^ sdo::TOGGLE, total };
        Outcome::Send
    }

    /// Writes the next download message into `message` (as long as the mailbox allows); returns its length.
    pub(super) fn write_download(&mut self, message: &mut [u8], data: &[u8]) -> usize {
        coe::write_header(message, Service::SdoRequest);
        let left = &data[self.sent..];
        match self.phase {
            Stage::Initiate => {
                let mut header =
                    SdoHeader { command: sdo::CLIENT_DOWNLOAD, object: self.object, data: [0; 4] };
                header.command |= self.complete() | sdo::SIZE_INDICATED;
                let mut chunk: &[u8] = &[];
                if self.access == SdoAccess::Entry && (1..=4).contains(&data.len()) {
                    header.command |= sdo::EXPEDITED | sdo::expedited_unused(data.len());
                    header.data[..data.len()].copy_from_slice(data);
                    self.sent = data.len();
                } else {
                    header.data = (data.len() as u32).to_le_bytes();
                    chunk = &left[..left.len().min(message.len() - INITIATE)];
                    self.sent += chunk.len();
                }
                header.write(&mut message[coe::HEADER..]);
                message[INITIATE..INITIATE + chunk.len()].copy_from_slice(chunk);
                INITIATE + chunk.len()
            }
            Stage::Segment { toggle, .. } => {
                let chunk = &left[..left.len().min(message.len() - SEGMENT_DATA)];
                let last = if chunk.len() == left.len() { sdo::LAST_SEGMENT } else { 0 };
                message[coe::HEADER] =
                    sdo::CLIENT_DOWNLOAD_SEGMENT | toggle | last | sdo::segment_unused(chunk.len());
                let end = SEGMENT_DATA + chunk.len();
                message[SEGMENT_DATA..end].copy_from_slice(chunk);
                self.sent += chunk.len();
                end.max(INITIATE)
            }
        }
    }

    /// Takes the answer to a download message of `length` bytes in all.
    pub(super) fn read_download(&mut self, message: &[u8], length: usize) -> Outcome {
        let body = match self.open(message) {
            Ok(body) => body,
            Err(outcome) => return outcome,
        };
        let toggle = match self.phase {
            Stage::Initiate => {
                let Some(header) = SdoHeader::read(body) else { return Outcome::Stray };
                if header.command & sdo::SPECIFIER != sdo::SERVER_DOWNLOAD || !self.is_mine(header.object) {
                    return Outcome::Stray;
                }
                0
            }
            Stage::Segment { toggle, .. } => {
                if body[0] & sdo::SPECIFIER != sdo::SERVER_DOWNLOAD_SEGMENT {
                    return Outcome::Stray;
                }
                if body[0] & sdo::TOGGLE != toggle {
                    let error = MailboxError::Toggle { object: self.object, offset: self.sent };
                    return failed_with(error, AbortCode::TOGGLE);
                }
                toggle ^ sdo::TOGGLE
            }
        };
        if self.sent >= length {
            return Outcome::Done;
        }
        self.phase = Stage::Segment { toggle, total: None };
        Outcome::Send
    }
}

/// Writes the client's abort of `object`; returns its length.
pub(super) fn write_abort(message: &mut [u8], object: ObjectAddress, code: AbortCode) -> usize {
    coe::write_header(message, Service::SdoRequest);
    SdoHeader { command: sdo::ABORT, object, data: code.0.to_le_bytes() }.write(&mut message[coe::HEADER..]);
    INITIATE
}
