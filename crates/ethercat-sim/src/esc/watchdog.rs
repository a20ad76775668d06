//! The watchdogs of process data (registers 0x0400, 0x0420, 0x0440, 0x0442) and of the firmware (0x0410, 0x0110, 0x0443).

use core::time::Duration;
use omnibase_ethercat_wire::HostTime;

/// Divider after power-on: (2498 + 2) · 40 ns = 100 us.
pub const DIVIDER_DEFAULT: u16 = 0x09C2;
/// Time of both watchdogs after power-on: 1000 · 100 us = 100 ms.
pub const TIME_DEFAULT: u16 = 0x03E8;

/// That the watchdog expired, and when, by the segment's time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WatchdogExpiry {
    /// When the last outputs came before it.
    pub last_outputs: HostTime,
    /// When it expired.
    pub expired: HostTime,
    /// The time to which it was set.
    pub set: Duration,
}

/// Counts down from what triggered it last: process data, or an access of the firmware.
#[derive(Clone, Debug)]
pub struct Watchdog {
    time_ns: u64,
    triggered_at: u64,
    expires_at: Option<u64>,
    expiry: Option<WatchdogExpiry>,
}

impl Default for Watchdog {
    fn default() -> Self {
        let mut watchdog = Watchdog { time_ns: 0, triggered_at: 0, expires_at: None, expiry: None };
        watchdog.configure(DIVIDER_DEFAULT, TIME_DEFAULT);
        watchdog
    }
}

impl Watchdog {
    /// Takes over the divider (units of 40 ns, plus 2) and the time (multiples of the divided clock; 0: off).
    pub fn configure(&mut self, divider: u16, time: u16) {
        self.time_ns = (u64::from(divider) + 2) * 40 * u64::from(time);
        if self.time_ns == 0 {
            self.expires_at = None;
        }
    }

    /// Whether it is switched on.
    pub fn enabled(&self) -> bool {
        self.time_ns > 0
    }

    /// What it waits for came.
    pub fn trigger(&mut self, now: u64) {
        self.triggered_at = now;
        if self.time_ns > 0 {
            self.expires_at = Some(now + self.time_ns);
        }
    }

    /// When it expires, if nothing comes.
    pub fn expires_at(&self) -> Option<u64> {
        self.expires_at
    }

    /// Whether it ran until now.
    pub fn running(&self) -> bool {
        self.expires_at.is_some()
    }

    /// Stops it after it expired.
    pub fn expire(&mut self) {
        if let Some(at) = self.expires_at.take() {
            self.expiry = Some(WatchdogExpiry {
                last_outputs: HostTime(self.triggered_at),
                expired: HostTime(at),
                set: Duration::from_nanos(self.time_ns),
            });
        }
    }

    /// The last time that it expired since power-on.
    pub fn expiry(&self) -> Option<WatchdogExpiry> {
        self.expiry
    }
}
