//! The EEPROM interface (registers 0x0500 to 0x050F).

use super::sync_manager::Side;
use omnibase_ethercat_wire::sii;

/// Control bit 0: the MainDevice allows the write that comes with it.
const WRITE_ENABLE: u16 = 1 << 0;
/// Status bit 6: a read gives 8 bytes.
const EIGHT_BYTES: u16 = 1 << 6;
/// Status bit 7: the EEPROM has two address bytes.
const TWO_ADDRESS_BYTES: u16 = 1 << 7;
const CHECKSUM_ERROR: u16 = 1 << 11;
const NOT_LOADED: u16 = 1 << 12;
const COMMAND_ERROR: u16 = 1 << 13;
const WRITE_ENABLE_ERROR: u16 = 1 << 14;
const BUSY: u16 = 1 << 15;
/// Bytes of the configuration area that the checksum guards.
const CONFIGURATION: usize = 14;
/// The largest EEPROM whose address has one byte (I2C, 16 KiBit).
const ONE_ADDRESS_BYTE: usize = 2048;
/// Byte offset of the EEPROM's size, KiBit − 1.
const SIZE_AT: usize = 0x7C;

/// How fast the EEPROM works, and how much it gives at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SiiTiming {
    /// Busy with a read, ns.
    pub read_ns: u64,
    /// Busy with a write, ns.
    pub write_ns: u64,
}

/// What a command asks for, once the EEPROM is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Job {
    Read,
    Reload,
    Write(u16),
}

/// The EEPROM and its interface.
#[derive(Clone, Debug)]
pub struct SiiUnit {
    image: Vec<u8>,
    timing: SiiTiming,
    job: Option<(Job, u32, u64)>,
    errors: u16,
    command: u16,
    data: [u8; 8],
    /// Register 0x0500.
    config: u8,
    /// Register 0x0501.
    pdi_access: u8,
}

impl SiiUnit {
    /// An EEPROM with this content.
    pub fn new(mut image: Vec<u8>, timing: SiiTiming) -> Self {
        if let Some(size) = image.get(SIZE_AT..SIZE_AT + 2) {
            let bytes = (usize::from(u16::from_le_bytes([size[0], size[1]])) + 1) * 128;
            if bytes <= 1 << 19 && bytes > image.len() {
                image.resize(bytes, 0xFF);
            }
        }
        SiiUnit {
            image,
            timing,
            job: None,
            errors: NOT_LOADED,
            command: 0,
            data: [0; 8],
            config: 0,
            pdi_access: 0,
        }
    }

    /// Power came: forgets everything but the content, and loads the configuration area.
    pub fn power_on(&mut self) -> Option<[u8; CONFIGURATION]> {
        let (image, timing) = (core::mem::take(&mut self.image), self.timing);
        *self = SiiUnit {
            image,
            timing,
            job: None,
            errors: 0,
            command: 0,
            data: [0; 8],
            config: 0,
            pdi_access: 0,
        };
        self.load()
    }

    /// The configuration area, if its checksum is right; the error bits say so if not.
    fn load(&mut self) -> Option<[u8; CONFIGURATION]> {
        self.errors &= !(CHECKSUM_ERROR | NOT_LOADED);
        let Some(area) = self.image.first_chunk::<CONFIGURATION>().copied() else {
            self.errors |= NOT_LOADED;
            return None;
        };
        if self.image.get(CONFIGURATION) != Some(&sii::checksum(&area)) {
            self.errors |= CHECKSUM_ERROR | NOT_LOADED;
            return None;
        }
        Some(area)
    }

    /// The EEPROM's content.
    pub fn image(&self) -> &[u8] {
        &self.image
    }

    /// Finishes what is done at `now`; gives the configuration area after a reload.
    pub fn settle(&mut self, now: u64) -> Option<[u8; CONFIGURATION]> {
        let (job, word, done_at) = self.job?;
        if now < done_at {
            return None;
        }
        self.job = None;
        let at = self.place(word);
        match job {
            Job::Read => {
                self.data = core::array::from_fn(|i| self.image.get(at + i).copied().unwrap_or(0xFF));
                None
            }
            Job::Reload => self.load(),
            Job::Write(value) => {
                match self.image.get_mut(at..at + 2) {
                    Some(cell) => cell.copy_from_slice(&value.to_le_bytes()),
                    None => self.errors |= COMMAND_ERROR,
                }
                None
            }
        }
    }

    /// Where a word stands, byte. An EEPROM with two address bytes doesn't know those beyond its size: it begins anew there.
    fn place(&self, word: u32) -> usize {
        let at = (word as usize).saturating_mul(2);
        if self.image.len() > ONE_ADDRESS_BYTE { at % self.image.len().next_power_of_two() } else { at }
    }

    /// The 16 bytes of registers, but for the address, which is plain memory.
    pub fn registers(&self, registers: &mut [u8]) {
        let mut status = EIGHT_BYTES | self.errors | self.command;
        if self.image.len() > ONE_ADDRESS_BYTE {
            status |= TWO_ADDRESS_BYTES;
        }
        if self.job.is_some() {
            status |= BUSY;
        }
        registers[0] = self.config;
        registers[1] = self.pdi_access;
        registers[2..4].copy_from_slice(&status.to_le_bytes());
        registers[8..16].copy_from_slice(&self.data);
    }

    /// Whether the configuration area was loaded.
    pub fn loaded(&self) -> bool {
        self.errors & NOT_LOADED == 0
    }

    /// Writes 0x0500 from the MainDevice: bit 0 gives the EEPROM to the firmware, bit 1 takes it back.
    pub fn write_config(&mut self, value: u8) {
        if value & 2 != 0 {
            self.pdi_access = 0;
        }
        self.config = value & 3;
    }

    /// Writes 0x0501 from the firmware: bit 0 takes the EEPROM, where it may.
    pub fn write_pdi_access(&mut self, value: u8) -> bool {
        let allowed = self.config & 1 != 0 || value & 1 == 0;
        if allowed {
            self.pdi_access = value & 1;
        }
        allowed
    }

    /// Whether this side may write 0x0502 to 0x050F now.
    pub fn writable(&self, side: Side) -> bool {
        let owner = match side {
            Side::Ecat => self.config & 1 == 0 && self.pdi_access == 0,
            Side::Pdi => self.config & 1 != 0 && self.pdi_access != 0,
        };
        owner && self.job.is_none()
    }

    /// Stores bytes into the data register at `offset`.
    pub fn write_data(&mut self, offset: usize, data: &[u8]) {
        for (cell, byte) in self.data[offset..].iter_mut().zip(data) {
            *cell = *byte;
        }
    }

    /// A command was written (0x0502); `word` is the address register.
    pub fn command(&mut self, side: Side, control: u16, word: u32, now: u64) {
        self.errors &= !(COMMAND_ERROR | WRITE_ENABLE_ERROR);
        self.command = control & 0x0700;
        let (job, duration) = match self.command {
            0x0000 => return,
            0x0100 => (Job::Read, self.timing.read_ns),
            0x0400 => (Job::Reload, self.timing.read_ns),
            0x0200 if side == Side::Ecat && control & WRITE_ENABLE == 0 => {
                self.errors |= WRITE_ENABLE_ERROR;
                return;
            }
            0x0200 => (Job::Write(u16::from_le_bytes([self.data[0], self.data[1]])), self.timing.write_ns),
            _ => {
                self.errors |= COMMAND_ERROR;
                return;
            }
        };
        // An EEPROM that isn't there doesn't acknowledge.
        if self.image.is_empty() || (self.place(word) >= self.image.len() && matches!(job, Job::Write(_))) {
            self.errors |= COMMAND_ERROR;
            return;
        }
        self.job = Some((job, word, now.saturating_add(duration)));
    }
}
