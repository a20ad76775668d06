//! File access over EtherCAT (ETG.1000.6, "FoE coding"): what follows the mailbox header.
//!
//! ```text
//! read, write  | opcode 1 or 2 | reserved 1 | password 4        | file name ...
//! data         | opcode 3      | reserved 1 | packet number 4   | bytes ...
//! acknowledge  | opcode 4      | reserved 1 | packet number 4   |
//! error        | opcode 5      | reserved 1 | error code 4      | text ...
//! busy         | opcode 6      | reserved 1 | done 2 | entire 2 | text ...
//! ```
//!
//! A file ends with the first packet that isn't full; where its length is a multiple of the packet's, with an empty one.

use crate::bytes::{put_u16, put_u32, u16_at, u32_at};
use core::fmt;

/// Bytes before name, data or text.
pub const HEADER: usize = 6;

const READ: u8 = 1;
const WRITE: u8 = 2;
const DATA: u8 = 3;
const ACKNOWLEDGE: u8 = 4;
const ERROR: u8 = 5;
const BUSY: u8 = 6;

/// One FoE message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Message<'a> {
    /// The MainDevice wants to read a file.
    Read {
        /// Password; 0 where none is asked.
        password: u32,
        /// The file's name, bytes without an end mark.
        name: &'a [u8],
    },
    /// The MainDevice wants to write a file.
    Write {
        /// Password; 0 where none is asked.
        password: u32,
        /// The file's name, bytes without an end mark.
        name: &'a [u8],
    },
    /// A piece of the file.
    Data {
        /// Number of the packet, from 1.
        packet: u32,
        /// Its bytes.
        data: &'a [u8],
    },
    /// A packet was taken.
    Acknowledge {
        /// Its number; 0 acknowledges the request to write.
        packet: u32,
    },
    /// It is over.
    Error {
        /// Why.
        code: FoeErrorCode,
        /// In the sender's words.
        text: &'a [u8],
    },
    /// The sender needs more time; the last message is to be sent again.
    Busy {
        /// How much is done, of `entire`.
        done: u16,
        /// All there is to do; 0 where that isn't known.
        entire: u16,
        /// In the sender's words.
        text: &'a [u8],
    },
}

/// Why bytes aren't an FoE message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FoeError {
    /// Not even a header.
    #[error("FoE message of {found} bytes is shorter than its header of 6")]
    TooShort {
        /// Bytes there.
        found: usize,
    },
    /// An opcode that the standard doesn't name.
    #[error("FoE opcode {found} is not named by the standard (1 to 6)")]
    Opcode {
        /// Found.
        found: u8,
    },
}

impl<'a> Message<'a> {
    /// Reads the service data of a mailbox message.
    pub fn read(bytes: &'a [u8]) -> Result<Self, FoeError> {
        let Some((head, rest)) = bytes.split_at_checked(HEADER) else {
            return Err(FoeError::TooShort { found: bytes.len() });
        };
        let number = u32_at(head, 2);
        Ok(match head[0] {
            READ => Message::Read { password: number, name: without_end(rest) },
            WRITE => Message::Write { password: number, name: without_end(rest) },
            DATA => Message::Data { packet: number, data: rest },
            ACKNOWLEDGE => Message::Acknowledge { packet: number },
            ERROR => Message::Error { code: FoeErrorCode(number), text: without_end(rest) },
            BUSY => Message::Busy { done: u16_at(head, 2), entire: u16_at(head, 4), text: without_end(rest) },
            found => return Err(FoeError::Opcode { found }),
        })
    }

    /// Writes it to the start of `bytes`, as much of name, data or text as there is room for; its length.
    ///
    /// Panics where `bytes` is shorter than [`HEADER`].
    pub fn write(&self, bytes: &mut [u8]) -> usize {
        let (opcode, number, rest): (u8, u32, &[u8]) = match *self {
            Message::Read { password, name } => (READ, password, name),
            Message::Write { password, name } => (WRITE, password, name),
            Message::Data { packet, data } => (DATA, packet, data),
            Message::Acknowledge { packet } => (ACKNOWLEDGE, packet, &[]),
            Message::Error { code: FoeErrorCode(code), text } => (ERROR, code, text),
            Message::Busy { text, .. } => (BUSY, 0, text),
        };
        bytes[..HEADER].fill(0);
        bytes[0] = opcode;
        put_u32(bytes, 2, number);
        if let Message::Busy { done, entire, .. } = *self {
            put_u16(bytes, 2, done);
            put_u16(bytes, 4, entire);
        }
        let length = rest.len().min(bytes.len() - HEADER);
        bytes[HEADER..HEADER + length].copy_from_slice(&rest[..length]);
        HEADER + length
    }
}

/// Text up to its end mark, where a device sends one.
fn without_end(text: &[u8]) -> &[u8] {
    let end = text.iter().position(|byte| *byte == 0).unwrap_or(text.len());
    &text[..end]
}

/// An FoE error code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FoeErrorCode(pub u32);

impl FoeErrorCode {
    /// Anything.
    pub const NOT_DEFINED: Self = FoeErrorCode(0x8000);
    /// There is no such file.
    pub const NOT_FOUND: Self = FoeErrorCode(0x8001);
    /// Wrong password, or not at present.
    pub const ACCESS_DENIED: Self = FoeErrorCode(0x8002);
    /// The file is longer than what is free.
    pub const DISK_FULL: Self = FoeErrorCode(0x8003);
    /// The request makes no sense now.
    pub const ILLEGAL: Self = FoeErrorCode(0x8004);
    /// Another packet was awaited.
    pub const PACKET_NUMBER: Self = FoeErrorCode(0x8005);
    /// Files work in BOOT alone.
    pub const BOOTSTRAP_ONLY: Self = FoeErrorCode(0x8008);

    /// What it means, and what is usually to be done (ETG.1000.6, "FoE error codes").
    pub fn text(self) -> &'static str {
        match self.0 {
            0x8000 => "not defined: the device's own words and its manual tell more",
            0x8001 => "file not found: the name is the device's own, often that of the maker's file",
            0x8002 => "access denied: the password may be wrong or missing (--password)",
            0x8003 => "no room: the file is longer than the device's memory, so probably not for this device",
            0x8004 => "illegal: the device doesn't do this in its present state",
            0x8005 => "packet number wrong: begin again",
            0x8006 => "the file exists already",
            0x8007 => "no user",
            0x8008 => "in BOOT only (leave --pre-op out)",
            0x8009 => "not in BOOT: this file belongs to PRE-OP (--pre-op)",
            0x800A => "no rights",
            0x800B => "program error: the device couldn't store what it got; begin again",
            0x800C => "wrong checksum: the file is damaged, or not for this device",
            0x800D => "the firmware doesn't fit the hardware",
            0x800F => "no file to read",
            0x8010 => "the file's header is missing",
            0x8011 => "the device's flash memory fails",
            0x8012 => "the file doesn't fit this device",
            _ => "not named by the standard",
        }
    }
}

impl fmt::Display for FoeErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:04x} {}", self.0, self.text())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn bytes_are_those_of_the_standard() {
        let mut bytes = [0xFF; 12];
        let length = Message::Write { password: 0x1234, name: b"app.bin" }.write(&mut bytes);
        assert_eq!((length, &bytes[..]), (12, &b"\x02\x00\x34\x12\x00\x00app.bi"[..]));
        let length = Message::Data { packet: 2, data: &[7, 8] }.write(&mut bytes);
        assert_eq!(&bytes[..length], [3, 0, 2, 0, 0, 0, 7, 8]);
        let length = Message::Busy { done: 3, entire: 100, text: b"" }.write(&mut bytes);
        assert_eq!(&bytes[..length], [6, 0, 3, 0, 100, 0]);
        let error = Message::read(&[5, 0, 2, 0x80, 0, 0, b'n', b'o', 0]);
        assert_eq!(error, Ok(Message::Error { code: FoeErrorCode::ACCESS_DENIED, text: b"no" }));
        assert_eq!(Message::read(&[4, 0, 0]), Err(FoeError::TooShort { found: 3 }));
        assert_eq!(Message::read(&[9, 0, 0, 0, 0, 0]), Err(FoeError::Opcode { found: 9 }));
    }

    proptest! {
        #[test]
        fn what_is_read_is_written_back(bytes in prop::collection::vec(any::<u8>(), 0..40)) {
            if let Ok(message) = Message::read(&bytes) {
                let mut again = [0; 64];
                let length = message.write(&mut again);
                prop_assert!(length <= bytes.len());
                prop_assert_eq!(Message::read(&again[..length]), Ok(message));
            }
        }
    }
}
