//! Files over the mailbox (FoE), read and written.

use alloc::vec::Vec;

use super::outcome::{Outcome, failed, failed_with};
use super::request::{FileAccess, MailboxError, MailboxRequest};
use super::short_text::ShortText;
use crate::wire::coe::AbortCode;
use crate::wire::foe::{self, FoeErrorCode, Message};

/// How often in a row a SubDevice may say that it is busy: with the pauses between, five minutes. Erasing a large flash
/// memory takes one.
const BUSY_LIMIT: u32 = 30_000;

/// Where a transfer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// The file is asked for, or announced.
    Ask,
    /// Packet by packet.
    Packets,
    /// The last packet of a file that is read is acknowledged: nothing follows.
    LastAcknowledge,
}

/// The transfer of one file.
#[derive(Clone, Copy, Debug)]
pub(super) struct File {
    stage: Stage,
    /// The packet in hand: sent and not acknowledged, or received.
    packet: u32,
    /// Bytes of a file that is written which the SubDevice has acknowledged.
    acknowledged: usize,
    /// Bytes in the packet in hand, and the most that a packet holds.
    in_hand: usize,
    room: usize,
    /// Data of a full packet from the SubDevice.
    full_answer: usize,
    busy: u32,
}

impl File {
    pub(super) fn new(longest_answer: usize) -> Self {
        File {
            stage: Stage::Ask,
            packet: 0,
            acknowledged: 0,
            in_hand: 0,
            room: 0,
            full_answer: longest_answer.saturating_sub(foe::HEADER),
            busy: 0,
        }
    }

    pub(super) fn ends_with_message(&self) -> bool {
        self.stage == Stage::LastAcknowledge
    }

    /// How much of the file was carried, bytes.
    pub(super) fn bytes(&self, request: &MailboxRequest) -> usize {
        if request.operation.is_write() { self.acknowledged } else { request.data.len() }
    }

    /// Tells the SubDevice that nothing more comes.
    pub(super) fn write_abort(&self, message: &mut [u8]) -> usize {
        Message::Error { code: FoeErrorCode::NOT_DEFINED, text: b"" }.write(message)
    }

    pub(super) fn write_download(&mut self, message: &mut [u8], request: &MailboxRequest) -> usize {
        if self.stage == Stage::Ask {
            let FileAccess { name, password } = &request.file;
            return Message::Write { password: *password, name: name.as_bytes() }.write(message);
        }
        self.room = message.len() - foe::HEADER;
        let left = request.data.get(self.acknowledged..).unwrap_or(&[]);
        self.in_hand = left.len().min(self.room);
        Message::Data { packet: self.packet, data: &left[..self.in_hand] }.write(message)
    }

    pub(super) fn read_download(&mut self, message: &[u8], length: usize) -> Outcome {
        match Message::read(message) {
            Ok(Message::Acknowledge { packet }) if packet == self.packet => {
                self.busy = 0;
                if self.stage == Stage::Packets {
                    self.acknowledged += self.in_hand;
                    if self.in_hand < self.room {
                        let received = self.acknowledged;
                        debug_assert_eq!(received, length);
                        return Outcome::Done;
                    }
                }
                self.stage = Stage::Packets;
                self.packet = self.packet.wrapping_add(1);
                Outcome::Send
            }
            // Of the packet before, for the second time.
            Ok(Message::Acknowledge { packet }) if packet.wrapping_add(1) == self.packet => Outcome::Stray,
            Ok(Message::Acknowledge { packet }) => self.wrong_packet(packet),
            other => self.common(other),
        }
    }

    pub(super) fn write_upload(&mut self, message: &mut [u8], file: &FileAccess) -> usize {
        match self.stage {
            Stage::Ask => {
                Message::Read { password: file.password, name: file.name.as_bytes() }.write(message)
            }
            Stage::Packets | Stage::LastAcknowledge => {
                Message::Acknowledge { packet: self.packet }.write(message)
            }
        }
    }

    pub(super) fn read_upload(&mut self, message: &[u8], result: &mut Vec<u8>) -> Outcome {
        match Message::read(message) {
            Ok(Message::Data { packet, data }) if packet == self.packet.wrapping_add(1) => {
                self.busy = 0;
                let needed = result.len() + data.len();
                if needed > result.capacity() {
                    let error = MailboxError::TooLong { needed, limit: result.capacity() };
                    return failed_with(error, AbortCode::OUT_OF_MEMORY);
                }
                result.extend_from_slice(data);
                self.packet = packet;
                let is_last = data.len() < self.full_answer;
                self.stage = if is_last { Stage::LastAcknowledge } else { Stage::Packets };
                Outcome::Send
            }
            Ok(Message::Data { packet, .. }) if packet == self.packet => Outcome::Stray,
            Ok(Message::Data { packet, .. }) => self.wrong_packet(packet.wrapping_sub(1)),
            other => self.common(other),
        }
    }

    fn wrong_packet(&self, found: u32) -> Outcome {
        failed_with(MailboxError::PacketNumber { expected: self.packet, found }, AbortCode::GENERAL)
    }

    /// What ends or delays both directions.
    fn common(&mut self, message: Result<Message<'_>, foe::FoeError>) -> Outcome {
        let packet = self.packet;
        match message {
            Ok(Message::Error { code, text }) => {
                failed(MailboxError::FileRefused { code, packet, text: ShortText::beginning(text) })
            }
            Ok(Message::Busy { .. }) => {
                self.busy += 1;
                if self.busy >= BUSY_LIMIT {
                    return failed_with(MailboxError::Busy { times: self.busy, packet }, AbortCode::GENERAL);
                }
                Outcome::SendLater
            }
            _ => Outcome::Stray,
        }
    }
}
