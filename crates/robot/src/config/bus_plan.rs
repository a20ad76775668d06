//! The bus and its cycle, resolved, and who is where on it.

use std::fmt;

use omnibase_ethercat::config as bus_config;
use omnibase_ethercat::start_up::{ReadBack, SdoAccess};

use super::drive_tables::ParameterState;
use super::file::{ClockSource, Synchronisation};
use super::start_plan::DcPlan;

/// The bus and its cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusPlan {
    /// Period, ns.
    pub cycle_ns: u64,
    /// How long an answer is awaited, ns.
    pub receive_timeout_ns: u64,
    /// How the drives are synchronised.
    pub synchronisation: Synchronisation,
    /// Shift of SYNC0, ns.
    pub sync0_shift_ns: i32,
    /// Who sets the pace.
    pub clock_source: ClockSource,
    /// When drives stop by themselves.
    pub drive_watchdog: DriveWatchdog,
}

impl BusPlan {
    /// Where in the cycle frames pass, ns: half a cycle before the drives' SYNC0.
    pub(super) fn frame_ns(&self) -> i64 {
        i64::from(self.sync0_shift_ns) - self.cycle_ns as i64 / 2
    }

    /// The watchdog of whoever is written to.
    pub fn watchdogs(&self) -> bus_config::WatchdogConfig {
        bus_config::WatchdogConfig {
            divider: Some(DriveWatchdog::DIVIDER),
            process_data: Some(self.drive_watchdog.steps),
            pdi: None,
        }
    }

    /// By what a drive is synchronised; `None` where its clock has events that leave a choice to it.
    pub(super) fn sync_mode(&self, dc: Option<&DcPlan>) -> Option<bus_config::SyncMode> {
        match self.synchronisation {
            Synchronisation::FreeRun => Some(bus_config::SyncMode::FreeRun),
            Synchronisation::SyncManagerEvent => Some(bus_config::SyncMode::SyncManagerEvent),
            Synchronisation::Sync0 => dc.and_then(DcPlan::sync_mode),
        }
    }
}

/// The drives' process-data watchdog: when they stop by themselves because the program says nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveWatchdog {
    /// Steps of [`DriveWatchdog::STEP_US`], from 1.
    pub steps: u16,
}

impl DriveWatchdog {
    /// Register 0x0400: (2498 + 2) · 40 ns = 100 us, the standard's own value after power-on.
    pub const DIVIDER: u16 = 2498;
    /// What one step of register 0x0420 is then worth, us.
    pub const STEP_US: u32 = 100;

    /// A watchdog of so many us; `None` where no number of steps is as long.
    pub fn from_us(us: u32) -> Option<Self> {
        let steps = u16::try_from(us / Self::STEP_US).ok().filter(|steps| *steps > 0)?;
        us.is_multiple_of(Self::STEP_US).then_some(DriveWatchdog { steps })
    }

    /// Its time, us.
    pub fn us(self) -> u32 {
        u32::from(self.steps) * Self::STEP_US
    }
}

/// Where a SubDevice is on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusPlace {
    /// By position, from 0.
    Position(u16),
    /// By station alias.
    Alias(u16),
    /// By explicit device identification, the switch on the device.
    Identification(u16),
}

impl fmt::Display for BusPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&match self {
            BusPlace::Position(position) => format!("position {position}"),
            BusPlace::Alias(alias) => format!("alias {alias}"),
            BusPlace::Identification(number) => format!("identification {number}"),
        })
    }
}

/// Who must be there; what is `None` isn't compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// Vendor.
    pub vendor_id: Option<u32>,
    /// Product.
    pub product_code: Option<u32>,
    /// Revision.
    pub revision: Option<u32>,
}

/// One SDO to write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ParameterPlan {
    /// Object index.
    pub index: u16,
    /// Subindex.
    pub subindex: u8,
    /// The value, little endian, as long as its type.
    pub data: Vec<u8>,
    /// Whether one entry is written, or the whole object from this subindex.
    pub access: SdoAccess,
    /// Whether it is read back and compared.
    pub read_back: ReadBack,
    /// When it is written.
    pub state: ParameterState,
    /// Where it was asked, as `line 12`.
    pub origin: String,
}

impl ParameterPlan {
    /// One entry, written in PRE-OP, read back and compared.
    pub(crate) fn entry((index, subindex): (u16, u8), data: Vec<u8>, origin: String) -> Self {
        let (access, read_back) = (SdoAccess::Entry, ReadBack::Compare);
        ParameterPlan { index, subindex, data, access, read_back, state: ParameterState::PreOp, origin }
    }
}
