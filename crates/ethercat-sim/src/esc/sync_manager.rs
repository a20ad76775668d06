//! A SyncManager: guards an area of memory so that both sides see whole messages (ESC datasheet, "SyncManager").

use super::REGISTERS;
use core::ops::Range;
use omnibase_ethercat_wire::register::al_event;

/// Who accesses the memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Side {
    /// The MainDevice, by frames.
    Ecat,
    /// The firmware, by the process-data interface.
    #[default]
    Pdi,
}

/// What an access did to a SyncManager beside moving bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Not allowed now; no byte moved, the working counter stays.
    Denied,
    /// Bytes moved within an open buffer.
    Partial,
    /// The first byte was touched: the other side's event is acknowledged.
    Opened,
    /// The last byte was touched: the buffer changed hands.
    Completed,
}

/// Control register bit 4: tell the MainDevice.
const CONTROL_ECAT_EVENT: u8 = 1 << 4;
/// Control register bit 5: tell the firmware.
const CONTROL_PDI_EVENT: u8 = 1 << 5;
/// Control register bit 6: writes trigger the process-data watchdog.
const CONTROL_WATCHDOG: u8 = 1 << 6;
const STATUS_WRITE_EVENT: u8 = 1 << 0;
const STATUS_READ_EVENT: u8 = 1 << 1;
const STATUS_FULL: u8 = 1 << 3;

/// State of one SyncManager.
#[derive(Clone, Debug, Default)]
pub struct SyncManager {
    /// Its bit among AL events, and among ECAT events where it has one there.
    pdi_bit: u32,
    ecat_bit: u16,
    start: usize,
    length: usize,
    /// Where its window ends.
    window_end: usize,
    control: u8,
    active: bool,
    /// One message at a time instead of three buffers.
    is_mailbox: bool,
    /// Where the last of its buffers ends.
    end: usize,
    writer: Side,
    /// Mailbox mode: a message waits to be read.
    full: bool,
    /// Buffered mode: the buffer written last; none was since activation where `None`.
    latest: Option<u8>,
    /// Buffer that is being written.
    writing: Option<u8>,
    /// Buffer that is being read.
    reading: Option<u8>,
    written_event: bool,
    read_event: bool,
}

impl SyncManager {
    /// SyncManager `n`, switched off.
    pub fn new(n: u8) -> Self {
        let ecat_bit = if n < 8 { 1 << (4 + n) } else { 0 };
        SyncManager { pdi_bit: al_event::sync_manager(n), ecat_bit, ..SyncManager::default() }
    }

    /// Takes over the registers; an activation starts with empty buffers.
    pub fn configure(&mut self, registers: &[u8]) {
        let (enabled, deactivated) = (registers[6] & 1 != 0, registers[7] & 1 != 0);
        let start = usize::from(u16::from_le_bytes([registers[0], registers[1]]));
        let length = usize::from(u16::from_le_bytes([registers[2], registers[3]]));
        let control = registers[4];
        let active = enabled && !deactivated && length > 0;
        if active == self.active && start == self.start && length == self.length && control == self.control {
            return;
        }
        let is_mailbox = control & 3 == 2;
        // Digital outputs are registers: there is one of each, as in a mailbox.
        let buffers = if is_mailbox || start < REGISTERS { 1 } else { 3 };
        *self = SyncManager {
            pdi_bit: self.pdi_bit,
            ecat_bit: self.ecat_bit,
            start,
            length,
            control,
            active,
            is_mailbox,
            window_end: start + length,
            end: start + buffers * length,
            writer: if control >> 2 & 3 == 1 { Side::Ecat } else { Side::Pdi },
            ..SyncManager::default()
        };
    }

    /// Whether it guards its area now.
    pub fn active(&self) -> bool {
        self.active
    }

    /// The addresses through which its area is accessed.
    pub fn window(&self) -> Range<usize> {
        self.start..self.window_end
    }

    /// All memory that it occupies: three buffers in buffered mode.
    pub fn occupied(&self) -> Range<usize> {
        self.start..self.end
    }

    /// Whether it guards `address`, in any of its buffers.
    pub fn guards(&self, address: usize) -> bool {
        self.active && self.start <= address && address < self.end
    }

    /// The side that writes.
    pub fn writer(&self) -> Side {
        self.writer
    }

    /// Whether completed writes trigger the process-data watchdog.
    pub fn triggers_watchdog(&self) -> bool {
        self.control & CONTROL_WATCHDOG != 0 && self.writer == Side::Ecat
    }

    /// The status register (offset 5).
    pub fn status(&self) -> u8 {
        let mut status = 0;
        if self.written_event {
            status |= STATUS_WRITE_EVENT;
        }
        if self.read_event {
            status |= STATUS_READ_EVENT;
        }
        if self.full {
            status |= STATUS_FULL;
        }
        status |= if self.active && !self.is_mailbox { self.latest.unwrap_or(3) << 4 } else { 0x30 };
        if self.reading.is_some() {
            status |= 1 << 6;
        }
        if self.writing.is_some() {
            status |= 1 << 7;
        }
        status
    }

    /// Its bit among AL events, and whether it is set: the firmware's side of the buffer changed hands.
    #[inline]
    pub fn pdi_event(&self) -> (u32, bool) {
        let event = if self.writer == Side::Ecat { self.written_event } else { self.read_event };
        (self.pdi_bit, event && self.control & CONTROL_PDI_EVENT != 0)
    }

    /// Its bit among ECAT events, and whether it is set: the MainDevice has something to do.
    #[inline]
    pub fn ecat_event(&self) -> (u16, bool) {
        let event = if self.writer == Side::Ecat { self.read_event } else { self.written_event };
        (self.ecat_bit, event && self.control & CONTROL_ECAT_EVENT != 0)
    }

    /// Writes `data` at `address`, inside the window.
    pub fn write(&mut self, side: Side, address: usize, data: &[u8], memory: &mut [u8]) -> Access {
        if side != self.writer || (self.is_mailbox && self.full) || self.end > memory.len() {
            return Access::Denied;
        }
        let opened = address == self.start;
        if opened {
            self.writing = Some(if self.end == self.window_end { 0 } else { self.free_buffer() });
            self.read_event = false;
        }
        let Some(buffer) = self.writing else { return Access::Denied };
        let at = address + usize::from(buffer) * self.length;
        memory[at..at + data.len()].copy_from_slice(data);
        if address + data.len() == self.window_end {
            self.writing = None;
            self.written_event = true;
            self.full = self.is_mailbox;
            self.latest = Some(buffer);
            return Access::Completed;
        }
        if opened { Access::Opened } else { Access::Partial }
    }

    /// Reads at `address`, inside the window, into `data`.
    pub fn read(&mut self, side: Side, address: usize, data: &mut [u8], memory: &[u8]) -> Access {
        if side == self.writer || self.end > memory.len() || (self.is_mailbox && !self.full) {
            return Access::Denied;
        }
        let opened = address == self.start;
        if opened {
            self.reading = self.latest;
            if self.latest.is_some() {
                self.written_event = false;
            }
        }
        let Some(buffer) = self.reading else { return Access::Denied };
        let at = address + usize::from(buffer) * self.length;
        data.copy_from_slice(&memory[at..at + data.len()]);
        if address + data.len() == self.window_end {
            self.reading = None;
            self.read_event = true;
            self.full = false;
            return Access::Completed;
        }
        if opened { Access::Opened } else { Access::Partial }
    }

    /// The bytes at `address` as the writer left them last, for writes of single bits.
    pub fn latest(&self, address: usize, data: &mut [u8], memory: &[u8]) {
        let buffer = usize::from(self.writing.or(self.latest).unwrap_or(0));
        let at = address + buffer * self.length;
        if at + data.len() <= memory.len() {
            data.copy_from_slice(&memory[at..at + data.len()]);
        }
    }

    /// A buffer that neither holds the newest data nor is being read.
    fn free_buffer(&self) -> u8 {
        (0..3).find(|&buffer| Some(buffer) != self.latest && Some(buffer) != self.reading).unwrap_or(0)
    }
}
