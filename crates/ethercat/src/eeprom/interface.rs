//! How long an EEPROM's interface may keep its reader or writer waiting, and what ends its patience.

use core::time::Duration;

use super::EepromFailure;
use crate::found::Found;
use crate::wire::HostTime;

const BUSY: u16 = 1 << 15;
const WRITE_ENABLE_ERROR: u16 = 1 << 14;
const NOT_ACKNOWLEDGED: u16 = 1 << 13;

/// The longest time that one order may keep the interface busy.
const BUSY_LIMIT: Duration = Duration::from_secs(1);
/// Pause before a busy interface is asked again.
const BUSY_PAUSE: Duration = Duration::from_micros(100);
/// Pause after the EEPROM did not acknowledge.
const NACK_PAUSE: Duration = Duration::from_millis(1);
/// Orders in a row that the EEPROM may leave unacknowledged.
const NACK_LIMIT: u32 = 50;
/// Datagrams in a row that may be lost or have a wrong working counter.
const FAILURE_LIMIT: u32 = 4;

/// What keeps an interface's user waiting, and how often it has failed in a row.
#[derive(Debug, Default)]
pub(super) struct Interface {
    wait_until: Option<HostTime>,
    busy_since: Option<HostTime>,
    failures: u32,
    nacks: u32,
}

impl Interface {
    /// The instant before which nothing is to be sent.
    pub(super) fn pause(&mut self, now: HostTime) -> Option<HostTime> {
        self.wait_until = self.wait_until.filter(|instant| now < *instant);
        self.wait_until
    }

    /// Waits a little before the next order.
    pub(super) fn wait(&mut self, now: HostTime) {
        self.wait_until = Some(now + NACK_PAUSE);
    }

    /// Counts a datagram that `found` says wasn't answered.
    pub(super) fn lost(&mut self, found: Found, now: HostTime) -> Result<(), EepromFailure> {
        self.wait(now);
        self.failures += 1;
        if self.failures < FAILURE_LIMIT { Ok(()) } else { Err(EepromFailure::NoAnswer(found)) }
    }

    /// A datagram was answered.
    pub(super) fn answered(&mut self) {
        self.failures = 0;
    }

    /// Whether register 0x0502 says that the interface still works.
    pub(super) fn is_busy(&mut self, status: u16, now: HostTime) -> Result<bool, EepromFailure> {
        if status & BUSY == 0 {
            self.busy_since = None;
            return Ok(false);
        }
        self.wait_until = Some(now + BUSY_PAUSE);
        let since = *self.busy_since.get_or_insert(now);
        if now - since < BUSY_LIMIT { Ok(true) } else { Err(EepromFailure::Busy(BUSY_LIMIT)) }
    }

    /// Whether the EEPROM took the order for `word`: it acknowledged, and `address` is that word's.
    pub(super) fn is_acknowledged(
        &mut self,
        status: u16,
        address: u32,
        word: u32,
        now: HostTime,
    ) -> Result<bool, EepromFailure> {
        if status & (NOT_ACKNOWLEDGED | WRITE_ENABLE_ERROR) == 0 && address == word {
            self.nacks = 0;
            return Ok(true);
        }
        self.wait(now);
        self.nacks += 1;
        if self.nacks < NACK_LIMIT { Ok(false) } else { Err(EepromFailure::NotAcknowledged { status }) }
    }
}
