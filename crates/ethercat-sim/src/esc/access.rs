//! Which side may read and write which register byte.

use super::{EscConfig, REGISTERS};
use omnibase_ethercat_wire::register as reg;

/// The MainDevice reads it.
pub const ECAT_READ: u8 = 1;
/// The MainDevice writes it.
pub const ECAT_WRITE: u8 = 2;
/// The firmware reads it.
pub const PDI_READ: u8 = 4;
/// The firmware writes it.
pub const PDI_WRITE: u8 = 8;
const READ: u8 = ECAT_READ | PDI_READ;

/// Permissions of each register byte of one chip; a byte without any isn't there.
#[derive(Debug)]
pub struct AccessMap(Vec<u8>);

impl AccessMap {
    /// The registers that a chip of this make has.
    pub fn new(config: &EscConfig) -> Self {
        let mut map = AccessMap(vec![0; REGISTERS]);
        let fmmus = u16::from(config.fmmu_count) * reg::FMMU_SIZE;
        let managers = u16::from(config.sm_count);
        for (first, length, permissions) in [
            (reg::TYPE, 10, READ),
            (reg::STATION_ADDRESS, 2, READ | ECAT_WRITE),
            (reg::STATION_ALIAS, 2, READ | PDI_WRITE),
            (reg::DL_CONTROL, 4, READ | ECAT_WRITE),
            (0x0108, 2, READ | ECAT_WRITE),
            (reg::DL_STATUS, 2, READ),
            (reg::AL_CONTROL, 2, READ | ECAT_WRITE),
            (reg::AL_STATUS, 2, READ | PDI_WRITE),
            (reg::AL_STATUS_CODE, 2, READ | PDI_WRITE),
            (0x0138, 2, READ | PDI_WRITE),
            (reg::PDI_CONTROL, 2, READ),
            (0x0150, 4, READ),
            (reg::ECAT_EVENT_MASK, 2, READ | ECAT_WRITE),
            (reg::AL_EVENT_MASK, 4, READ | PDI_WRITE),
            (reg::ECAT_EVENT, 2, READ),
            (reg::AL_EVENT, 4, READ),
            (reg::RX_ERROR_COUNTERS, 14, READ | ECAT_WRITE),
            (reg::LOST_LINK_COUNTERS, 4, READ | ECAT_WRITE),
            (reg::WATCHDOG_DIVIDER, 2, READ | ECAT_WRITE),
            (reg::WATCHDOG_PDI, 2, READ | ECAT_WRITE),
            (reg::WATCHDOG_PROCESS_DATA, 2, READ | ECAT_WRITE),
            (reg::WATCHDOG_STATUS, 2, READ),
            (reg::WATCHDOG_COUNTER, 2, READ | ECAT_WRITE),
            // Who may write the EEPROM interface changes with its owner: the unit itself decides.
            (reg::SII_CONFIG, 16, READ),
            (reg::FMMU, fmmus, READ | ECAT_WRITE),
            (0x0F00, 4, READ | ECAT_WRITE),
            (0x0F10, 8, READ | ECAT_WRITE),
            (0x0F18, 8, READ | PDI_WRITE),
            (0x0F80, 0x80, READ | ECAT_WRITE | PDI_WRITE),
        ] {
            map.set(first, length, permissions);
        }
        for n in 0..managers {
            let first = reg::SM + n * reg::SM_SIZE;
            map.set(first, 5, READ | ECAT_WRITE);
            map.set(first + 5, 1, READ);
            map.set(first + 6, 1, READ | ECAT_WRITE);
            map.set(first + 7, 1, READ | PDI_WRITE);
        }
        if config.has(reg::FEATURE_DC) {
            map.set(reg::DC_RECEIVE_TIMES, 16, READ | ECAT_WRITE);
        }
        if config.has_system_time() {
            map.distributed_clock();
        }
        map
    }

    fn distributed_clock(&mut self) {
        for (first, length, permissions) in [
            (reg::DC_SYSTEM_TIME, 8, READ | ECAT_WRITE),
            (reg::DC_RECEIVE_TIME_UNIT, 8, READ),
            (reg::DC_SYSTEM_TIME_OFFSET, 8, READ | ECAT_WRITE),
            (reg::DC_SYSTEM_TIME_DELAY, 4, READ | ECAT_WRITE),
            (reg::DC_SYSTEM_TIME_DIFFERENCE, 4, READ),
            (reg::DC_SPEED_COUNTER_START, 2, READ | ECAT_WRITE),
            (reg::DC_SPEED_COUNTER_DIFFERENCE, 2, READ),
            (reg::DC_FILTER_DEPTHS, 2, READ | ECAT_WRITE),
            (reg::DC_CYCLIC_CONTROL, 1, READ | ECAT_WRITE),
            (reg::DC_ACTIVATION, 1, READ | ECAT_WRITE | PDI_WRITE),
            (reg::DC_PULSE_LENGTH, 2, READ),
            (reg::DC_ACTIVATION_STATUS, 1, READ),
            (reg::DC_SYNC0_STATUS, 2, READ),
            (reg::DC_START_TIME, 8, READ | ECAT_WRITE | PDI_WRITE),
            (reg::DC_NEXT_SYNC1, 8, READ),
            (reg::DC_SYNC0_CYCLE, 8, READ | ECAT_WRITE | PDI_WRITE),
        ] {
            self.set(first, length, permissions);
        }
    }

    fn set(&mut self, first: u16, length: u16, permissions: u8) {
        self.0[usize::from(first)..usize::from(first + length)].fill(permissions);
    }

    /// Permissions of the bytes in `range`.
    pub fn range(&self, range: core::ops::Range<usize>) -> &[u8] {
        &self.0[range]
    }
}
