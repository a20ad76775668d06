//! What the user asks of each SubDevice; the default cycles any SubDevice as its SII describes it.

use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::num::NonZeroU16;
use core::time::Duration;

use crate::process_data::{Direction, MailboxConfig};
use crate::start_up::SdoWrite;
use crate::wire::AlState;
use crate::wire::coe::ObjectAddress;

/// Which SubDevice a configuration is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Match {
    /// The one at this position, from 0.
    Position(u16),
    /// The one with this alias.
    Alias(u16),
    /// The one with this explicit device identification.
    Identification(u16),
}

/// Who must be there. What is `None` isn't compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExpectedIdentity {
    /// Vendor.
    pub vendor_id: Option<u32>,
    /// Product code.
    pub product_code: Option<u32>,
    /// Revision.
    pub revision: Option<u32>,
    /// Serial number.
    pub serial: Option<u32>,
}

/// One PDO to be written, entry by entry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PdoConfig {
    /// 0x16xx (outputs) or 0x1Axx (inputs).
    pub index: u16,
    /// Objects and their lengths in bits, in order; index 0 is a gap. `None` keeps what the device has.
    pub entries: Option<Vec<(ObjectAddress, u8)>>,
}

/// What one SyncManager shall carry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SyncManagerPdos {
    /// Which SyncManager.
    pub sync_manager: u8,
    /// Its direction.
    pub direction: Direction,
    /// PDOs assigned to it, in order.
    pub pdos: Vec<PdoConfig>,
    /// Where it was asked, in the user's words; given back in errors.
    pub origin: Option<Arc<str>>,
}

/// Synchronisation by distributed clocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DcConfig {
    /// No SYNC events; the clock runs all the same.
    #[default]
    Off,
    /// SYNC0.
    Sync0 {
        /// Period, ns.
        cycle_ns: u32,
        /// Shift against multiples of the cycle, ns.
        shift_ns: i32,
    },
    /// SYNC0 and SYNC1.
    Sync0And1 {
        /// Period of SYNC0, ns.
        cycle_ns: u32,
        /// Shift of SYNC0 against multiples of SYNC1's period, ns.
        shift_ns: i32,
        /// Register 0x09A4: SYNC1 comes so long after a SYNC0, and is counted again from the next one behind it.
        sync1_cycle_ns: u32,
    },
}

impl DcConfig {
    /// The bits of AssignActivate, as ESI files call the word of the registers 0x0980 (low byte) and 0x0981, that turn SYNC0 on.
    pub const SYNC0: u16 = 0x0300;
    /// Its bit for SYNC1.
    pub const SYNC1: u16 = 0x0400;

    /// What turns its events on.
    pub fn assign_activate(self) -> u16 {
        match self {
            DcConfig::Off => 0,
            DcConfig::Sync0 { .. } => DcConfig::SYNC0,
            DcConfig::Sync0And1 { .. } => DcConfig::SYNC0 | DcConfig::SYNC1,
        }
    }
}

/// The longest waits for one SubDevice; what is `None` is as for every other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Timeouts {
    /// To INIT.
    pub init: Option<Duration>,
    /// INIT to PRE-OP.
    pub pre_op: Option<Duration>,
    /// PRE-OP to SAFE-OP, and SAFE-OP to OP.
    pub safe_op_op: Option<Duration>,
    /// From a message to its mailbox to the answer.
    pub mailbox: Option<Duration>,
}

impl Timeouts {
    /// The longest wait for a state of its own.
    pub fn of(&self, state: AlState) -> Option<Duration> {
        match state {
            AlState::Init => self.init,
            AlState::PreOp | AlState::Bootstrap => self.pre_op,
            AlState::SafeOp | AlState::Op => self.safe_op_op,
        }
    }
}

/// How the application is synchronised: objects 0x1C32 and 0x1C33, subindex 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SyncMode {
    /// 0.
    FreeRun,
    /// 1 for outputs; 0x22 for inputs where there are outputs, else 1.
    SyncManagerEvent,
    /// 2.
    Sync0,
}

/// Watchdogs; what is `None` stays as the device has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WatchdogConfig {
    /// Register 0x0400: units of 40 ns, less 2.
    pub divider: Option<u16>,
    /// Register 0x0410: multiples of the divided clock; 0 switches off.
    pub pdi: Option<u16>,
    /// Register 0x0420: multiples of the divided clock; 0 switches off. Any other has all outputs trigger it, whatever the SII says.
    pub process_data: Option<u16>,
}

/// Which cycles carry a SubDevice's process data: every one, or each n-th.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Every(NonZeroU16);

impl Every {
    /// Every cycle.
    pub const CYCLE: Every = Every(NonZeroU16::MIN);

    /// Each n-th cycle; `None` for 0.
    pub fn nth(n: u16) -> Option<Self> {
        NonZeroU16::new(n).map(Every)
    }

    /// From one to the next, cycles.
    pub fn cycles(self) -> u16 {
        self.0.get()
    }
}

impl Default for Every {
    fn default() -> Self {
        Every::CYCLE
    }
}

/// Whether a SubDevice has to be there.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Presence {
    /// It has.
    #[default]
    Required,
    /// It is there with all others of this hot-connect group, or none of them is. Who may be absent is known by alias or
    /// identification, and so is everyone behind the group's place, for positions shift.
    Group(Arc<str>),
}

/// Everything that the user asks of one SubDevice.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SubDeviceConfig {
    /// A name of the user's, for messages.
    pub name: Option<String>,
    /// Which SubDevice; `None` takes the place in the list as position.
    pub place: Option<Match>,
    /// Who must be there.
    pub identity: ExpectedIdentity,
    /// Whether it has to be there.
    pub presence: Presence,
    /// SDOs sent in PRE-OP before the mapping, in order.
    pub sdos: Vec<SdoWrite>,
    /// SDOs sent in SAFE-OP, with SYNC armed and process data flowing, before OP is asked; in order.
    pub safe_op_sdos: Vec<SdoWrite>,
    /// PDO map; empty keeps what the device has.
    pub pdos: Vec<SyncManagerPdos>,
    /// Its process data share no byte with those of others, also where its FMMUs map bits.
    pub own_bytes: bool,
    /// In which cycles its process data go. With SYNC0, [`DcConfig`] has so many cycles as its period; its SyncManagers'
    /// watchdog must be longer.
    pub every: Every,
    /// Synchronisation by clocks.
    pub dc: DcConfig,
    /// Written to 0x1C32 and 0x1C33 where given.
    pub sync_mode: Option<SyncMode>,
    /// The registers 0x0980 (low byte; a refusal is tolerated) and 0x0981; `None`: [`DcConfig::assign_activate`].
    pub assign_activate: Option<u16>,
    /// Watchdogs.
    pub watchdogs: WatchdogConfig,
    /// The longest waits.
    pub timeouts: Timeouts,
    /// Whether LRW may touch it; `None` decides from register 0x0008 and the SII.
    pub lrw: Option<LrwPermission>,
    /// Mailboxes in place of the SII's.
    pub mailbox: Option<MailboxConfig>,
}

impl SubDeviceConfig {
    /// What the registers 0x0980 and 0x0981 are told.
    pub fn assign_activate(&self) -> u16 {
        self.assign_activate.unwrap_or(self.dc.assign_activate())
    }
}

/// Whether LRW datagrams may touch a SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LrwPermission {
    /// They may.
    Allowed,
    /// They may not: LRD and LWR only.
    Barred,
}
