//! What the cycle has to know about one SubDevice.

use alloc::vec::Vec;

use crate::config::{DcConfig, Every, LrwPermission, Timeouts};
use crate::mailbox::Mailbox;
use crate::subdevice::{DcWidth, Direction, MailboxConfig, SubDevice, SyncManager};

/// Whether an area may share a byte with those of others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Packing {
    /// It starts and ends at any bit.
    Bits,
    /// It has its bytes for itself: its FMMUs don't map bits.
    Bytes,
}

/// One SyncManager's process data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Area {
    /// Its SyncManager.
    pub sync_manager: u8,
    /// The way of the data.
    pub direction: Direction,
    /// Bits.
    pub bit_length: u32,
    /// Whether a byte may be shared.
    pub packing: Packing,
}

/// One SubDevice as the cycle sees it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Member {
    /// Place in the order in which frames pass, from 0.
    pub position: u16,
    /// Station address.
    pub station: u16,
    /// Whether LRW may touch it.
    pub lrw: LrwPermission,
    /// Its process data.
    pub areas: Vec<Area>,
    /// In which cycles these go.
    pub every: Every,
    /// Its mailbox, where it speaks CoE.
    pub mailbox: Option<MailboxConfig>,
    /// SyncManagers that are switched on between SAFE-OP and OP.
    pub op_only: Vec<u8>,
    /// Width of its clock, where it has one.
    pub clock: Option<DcWidth>,
    /// SYNC0 and SYNC1.
    pub sync: DcConfig,
    /// What the registers 0x0980 and 0x0981 are told.
    pub assign_activate: u16,
    /// The longest waits.
    pub timeouts: Timeouts,
}

/// Data bytes that register accesses in the spare datagram may have, whatever the mailboxes are.
const REGISTER_ACCESS: usize = 32;

impl Member {
    /// The longest datagram of acyclic work, data bytes.
    pub(super) fn longest_acyclic(&self) -> usize {
        let mailbox = self.mailbox.and_then(|config| Mailbox::new(self.station, config).ok());
        mailbox.map_or(0, |mailbox| mailbox.longest_datagram()).max(REGISTER_ACCESS)
    }

    /// Bytes of process data in `direction`.
    pub(crate) fn byte_length(&self, direction: Direction) -> u32 {
        let areas = self.areas.iter().filter(|area| area.direction == direction);
        areas.map(|area| area.bit_length.div_ceil(8)).sum()
    }
}

impl From<&SubDevice> for Member {
    fn from(subdevice: &SubDevice) -> Self {
        let shares = subdevice.esc.maps_bits() && !subdevice.config.own_bytes;
        let packing = if shares { Packing::Bits } else { Packing::Bytes };
        let areas = [Direction::Outputs, Direction::Inputs].into_iter().flat_map(|direction| {
            subdevice.process_data(direction).map(move |sync_manager| Area {
                sync_manager: sync_manager.index,
                direction,
                bit_length: sync_manager.bit_length(),
                packing,
            })
        });
        Member {
            position: subdevice.position,
            station: subdevice.station_address,
            lrw: if subdevice.lrw_allowed { LrwPermission::Allowed } else { LrwPermission::Barred },
            areas: areas.collect(),
            every: subdevice.config.every,
            mailbox: subdevice.mailbox.filter(MailboxConfig::speaks_coe),
            op_only: subdevice.sync_managers.iter().filter_map(SyncManager::op_only).collect(),
            clock: subdevice.dc.map(|dc| dc.width),
            sync: subdevice.config.dc,
            assign_activate: subdevice.config.assign_activate(),
            timeouts: subdevice.config.timeouts,
        }
    }
}
