//! Process-data memory, and the SyncManagers that guard it.

use super::sync_manager::{Access, Side};
use super::{Esc, GUARDED, REGISTERS};

/// Who guards an address.
enum Guard {
    /// Nobody.
    Free,
    /// This SyncManager, by the addresses through which it is accessed.
    Window(usize),
    /// A SyncManager's second or third buffer.
    Hidden,
}

impl Esc {
    /// Reads registers and memory from `address` on; bytes that aren't there or denied stay as they are.
    /// Returns whether any byte was read.
    pub(super) fn read_bytes(&mut self, side: Side, address: u16, data: &mut [u8], now: u64) -> bool {
        let start = usize::from(address);
        if start >= GUARDED {
            return self.read_memory(side, start, data, now);
        }
        let split = data.len().min(GUARDED - start);
        let (registers, memory) = data.split_at_mut(split);
        let read = self.read_registers(side, start, registers, now);
        read | (!memory.is_empty() && self.read_memory(side, GUARDED, memory, now))
    }

    /// Writes registers and memory from `address` on; returns whether any byte was written.
    pub(super) fn write_bytes(&mut self, side: Side, address: u16, data: &[u8], now: u64) -> bool {
        let start = usize::from(address);
        if start >= GUARDED {
            return self.write_memory(side, start, data, now);
        }
        let (registers, memory) = data.split_at(data.len().min(GUARDED - start));
        let written = self.write_registers(side, start, registers, now);
        written | (!memory.is_empty() && self.write_memory(side, GUARDED, memory, now))
    }

    /// Who guards `at`, and up to where (at most `end`).
    fn guard(&self, at: usize, end: usize) -> (Guard, usize) {
        // Registers that no SyncManager guards have their own rules, memory behind them has none.
        let mut free_until = if at < REGISTERS { end.min(REGISTERS) } else { end };
        for (n, manager) in self.sync_managers.iter().enumerate() {
            if !manager.active() {
                continue;
            }
            let occupied = manager.occupied();
            if at < occupied.start {
                free_until = free_until.min(occupied.start);
            } else if at < occupied.end {
                // The first of the buffers is the window to all of them.
                let window = manager.window();
                return match at < window.end {
                    true => (Guard::Window(n), end.min(window.end)),
                    false => (Guard::Hidden, end.min(occupied.end)),
                };
            }
        }
        (Guard::Free, free_until)
    }

    /// The SyncManager through whose window alone such an access goes: that of all process data.
    fn window_around(&self, start: usize, length: usize) -> Option<usize> {
        let n = self.sync_managers.iter().position(|manager| manager.guards(start))?;
        (start + length <= self.sync_managers[n].window().end).then_some(n)
    }

    fn read_memory(&mut self, side: Side, start: usize, data: &mut [u8], now: u64) -> bool {
        match self.window_around(start, data.len()) {
            Some(n) => self.read_window(n, side, start, data),
            None => self.read_parts(side, start, data, now),
        }
    }

    fn write_memory(&mut self, side: Side, start: usize, data: &[u8], now: u64) -> bool {
        match self.window_around(start, data.len()) {
            Some(n) => self.write_window(n, side, start, data, now),
            None => self.write_parts(side, start, data, now),
        }
    }

    fn read_window(&mut self, n: usize, side: Side, at: usize, data: &mut [u8]) -> bool {
        let access = self.sync_managers[n].read(side, at, data, &self.memory);
        self.accessed(n, side, access)
    }

    fn write_window(&mut self, n: usize, side: Side, at: usize, data: &[u8], now: u64) -> bool {
        let access = self.sync_managers[n].write(side, at, data, &mut self.memory);
        if access == Access::Completed && self.sync_managers[n].triggers_watchdog() {
            self.watchdog.trigger(now);
            self.show_watchdog();
        }
        self.accessed(n, side, access)
    }

    fn read_parts(&mut self, side: Side, start: usize, data: &mut [u8], now: u64) -> bool {
        let end = (start + data.len()).min(self.memory.len());
        let (mut at, mut read) = (start, false);
        while at < end {
            let (guard, stop) = self.guard(at, end);
            let part = &mut data[at - start..stop - start];
            match guard {
                Guard::Free if at < REGISTERS => read |= self.read_registers(side, at, part, now),
                Guard::Free => {
                    part.copy_from_slice(&self.memory[at..stop]);
                    read = true;
                }
                Guard::Window(n) => read |= self.read_window(n, side, at, part),
                Guard::Hidden => {}
            }
            at = stop;
        }
        read
    }

    fn write_parts(&mut self, side: Side, start: usize, data: &[u8], now: u64) -> bool {
        let end = (start + data.len()).min(self.memory.len());
        let (mut at, mut written) = (start, false);
        while at < end {
            let (guard, stop) = self.guard(at, end);
            let part = &data[at - start..stop - start];
            match guard {
                Guard::Free if at < REGISTERS => written |= self.write_registers(side, at, part, now),
                Guard::Free => {
                    self.memory[at..stop].copy_from_slice(part);
                    written = true;
                }
                Guard::Window(n) => written |= self.write_window(n, side, at, part, now),
                Guard::Hidden => {}
            }
            at = stop;
        }
        written
    }

    /// Events and status after SyncManager `n` was accessed; whether bytes moved.
    fn accessed(&mut self, n: usize, side: Side, access: Access) -> bool {
        if access == Access::Denied {
            return false;
        }
        let (event, is_on) = self.show_sync_manager(n);
        if is_on && side == Side::Ecat && access == Access::Completed {
            self.raise(event);
        }
        true
    }

    /// What the writer left last at `address`, for writes of single bits.
    pub(super) fn latest_bytes(&self, address: u16, data: &mut [u8]) {
        let start = usize::from(address);
        let end = (start + data.len()).min(self.memory.len());
        let mut at = start;
        while at < end {
            let (guard, stop) = self.guard(at, end);
            let part = &mut data[at - start..stop - start];
            match guard {
                Guard::Free | Guard::Hidden => part.copy_from_slice(&self.memory[at..stop]),
                Guard::Window(n) => self.sync_managers[n].latest(at, part, &self.memory),
            }
            at = stop;
        }
    }
}
