//! Register reads and writes with their effects.

use super::access::{ECAT_READ, ECAT_WRITE, PDI_READ, PDI_WRITE};
use super::fmmu::Fmmu;
use super::sync_manager::Side;
use super::{ECAT_EVENT_AL_STATUS, ECAT_EVENT_DL_STATUS, Esc};
use core::ops::Range;
use omnibase_ethercat_wire::bytes::{put_u16, put_u32, u16_at, u32_at};
use omnibase_ethercat_wire::register::{self as reg, al_event};

/// Registers that act together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Block {
    /// Hold a value, or aren't there.
    Plain,
    Station,
    DlControl,
    DlStatus,
    AlControl,
    AlStatus,
    EventMasks,
    Events,
    Errors,
    Watchdog,
    Sii,
    Fmmus,
    SyncManagers,
    Dc,
}

/// Where each block begins; it ends where the next one begins.
const BLOCKS: [(usize, Block); 27] = [
    (0x0000, Block::Plain),
    (0x0010, Block::Station),
    (0x0014, Block::Plain),
    (0x0100, Block::DlControl),
    (0x0104, Block::Plain),
    (0x0110, Block::DlStatus),
    (0x0112, Block::Plain),
    (0x0120, Block::AlControl),
    (0x0122, Block::Plain),
    (0x0130, Block::AlStatus),
    (0x0132, Block::Plain),
    (0x0200, Block::EventMasks),
    (0x0208, Block::Plain),
    (0x0210, Block::Events),
    (0x0224, Block::Plain),
    (0x0300, Block::Errors),
    (0x0314, Block::Plain),
    (0x0400, Block::Watchdog),
    (0x0444, Block::Plain),
    (0x0500, Block::Sii),
    (0x0510, Block::Plain),
    (0x0600, Block::Fmmus),
    (0x0700, Block::Plain),
    (0x0800, Block::SyncManagers),
    (0x0880, Block::Plain),
    (0x0900, Block::Dc),
    (0x09B0, Block::Plain),
];

/// Which block each pair of registers belongs to.
const NUMBERS: [u8; super::REGISTERS / 2] = {
    let (mut numbers, mut at, mut number) = ([0; super::REGISTERS / 2], 0, 0);
    while at < numbers.len() {
        if number + 1 < BLOCKS.len() && BLOCKS[number + 1].0 <= 2 * at {
            number += 1;
        }
        numbers[at] = number as u8;
        at += 1;
    }
    numbers
};

impl Block {
    /// The block at `address`, and where it ends.
    fn at(address: usize) -> (Block, usize) {
        let number = usize::from(NUMBERS[address / 2]);
        let end = BLOCKS.get(number + 1).map_or(super::REGISTERS, |(start, _)| *start);
        (BLOCKS[number].1, end)
    }
}

fn touches(range: &Range<usize>, register: u16, length: usize) -> bool {
    let first = usize::from(register);
    range.start < first + length && range.end > first
}

impl Esc {
    pub(super) fn read_registers(&mut self, side: Side, start: usize, data: &mut [u8], now: u64) -> bool {
        let end = start + data.len();
        let (mut at, mut read) = (start, false);
        while at < end {
            let (block, block_end) = Block::at(at);
            let range = at..end.min(block_end);
            self.refresh(block, &range, now);
            let allowed = if side == Side::Ecat { ECAT_READ } else { PDI_READ };
            let part = &mut data[range.start - start..range.end - start];
            let mut any = false;
            for ((byte, cell), permissions) in
                part.iter_mut().zip(&self.memory[range.clone()]).zip(self.access.range(range.clone()))
            {
                let there = permissions & allowed != 0;
                *byte = if there { *cell } else { 0 };
                any |= there;
            }
            if any {
                self.after_read(side, block, &range);
            }
            read |= any;
            at = range.end;
        }
        read
    }

    /// Brings registers that aren't stored as bytes up to date.
    fn refresh(&mut self, block: Block, range: &Range<usize>, now: u64) {
        match block {
            Block::Events => {
                put_u16(&mut self.memory, usize::from(reg::ECAT_EVENT), self.ecat_event);
                put_u32(&mut self.memory, usize::from(reg::AL_EVENT), self.al_event);
            }
            Block::Sii => self.refresh_sii(now),
            Block::Dc => self.refresh_dc(range.start, range.end, now),
            Block::SyncManagers => {
                for (n, manager) in self.sync_managers.iter().enumerate() {
                    self.memory[usize::from(reg::SM) + 8 * n + 5] = manager.status();
                }
            }
            _ => {}
        }
    }

    fn refresh_sii(&mut self, now: u64) {
        if let Some(area) = self.sii.settle(now) {
            self.take_configuration(&area);
        }
        self.sii.registers(&mut self.memory[usize::from(reg::SII_CONFIG)..][..16]);
    }

    fn after_read(&mut self, side: Side, block: Block, range: &Range<usize>) {
        match (side, block) {
            (Side::Ecat, Block::DlStatus) => self.set_ecat_event(ECAT_EVENT_DL_STATUS, false),
            (Side::Ecat, Block::AlStatus) => self.set_ecat_event(ECAT_EVENT_AL_STATUS, false),
            (Side::Pdi, Block::AlControl) => self.al_event &= !al_event::AL_CONTROL,
            (Side::Pdi, Block::SyncManagers) if range.clone().any(|at| at % 8 == 6) => {
                self.al_event &= !al_event::SM_CHANGED;
            }
            (Side::Pdi, Block::Watchdog) if touches(range, reg::WATCHDOG_STATUS, 2) => {
                self.al_event &= !al_event::WATCHDOG;
            }
            (Side::Pdi, Block::Dc) => {
                for (register, event) in
                    [(reg::DC_SYNC0_STATUS, al_event::SYNC0), (reg::DC_SYNC1_STATUS, al_event::SYNC1)]
                {
                    if touches(range, register, 1) {
                        self.al_event &= !event;
                        self.memory[usize::from(register)] = 0;
                    }
                }
            }
            _ => {}
        }
    }

    pub(super) fn write_registers(&mut self, side: Side, start: usize, data: &[u8], now: u64) -> bool {
        let end = start + data.len();
        let (mut at, mut written) = (start, false);
        while at < end {
            let (block, block_end) = Block::at(at);
            let range = at..end.min(block_end);
            let part = &data[range.start - start..range.end - start];
            written |= self.write_block(side, block, range.clone(), part, now);
            at = range.end;
        }
        written
    }

    /// Stores the bytes that `side` may write and that aren't `locked`; whether any was.
    pub(super) fn store(
        &mut self,
        side: Side,
        start: usize,
        data: &[u8],
        locked: impl Fn(usize) -> bool,
    ) -> bool {
        let allowed = if side == Side::Ecat { ECAT_WRITE } else { PDI_WRITE };
        let range = start..start + data.len();
        let mut stored = false;
        let cells = self.memory[range.clone()].iter_mut().zip(self.access.range(range));
        for (n, ((cell, permissions), byte)) in cells.zip(data).enumerate() {
            if permissions & allowed != 0 && !locked(start + n) {
                *cell = *byte;
                stored = true;
            }
        }
        stored
    }

    fn write_block(&mut self, side: Side, block: Block, range: Range<usize>, data: &[u8], now: u64) -> bool {
        match block {
            Block::Fmmus | Block::Plain | Block::DlStatus | Block::Events => {
                let stored = self.store(side, range.start, data, |_| false);
                if stored && block == Block::Fmmus {
                    self.take_fmmus();
                }
                stored
            }
            Block::Station => {
                let stored = self.store(side, range.start, data, |_| false);
                self.station = u16_at(&self.memory, usize::from(reg::STATION_ADDRESS));
                self.take_alias();
                stored
            }
            Block::DlControl => self.write_dl_control(side, range, data),
            Block::AlControl => self.write_al_control(side, range, data),
            Block::AlStatus => {
                let stored = self.store(side, range.start, data, |_| false);
                if stored {
                    self.set_ecat_event(ECAT_EVENT_AL_STATUS, true);
                }
                stored
            }
            Block::EventMasks => {
                let stored = self.store(side, range.start, data, |_| false);
                self.mask_ecat_events();
                self.al_event_mask = u32_at(&self.memory, usize::from(reg::AL_EVENT_MASK));
                // Opening the mask for an event that waits already is as good as the event.
                self.raised |= stored && side == Side::Pdi && self.al_event & self.al_event_mask != 0;
                stored
            }
            Block::Errors => self.write_errors(side, range, data),
            Block::Watchdog => self.write_watchdog(side, range, data),
            Block::Sii => self.write_sii(side, range, data, now),
            Block::SyncManagers => self.write_sync_managers(side, range, data),
            Block::Dc => self.write_dc_block(side, range, data, now),
        }
    }

    fn write_dc_block(&mut self, side: Side, range: Range<usize>, data: &[u8], now: u64) -> bool {
        // The cyclic unit belongs to one side: 0x0980 bit 0.
        let cyclic = usize::from(reg::DC_ACTIVATION);
        let owner =
            if self.memory[usize::from(reg::DC_CYCLIC_CONTROL)] & 1 != 0 { Side::Pdi } else { Side::Ecat };
        if owner == side || range.end <= cyclic {
            return self.write_dc(range.start, data, side, now);
        }
        let common = cyclic.saturating_sub(range.start).min(data.len());
        common > 0 && self.write_dc(range.start, &data[..common], side, now)
    }

    fn take_alias(&mut self) {
        let enabled = self.memory[usize::from(reg::DL_CONTROL_ALIAS)] & 1 != 0;
        self.alias = enabled.then(|| u16_at(&self.memory, usize::from(reg::STATION_ALIAS)));
    }

    fn write_dl_control(&mut self, side: Side, range: Range<usize>, data: &[u8]) -> bool {
        let stored = self.store(side, range.start, data, |_| false);
        if stored {
            self.take_alias();
            if touches(&range, reg::DL_CONTROL_PORTS, 1) {
                for port in 0..4 {
                    self.kept_closed[port] &= !self.ports[port].link;
                }
                self.loops_changed = true;
            }
        }
        stored
    }

    fn write_al_control(&mut self, side: Side, range: Range<usize>, data: &[u8]) -> bool {
        // A request that the firmware hasn't read yet can't be overwritten.
        if self.al_event & al_event::AL_CONTROL != 0 && !self.device_emulation {
            return false;
        }
        let stored = self.store(side, range.start, data, |_| false);
        if stored && self.device_emulation {
            let control = u16_at(&self.memory, usize::from(reg::AL_CONTROL));
            put_u16(&mut self.memory, usize::from(reg::AL_STATUS), control & 0x1F);
            self.set_ecat_event(ECAT_EVENT_AL_STATUS, true);
        }
        if stored {
            self.raise(al_event::AL_CONTROL);
        }
        stored
    }

    fn write_errors(&mut self, side: Side, range: Range<usize>, _data: &[u8]) -> bool {
        if side == Side::Pdi {
            return false;
        }
        // Writing one counter of a group clears the group, whatever is written.
        let mut written = false;
        for (register, length) in [
            (reg::RX_ERROR_COUNTERS, 12),
            (reg::PROCESSING_ERROR_COUNTER, 1),
            (reg::PDI_ERROR_COUNTER, 1),
            (reg::LOST_LINK_COUNTERS, 4),
        ] {
            if touches(&range, register, length) {
                self.memory[usize::from(register)..][..length].fill(0);
                written = true;
            }
        }
        written
    }

    fn write_watchdog(&mut self, side: Side, range: Range<usize>, data: &[u8]) -> bool {
        let stored = self.store(side, range.start, data, |_| false);
        if stored {
            if touches(&range, reg::WATCHDOG_COUNTER, 2) {
                put_u16(&mut self.memory, usize::from(reg::WATCHDOG_COUNTER), 0);
            }
            let divider = u16_at(&self.memory, usize::from(reg::WATCHDOG_DIVIDER));
            let time = |register| u16_at(&self.memory, usize::from(register));
            self.watchdog.configure(divider, time(reg::WATCHDOG_PROCESS_DATA));
            self.pdi_watchdog.configure(divider, time(reg::WATCHDOG_PDI));
            self.show_watchdog();
            self.show_pdi_watchdog();
        }
        stored
    }

    fn write_sii(&mut self, side: Side, range: Range<usize>, data: &[u8], now: u64) -> bool {
        self.refresh_sii(now);
        let byte = |register: u16| {
            usize::from(register).checked_sub(range.start).and_then(|index| data.get(index)).copied()
        };
        let mut written = false;
        if let (Some(value), Side::Ecat) = (byte(reg::SII_CONFIG), side) {
            self.sii.write_config(value);
            written = true;
        }
        if let (Some(value), Side::Pdi) = (byte(reg::SII_PDI_ACCESS), side) {
            written |= self.sii.write_pdi_access(value);
        }
        let control = usize::from(reg::SII_CONTROL);
        if range.end > control && self.sii.writable(side) {
            written = true;
            let address = usize::from(reg::SII_ADDRESS);
            for at in range.start.max(address)..range.end.min(address + 4) {
                self.memory[at] = data[at - range.start];
            }
            let value = usize::from(reg::SII_DATA);
            if range.end > value {
                let from = range.start.max(value);
                self.sii.write_data(from - value, &data[from - range.start..]);
            }
            if let Some(high) = byte(reg::SII_CONTROL + 1) {
                let low = byte(reg::SII_CONTROL).unwrap_or(0);
                let word = u32_at(&self.memory, address);
                self.sii.command(side, u16::from_le_bytes([low, high]), word, now);
            }
        }
        written
    }

    fn take_fmmus(&mut self) {
        let length = usize::from(self.config.fmmu_count) * usize::from(reg::FMMU_SIZE);
        let registers = &self.memory[usize::from(reg::FMMU)..][..length];
        self.fmmus.clear();
        self.fmmus.extend(registers.chunks_exact(usize::from(reg::FMMU_SIZE)).filter_map(Fmmu::decode));
        let start = self.fmmus.iter().map(|fmmu| u64::from(fmmu.logical)).min().unwrap_or(0);
        let end = self.fmmus.iter().map(|fmmu| u64::from(fmmu.logical) + u64::from(fmmu.length)).max();
        self.logical = start..end.unwrap_or(0);
    }

    fn write_sync_managers(&mut self, side: Side, range: Range<usize>, data: &[u8]) -> bool {
        let first = usize::from(reg::SM);
        let mut stored = false;
        for n in (range.start - first) / 8..self.sync_managers.len().min((range.end - first).div_ceil(8)) {
            let base = first + 8 * n;
            let from = range.start.max(base);
            let to = range.end.min(base + 8);
            let before = self.memory[base + 6];
            // Address, length and control can't be changed while it is enabled.
            let locked = |at: usize| at - base < 6 && before & 1 != 0;
            let own = self.store(side, from, &data[from - range.start..to - range.start], locked);
            if !own {
                continue;
            }
            stored = true;
            self.sync_managers[n].configure(&self.memory[base..base + 8]);
            self.show_sync_manager(n);
            if side == Side::Ecat && to > base + 6 && self.memory[base + 6] != before {
                self.raise(al_event::SM_CHANGED);
            }
        }
        stored
    }
}
