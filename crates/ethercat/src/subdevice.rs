//! What is known about one SubDevice.

use alloc::string::String;
use alloc::vec::Vec;

use crate::config::SubDeviceConfig;
use crate::fmmu::Fmmu;
use crate::found::Target;
use crate::start_up::StartUpList;
use crate::state::Application;
use crate::wire::register;
use crate::wire::sii::{self, Identity};

pub use crate::process_data::{
    Activation, Direction, LogicalBits, MailboxConfig, MappedObject, MappedPdo, MemoryArea, SyncManager,
};

/// What registers 0x0000 to 0x0009 say about the SubDevice controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Esc {
    /// Type (0x0000).
    pub kind: u8,
    /// Revision (0x0001).
    pub revision: u8,
    /// Build (0x0002).
    pub build: u16,
    /// FMMUs that exist; none above is ever used.
    pub fmmu_count: u8,
    /// SyncManagers that exist; none above is ever used.
    pub sync_manager_count: u8,
    /// Process-data memory, KiB.
    pub ram_kib: u8,
    /// Two bits per port: 0 not there, 1 not configured, 2 EBUS, 3 MII.
    pub port_descriptor: u8,
    /// Feature bits, `register::FEATURE_*`.
    pub features: u16,
}

impl Esc {
    /// Reads the ten bytes from register 0x0000; `None` where there are fewer.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let &[kind, revision, build_low, build_high, fmmus, sync_managers, ram, ports, low, high, ..] = bytes
        else {
            return None;
        };
        Some(Esc {
            kind,
            revision,
            build: u16::from_le_bytes([build_low, build_high]),
            fmmu_count: fmmus.min(16),
            sync_manager_count: sync_managers.min(16),
            ram_kib: ram,
            port_descriptor: ports,
            features: u16::from_le_bytes([low, high]),
        })
    }

    /// Whether the feature bits of `mask` are all set.
    pub fn has(&self, mask: u16) -> bool {
        self.features & mask == mask
    }

    /// Whether FMMUs can start and end within a byte.
    pub fn maps_bits(&self) -> bool {
        !self.has(register::FEATURE_FMMU_BYTEWISE)
    }
}

/// What a port is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PortKind {
    /// Not there.
    #[default]
    None,
    /// There, not configured.
    Unconfigured,
    /// EBUS.
    Ebus,
    /// MII, RGMII or RMII: an Ethernet connector.
    Mii,
}

/// One of the four ports, as registers 0x0007 and 0x0110 show it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Port {
    /// What it is made of.
    pub kind: PortKind,
    /// A physical link is there.
    pub link: bool,
    /// Frames leave and arrive here (the loop is open and a partner answers).
    pub communicates: bool,
}

/// Where a SubDevice hangs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parent {
    /// Position of the SubDevice before it in the tree.
    pub position: u16,
    /// The parent's port.
    pub port: u8,
}

/// A SubDevice's distributed clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DcClock {
    /// Bits of its system time.
    pub width: DcWidth,
    /// Propagation delay from the reference clock (0x0928), ns.
    pub delay_ns: u32,
    /// System time minus local time (0x0920), ns, wrapping.
    pub offset_ns: u64,
    /// Local times at which the last latched frame passed ports 0 to 3 (0x0900), ns, wrapping.
    pub receive_times_ns: [u32; 4],
}

impl DcClock {
    /// A clock of which nothing was measured yet.
    pub fn new(width: DcWidth) -> Self {
        DcClock { width, delay_ns: 0, offset_ns: 0, receive_times_ns: [0; 4] }
    }
}

/// Width of a distributed clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DcWidth {
    /// 32 bits: wraps every 4.29 s.
    Bits32,
    /// 64 bits.
    Bits64,
}

impl DcWidth {
    /// The width that a controller's features say; `None` where it has no clock.
    pub fn of(esc: &Esc) -> Option<Self> {
        let width = if esc.has(register::FEATURE_DC_64) { DcWidth::Bits64 } else { DcWidth::Bits32 };
        esc.has(register::FEATURE_DC).then_some(width)
    }
}

/// One SubDevice: what was found, what was asked, and what was made of it.
#[derive(Clone, Debug)]
pub struct SubDevice {
    /// Place in the order in which frames pass, from 0.
    pub position: u16,
    /// Station address that the MainDevice gave it.
    pub station_address: u16,
    /// Alias (0x0012); 0 in the device is `None` here.
    pub alias: Option<u16>,
    /// Its explicit device identification (a switch on the device), where it has one.
    pub identification: Option<u16>,
    /// Vendor, product, revision, serial from the SII.
    pub identity: Identity,
    /// Name from the SII; empty where it has none.
    pub name: String,
    /// Its controller.
    pub esc: Esc,
    /// Whether an application answers its state requests.
    pub application: Application,
    /// Its four ports.
    pub ports: [Port; 4],
    /// The port through which frames arrive.
    pub entry_port: u8,
    /// Where it hangs; `None` for the first.
    pub parent: Option<Parent>,
    /// Its mailboxes, where it has any.
    pub mailbox: Option<MailboxConfig>,
    /// Bits `sii::COE_*` from the SII.
    pub coe_details: u8,
    /// The SII as far as it was read; tables for those who ask.
    pub sii: sii::Image,
    /// All its SyncManagers, by rising index.
    pub sync_managers: Vec<SyncManager>,
    /// FMMUs in use, element n is FMMU n.
    pub fmmus: Vec<Fmmu>,
    /// Whether LRW may touch it (register 0x0008 bit 9, SII General flag, configuration).
    pub lrw_allowed: bool,
    /// Its clock, where it has one.
    pub dc: Option<DcClock>,
    /// What the user asked of it.
    pub config: SubDeviceConfig,
    /// Everything that takes it from INIT to OP.
    pub start_up: StartUpList,
    /// Why it can't be used, where something of it is broken.
    pub broken: Option<String>,
}

impl SubDevice {
    /// Its position and station address.
    pub fn target(&self) -> Target {
        Target { position: self.position, station: self.station_address }
    }

    /// Whether it has this alias, or will have it from its next power-on.
    pub fn claims_alias(&self, alias: u16) -> bool {
        self.alias == Some(alias) || self.sii.header.alias == alias
    }

    /// Bits of process data in `direction`.
    pub fn bit_length(&self, direction: Direction) -> u32 {
        self.process_data(direction).map(SyncManager::bit_length).sum()
    }

    /// Its SyncManagers with process data in `direction`, length 0 left out.
    pub fn process_data(&self, direction: Direction) -> impl Iterator<Item = &SyncManager> {
        self.sync_managers.iter().filter(move |sm| sm.direction() == Some(direction) && sm.bit_length() > 0)
    }
}
