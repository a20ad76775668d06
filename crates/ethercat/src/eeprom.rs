//! SubDevices' EEPROM (the SII) through registers 0x0502 to 0x050F: reading, and writing word by word.

mod interface;
mod write;

use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

use self::interface::Interface;
use crate::found::Found;
use crate::found::Target;
use crate::procedure::{Answer, DatagramRequest, Next, Procedure};
use crate::wire::HostTime;
use crate::wire::bytes::{put_u16, put_u32, u16_at, u32_at};
use crate::wire::register;
use crate::wire::sii;
use crate::wire::spoken;

pub(crate) use write::spoiled_checksum;
pub use write::{EepromWriteError, SiiWriter, WordWrite, plan, with_checksum};

/// The most that is ever read: the address space of the largest EEPROM that devices have.
pub const MAX_BYTES: usize = 64 * 1024;
/// Read at least as far as this, whatever size the image announces: some announce none.
const LEAST_LIMIT: usize = 2048;
/// Where the EEPROM's size stands, bytes.
const SIZE_AT: usize = 0x3E * 2;

const READS_EIGHT_BYTES: u16 = 1 << 6;
const COMMAND_READ: u16 = 1 << 8;

/// How much is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SiiExtent {
    /// The fixed part alone: identity, alias, mailboxes, size.
    Fixed,
    /// The fixed part, and the categories that set-up needs; others are passed over.
    Needed,
    /// Every byte of the announced size, 64 KiB at most.
    Whole,
    /// The first so many bytes, whatever is announced.
    First(usize),
}

/// Why an EEPROM could not be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EepromError {
    /// The SubDevice.
    pub position: u16,
    /// The word that was to be read.
    pub word: u32,
    /// What happened.
    pub cause: EepromFailure,
}

/// What went wrong with an EEPROM.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EepromFailure {
    /// The SubDevice did not answer.
    NoAnswer(Found),
    /// The interface stayed busy for this long.
    Busy(Duration),
    /// The EEPROM did not acknowledge; the last value of register 0x0502.
    NotAcknowledged {
        /// Register 0x0502.
        status: u16,
    },
    /// What stands there isn't what was written.
    Differs {
        /// Written.
        written: u16,
        /// Read back.
        found: u16,
    },
}

impl fmt::Display for EepromFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            EepromFailure::NoAnswer(found) => write!(f, "{}", found.against(1)),
            EepromFailure::Busy(limit) => write!(f, "the interface stayed busy for {}", spoken(*limit)),
            EepromFailure::NotAcknowledged { status } => {
                write!(f, "the EEPROM did not acknowledge (register 0x0502 is 0x{status:04x})")
            }
            EepromFailure::Differs { written, found } => {
                write!(f, "0x{written:04x} was written, 0x{found:04x} read back")
            }
        }
    }
}

impl fmt::Display for EepromError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let EepromError { position, word, cause } = self;
        write!(f, "SubDevice {position}: reading EEPROM word 0x{word:04x}: {cause}")
    }
}

impl core::error::Error for EepromError {}

/// What the next datagram is.
#[derive(Clone, Copy, Debug)]
enum Stage {
    /// Look whether the interface is free.
    Free,
    /// Order the read.
    Order,
    /// Fetch status and data.
    Fetch,
}

/// What is being read.
#[derive(Clone, Copy, Debug)]
enum Part {
    Header,
    CategoryHeader,
    CategoryBody { end: usize },
    Skip { end: usize },
    Rest { end: usize },
}

/// Reads one SubDevice's EEPROM; once it has ended well, [`SiiReader::image`] is what was read.
#[derive(Debug)]
pub struct SiiReader {
    target: Target,
    extent: SiiExtent,
    /// What was kept so far.
    image: Vec<u8>,
    /// Byte in the EEPROM that is read next; always even.
    cursor: usize,
    part: Part,
    phase: Stage,
    interface: Interface,
    /// Bytes of the last read, and where they stand.
    fetched: (usize, [u8; 8], usize),
    outcome: Option<Result<(), EepromFailure>>,
}

impl SiiReader {
    /// A reader of the SubDevice `target`, whose EEPROM belongs to the MainDevice at present.
    pub fn new(target: Target, extent: SiiExtent) -> Self {
        SiiReader { image: Vec::with_capacity(512), ..SiiReader::idle(target, extent) }
    }

    /// One that has read nothing and has no memory.
    fn idle(target: Target, extent: SiiExtent) -> Self {
        SiiReader {
            target,
            extent,
            image: Vec::new(),
            cursor: 0,
            part: Part::Header,
            phase: Stage::Free,
            interface: Interface::default(),
            fetched: (0, [0; 8], 0),
            outcome: None,
        }
    }

    /// Begins anew; asks for no memory that it hasn't.
    pub fn restart(&mut self) {
        let mut image = core::mem::take(&mut self.image);
        image.clear();
        *self = SiiReader { image, ..SiiReader::idle(self.target, self.extent) };
    }

    /// What was read so far.
    pub fn image(&self) -> &[u8] {
        &self.image
    }

    /// What was read so far.
    pub fn into_image(self) -> Vec<u8> {
        self.image
    }

    fn limit(&self) -> usize {
        let announced = (usize::from(u16_at(&self.image, SIZE_AT)) + 1) * 128;
        match self.extent {
            SiiExtent::Fixed => sii::HEADER,
            SiiExtent::Needed => announced.clamp(LEAST_LIMIT, MAX_BYTES),
            SiiExtent::Whole => announced.clamp(sii::HEADER, MAX_BYTES),
            SiiExtent::First(length) => length.clamp(sii::HEADER, MAX_BYTES),
        }
    }

    fn part_end(&self) -> usize {
        match self.part {
            Part::Header => sii::HEADER,
            Part::CategoryHeader => self.cursor + 4,
            Part::CategoryBody { end } | Part::Skip { end } | Part::Rest { end } => end,
        }
    }

    /// Takes what the last read holds for the present part, and goes on to the next part where it is complete.
    fn take_fetched(&mut self) {
        while self.outcome.is_none() {
            let (start, bytes, length) = self.fetched;
            let end = self.part_end();
            if let Part::Skip { .. } = self.part {
                self.cursor = end;
            } else if let Part::CategoryHeader = self.part {
                // Decided as a whole, so that a header is never kept without its body.
                let Some(from) = self.cursor.checked_sub(start).filter(|from| from + 4 <= length) else {
                    return;
                };
                let (kind, words) = (u16_at(&bytes, from), usize::from(u16_at(&bytes, from + 2)));
                self.begin_category(kind, words);
                continue;
            } else if self.cursor < end {
                let Some(from) = self.cursor.checked_sub(start).filter(|&from| from < length) else {
                    return;
                };
                let taken = (length - from).min(end - self.cursor);
                self.image.extend_from_slice(&bytes[from..from + taken]);
                self.cursor += taken;
                if self.cursor < end {
                    return;
                }
            }
            self.begin_part();
        }
    }

    fn begin_part(&mut self) {
        let limit = self.limit();
        self.part = match (self.part, self.extent) {
            (Part::Header, SiiExtent::Whole | SiiExtent::First(_)) => Part::Rest { end: limit },
            (Part::Rest { .. }, _) | (Part::Header, SiiExtent::Fixed) => {
                self.outcome = Some(Ok(()));
                return;
            }
            _ => Part::CategoryHeader,
        };
        if let (Part::Rest { end }, true) = (self.part, self.cursor >= limit) {
            debug_assert!(self.cursor >= end);
            self.outcome = Some(Ok(()));
        } else if matches!(self.part, Part::CategoryHeader) && self.cursor + 4 > limit {
            self.end_image();
        }
    }

    fn begin_category(&mut self, kind: u16, words: usize) {
        if kind == sii::CATEGORY_END {
            self.end_image();
            return;
        }
        self.cursor += 4;
        let end = (self.cursor + words * 2).min(MAX_BYTES);
        let needed = matches!(
            kind,
            sii::CATEGORY_STRINGS
                | sii::CATEGORY_GENERAL
                | sii::CATEGORY_FMMU
                | sii::CATEGORY_SYNC_MANAGERS
                | sii::CATEGORY_TX_PDO
                | sii::CATEGORY_RX_PDO
                | sii::CATEGORY_DC
        );
        let is_cut = end > self.limit();
        if !needed && !is_cut {
            self.part = Part::Skip { end };
            return;
        }
        let mut header = [0; 4];
        put_u16(&mut header, 0, kind);
        put_u16(&mut header, 2, words as u16);
        self.image.extend_from_slice(&header);
        if !needed {
            // It leads out of the EEPROM: whoever makes sense of the image sees that, and nothing can follow it.
            self.outcome = Some(Ok(()));
            return;
        }
        self.part = Part::CategoryBody { end };
    }

    fn end_image(&mut self) {
        self.image.extend_from_slice(&sii::CATEGORY_END.to_le_bytes());
        self.outcome = Some(Ok(()));
    }

    fn word(&self) -> u32 {
        (self.cursor / 2) as u32
    }

    fn take_status(&mut self, data: &[u8], now: HostTime) -> Result<(), EepromFailure> {
        let status = u16_at(data, 0);
        if self.interface.is_busy(status, now)? {
            return Ok(());
        }
        let has_read = matches!(self.phase, Stage::Fetch);
        self.phase = Stage::Order;
        if !has_read || !self.interface.is_acknowledged(status, u32_at(data, 2), self.word(), now)? {
            return Ok(());
        }
        let length = if status & READS_EIGHT_BYTES != 0 { 8 } else { 4 };
        let mut bytes = [0; 8];
        bytes[..length].copy_from_slice(&data[6..6 + length]);
        self.fetched = (self.cursor, bytes, length);
        self.take_fetched();
        Ok(())
    }
}

impl Procedure for SiiReader {
    type Output = Result<(), EepromError>;

    fn next(&mut self, now: HostTime) -> Next<Self::Output> {
        if let Some(outcome) = self.outcome.take() {
            let (position, word) = (self.target.position, self.word());
            return Next::Done(outcome.map_err(|cause| EepromError { position, word, cause }));
        }
        if let Some(instant) = self.interface.pause(now) {
            return Next::WaitUntil(instant);
        }
        let station = self.target.station;
        Next::Send(match self.phase {
            Stage::Free => DatagramRequest::read(station, register::SII_CONTROL, 2),
            Stage::Order => DatagramRequest::write(station, register::SII_CONTROL, 6),
            Stage::Fetch => DatagramRequest::read(station, register::SII_CONTROL, 14),
        })
    }

    fn fill(&self, data: &mut [u8]) {
        if let Stage::Order = self.phase {
            put_u16(data, 0, COMMAND_READ);
            put_u32(data, 2, self.word());
        }
    }

    fn answer(&mut self, answer: Answer<'_>, now: HostTime) {
        let taken = match answer.data(1) {
            Err(found) => self.interface.lost(found, now),
            Ok(data) => {
                self.interface.answered();
                match self.phase {
                    Stage::Order => {
                        self.phase = Stage::Fetch;
                        Ok(())
                    }
                    Stage::Free | Stage::Fetch => self.take_status(data, now),
                }
            }
        };
        if let Err(failure) = taken {
            self.outcome = Some(Err(failure));
        }
    }
}
