//! What one ESC does with one datagram.

use super::sync_manager::Side;
use super::{Esc, Fmmu};
use core::ops::Range;
use omnibase_ethercat_wire::Command;
use omnibase_ethercat_wire::frame::MAX_DATA;
use omnibase_ethercat_wire::register as reg;

/// A datagram on its way through the segment, taken apart once.
#[derive(Debug)]
pub struct Telegram<'a> {
    /// What it asks.
    pub command: Command,
    /// Low address word: position, station, or low half of the logical address.
    pub adp: u16,
    /// High address word: register, or high half of the logical address.
    pub ado: u16,
    /// External event request.
    pub event: u16,
    /// Working counter.
    pub counter: u16,
    /// Its data.
    pub data: &'a mut [u8],
}

impl Telegram<'_> {
    fn logical(&self) -> u32 {
        u32::from(self.adp) | u32::from(self.ado) << 16
    }

    fn count(&mut self, by: u16) {
        self.counter = self.counter.wrapping_add(by);
    }
}

impl Esc {
    /// Processes a datagram that arrived at host time `now`.
    pub(crate) fn process(&mut self, telegram: &mut Telegram<'_>, now: u64) {
        use Command::*;
        telegram.event |= self.irq;
        match telegram.command {
            Nop => {}
            Aprd | Apwr | Aprw | Armw => {
                if telegram.command == Aprw && self.refuses_read_write() {
                    return;
                }
                let addressed = telegram.adp == 0;
                telegram.adp = telegram.adp.wrapping_add(1);
                self.physical(telegram, addressed, now);
            }
            Fprd | Fpwr | Fprw | Frmw => {
                let addressed = telegram.adp == self.station || self.alias == Some(telegram.adp);
                if (addressed && !(telegram.command == Fprw && self.refuses_read_write()))
                    || telegram.command == Frmw
                {
                    self.physical(telegram, addressed, now);
                }
            }
            Brd | Bwr | Brw => {
                if telegram.command == Brw && self.refuses_read_write() {
                    return;
                }
                telegram.adp = telegram.adp.wrapping_add(1);
                self.broadcast(telegram, now);
            }
            Lrd | Lwr | Lrw => self.logical(telegram, now),
        }
    }

    fn refuses_read_write(&self) -> bool {
        self.config.has(reg::FEATURE_NO_READ_WRITE)
    }

    fn physical(&mut self, telegram: &mut Telegram<'_>, addressed: bool, now: u64) {
        use Command::*;
        let ado = telegram.ado;
        match (telegram.command, addressed) {
            (Aprd | Fprd | Armw | Frmw, true) => {
                let read = self.read_bytes(Side::Ecat, ado, telegram.data, now);
                telegram.count(u16::from(read));
            }
            (Apwr | Fpwr, true) | (Armw | Frmw, false) => {
                let written = self.write_bytes(Side::Ecat, ado, telegram.data, now);
                telegram.count(u16::from(written));
            }
            (Aprw | Fprw, true) => {
                let mut old = [0; MAX_DATA];
                let old = &mut old[..telegram.data.len()];
                old.copy_from_slice(telegram.data);
                let read = self.read_bytes(Side::Ecat, ado, old, now);
                let written = self.write_bytes(Side::Ecat, ado, telegram.data, now);
                telegram.data.copy_from_slice(old);
                telegram.count(u16::from(read) + 2 * u16::from(written));
            }
            _ => {}
        }
    }

    fn broadcast(&mut self, telegram: &mut Telegram<'_>, now: u64) {
        if telegram.command == Command::Bwr {
            let written = self.write_bytes(Side::Ecat, telegram.ado, telegram.data, now);
            telegram.count(u16::from(written));
            return;
        }
        // Most broadcasts are short: clearing a large buffer would cost more than the read.
        let (mut short, mut long);
        let own: &mut [u8] = if telegram.data.len() <= 16 {
            short = [0; 16];
            &mut short[..telegram.data.len()]
        } else {
            long = [0; MAX_DATA];
            &mut long[..telegram.data.len()]
        };
        let read = self.read_bytes(Side::Ecat, telegram.ado, own, now);
        let mut written = false;
        if telegram.command == Command::Brw {
            written = self.write_bytes(Side::Ecat, telegram.ado, telegram.data, now);
        }
        if read {
            for (data, own) in telegram.data.iter_mut().zip(own) {
                *data |= *own;
            }
        }
        telegram.count(u16::from(read) + 2 * u16::from(written));
    }

    fn logical(&mut self, telegram: &mut Telegram<'_>, now: u64) {
        let (logical, length) = (telegram.logical(), telegram.data.len());
        let start = u64::from(logical);
        if self.logical.start >= start + length as u64 || start >= self.logical.end {
            return;
        }
        if telegram.command == Command::Lrw && self.config.has(reg::FEATURE_NO_LRW) {
            return;
        }
        let count = match telegram.command {
            Command::Lwr => u16::from(self.each_part(
                logical,
                length,
                |fmmu| fmmu.writes,
                |esc, part| esc.write_mapped(part, telegram.data, now),
            )),
            Command::Lrd => u16::from(self.each_part(
                logical,
                length,
                |fmmu| fmmu.reads,
                |esc, part| esc.read_mapped(part, telegram.data, now),
            )),
            _ => self.read_and_write(logical, telegram.data, now),
        };
        telegram.count(count);
    }

    /// Goes through what FMMUs of a kind map of a datagram; whether any access did something.
    fn each_part(
        &mut self,
        logical: u32,
        length: usize,
        maps: impl Fn(&Fmmu) -> bool,
        mut access: impl FnMut(&mut Self, &Part) -> bool,
    ) -> bool {
        let mut any = false;
        for n in 0..self.fmmus.len() {
            let fmmu = self.fmmus[n];
            if maps(&fmmu)
                && let Some(bytes) = fmmu.overlap(logical, length)
            {
                any |= access(self, &Part { fmmu, logical, bytes });
            }
        }
        any
    }

    /// LRW; by how much it counts.
    fn read_and_write(&mut self, logical: u32, data: &mut [u8], now: u64) -> u16 {
        let (mut read, mut written) = (false, false);
        // Writes first: where outputs and inputs overlap in the image, outputs are what the MainDevice sent.
        for writes in [true, false] {
            for n in 0..self.fmmus.len() {
                let fmmu = self.fmmus[n];
                if fmmu.writes != writes {
                    continue;
                }
                let Some(bytes) = fmmu.overlap(logical, data.len()) else { continue };
                let part = Part { fmmu, logical, bytes };
                match (fmmu.reads, writes) {
                    (true, true) => {
                        let (r, w) = self.exchange_mapped(&part, data, now);
                        (read, written) = (read | r, written | w);
                    }
                    (false, true) => written |= self.write_mapped(&part, data, now),
                    (true, false) => read |= self.read_mapped(&part, data, now),
                    (false, false) => {}
                }
            }
        }
        u16::from(read) + 2 * u16::from(written)
    }

    /// The memory bytes behind `part`, where whole bytes are mapped; `None` past the end of memory.
    fn bytes_behind(part: &Part) -> Option<u16> {
        let first = u64::from(part.logical) + part.bytes.start as u64 - u64::from(part.fmmu.logical);
        u16::try_from(u64::from(part.fmmu.physical) + first).ok()
    }

    fn read_mapped(&mut self, part: &Part, data: &mut [u8], now: u64) -> bool {
        if part.fmmu.bytewise() {
            let Some(address) = Self::bytes_behind(part) else { return false };
            return self.read_bytes(Side::Ecat, address, &mut data[part.bytes.clone()], now);
        }
        let mut buffer = [0; MAX_DATA + 2];
        let Some(bits) = part.bits(&mut buffer) else { return false };
        if !self.read_bytes(Side::Ecat, bits.address, bits.memory, now) {
            return false;
        }
        for (logical, physical) in bits.pairs {
            set_bit(data, logical, bit(bits.memory, physical));
        }
        true
    }

    fn write_mapped(&mut self, part: &Part, data: &[u8], now: u64) -> bool {
        if part.fmmu.bytewise() {
            let Some(address) = Self::bytes_behind(part) else { return false };
            return self.write_bytes(Side::Ecat, address, &data[part.bytes.clone()], now);
        }
        let mut buffer = [0; MAX_DATA + 2];
        let Some(bits) = part.bits(&mut buffer) else { return false };
        // Neighbour bits keep what they hold.
        self.latest_bytes(bits.address, bits.memory);
        for (logical, physical) in bits.pairs {
            set_bit(bits.memory, physical, bit(data, logical));
        }
        self.write_bytes(Side::Ecat, bits.address, bits.memory, now)
    }

    fn exchange_mapped(&mut self, part: &Part, data: &mut [u8], now: u64) -> (bool, bool) {
        let mut old = [0; MAX_DATA];
        let old = &mut old[..data.len()];
        old.copy_from_slice(data);
        let read = self.read_mapped(part, old, now);
        let written = self.write_mapped(part, data, now);
        data.copy_from_slice(old);
        (read, written)
    }
}

/// The part of a datagram that one FMMU maps.
struct Part {
    fmmu: Fmmu,
    logical: u32,
    bytes: Range<usize>,
}

/// Bits of a datagram and the memory bytes in which they lie.
struct Bits<'a, P> {
    address: u16,
    memory: &'a mut [u8],
    /// Bit index in the datagram's data, bit index in `memory`.
    pairs: P,
}

impl Part {
    fn bits<'a>(
        &self,
        buffer: &'a mut [u8; MAX_DATA + 2],
    ) -> Option<Bits<'a, impl Iterator<Item = (usize, usize)> + use<>>> {
        let mapped = self.fmmu.bits_in(self.logical, &self.bytes);
        if mapped.is_empty() {
            return None;
        }
        let first = mapped.start + usize::from(self.fmmu.physical_bit);
        let last = mapped.end - 1 + usize::from(self.fmmu.physical_bit);
        let address = u16::try_from(usize::from(self.fmmu.physical) + first / 8).ok()?;
        let memory = &mut buffer[..last / 8 + 1 - first / 8];
        // Bit index of the FMMU's first bit, seen from the datagram's first: negative where it lies before.
        let origin =
            (i64::from(self.fmmu.logical) - i64::from(self.logical)) * 8 + i64::from(self.fmmu.start_bit);
        let base = first / 8 * 8;
        let physical_bit = usize::from(self.fmmu.physical_bit);
        let pairs = mapped.map(move |n| ((origin + n as i64) as usize, n + physical_bit - base));
        Some(Bits { address, memory, pairs })
    }
}

fn bit(bytes: &[u8], index: usize) -> bool {
    bytes[index / 8] >> (index % 8) & 1 != 0
}

fn set_bit(bytes: &mut [u8], index: usize, on: bool) {
    let mask = 1 << (index % 8);
    if on {
        bytes[index / 8] |= mask;
    } else {
        bytes[index / 8] &= !mask;
    }
}
