//! What the file asks of each SubDevice at every start, for jogs: a drive that is turned otherwise than the robot will turn it shows nothing.

use omnibase_ethercat::config::{
    DcConfig, ExpectedIdentity, Match, Presence, SubDeviceConfig, SyncManagerPdos, SyncMode,
};
use omnibase_ethercat::start_up::{ReadBack, Refusal, SdoAccess, SdoWrite};
use omnibase_ethercat::subdevice::SubDevice;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_robot::RobotPlan;
use omnibase_robot::config::{BusPlan, Synchronisation};

use super::apart::{is_at, is_its};
use super::is_product;
use crate::record::FoundDrive;

/// What a jog writes over in a drive of its own: max torque, mode, what is added to a speed or a torque, how it is synchronised.
pub(super) const JOG_WRITES: [(u16, u8); 6] =
    [(MAX_TORQUE, 0), (MODE, 0), (OFFSETS[0].0, 0), (OFFSETS[1].0, 0), SYNC_TYPES[0], SYNC_TYPES[1]];
/// How outputs and inputs are synchronised.
const SYNC_TYPES: [(u16, u8); 2] = [(0x1C32, 1), (0x1C33, 1)];
/// What is added to each speed and torque that is told, and bytes.
pub(super) const OFFSETS: [(u16, usize); 2] = [(0x60B1, 4), (0x60B2, 2)];
pub(super) const MAX_TORQUE: u16 = 0x6072;
pub(super) const MODE: u16 = 0x6060;
/// Has a drive store what it holds, for one the max torque of a jog.
pub(super) const STORE: u16 = 0x1010;

/// What one SubDevice is asked for.
#[derive(Debug, Default)]
pub(super) struct AtStart {
    /// With the map that the SubDevice has by itself.
    pub(super) config: SubDeviceConfig,
    /// The file's map, where it has one.
    pub(super) maps: Vec<SyncManagerPdos>,
}

impl AtStart {
    /// What every drive of this product is asked for in such cycles: whose wheel it turns isn't known yet. Another product may refuse
    /// what it hasn't.
    pub(super) fn of_drive(plan: &RobotPlan, bus: &BusPlan, drive: &FoundDrive) -> AtStart {
        let drives = plan.drives.iter().filter(|one| is_product(one, drive));
        let mut all = drives.map(|one| one.subdevice_config(bus));
        let mut common = all.next().unwrap_or_else(|| of_nobody(bus));
        for other in all {
            common.sdos.retain(|sdo| other.sdos.iter().any(|one| is_same(one, sdo)));
            common.safe_op_sdos.retain(|sdo| other.safe_op_sdos.iter().any(|one| is_same(one, sdo)));
        }
        for list in [&mut common.sdos, &mut common.safe_op_sdos] {
            list.retain(|SdoWrite { object, .. }| {
                object.index != STORE && !JOG_WRITES.contains(&(object.index, object.subindex))
            });
            list.iter_mut()
                .for_each(|sdo| (sdo.refusal, sdo.read_back) = (Refusal::IsTolerated, ReadBack::Skip));
        }
        AtStart::at(drive.position, common)
    }

    /// What the file asks of a SubDevice in this place: a coupler that waits for its list of modules keeps all from OP.
    pub(super) fn of_device(plan: &RobotPlan, bus: &BusPlan, found: &SubDevice) -> AtStart {
        let device = plan.devices.iter().find(|one| is_at(one, found) && is_its(one, found));
        let config = device.map_or_else(SubDeviceConfig::default, |one| one.subdevice_config(bus));
        AtStart::at(found.position, config)
    }

    /// Whoever is there was found already.
    fn at(position: u16, config: SubDeviceConfig) -> Self {
        let config = SubDeviceConfig {
            name: None,
            place: Some(Match::Position(position)),
            identity: ExpectedIdentity::default(),
            presence: Presence::Required,
            ..config
        };
        let (maps, config) = (config.pdos.clone(), SubDeviceConfig { pdos: Vec::new(), ..config });
        AtStart { config, maps }
    }

    /// The objects that can be asked for what they were before.
    pub(super) fn objects(&self) -> impl Iterator<Item = (u16, u8)> {
        let entries = self.sdos().filter(|sdo| sdo.access == SdoAccess::Entry);
        entries.map(|sdo| (sdo.object.index, sdo.object.subindex))
    }

    /// The objects of which nobody knows what they were: a jog doesn't write what nobody could put back.
    pub(super) fn unknown(&self, was: &[(u16, u8, Vec<u8>)]) -> Vec<ObjectAddress> {
        self.sdos().filter(|sdo| !is_known(sdo, was)).map(|sdo| sdo.object).collect()
    }

    /// Without these.
    pub(super) fn of_known(mut self, was: &[(u16, u8, Vec<u8>)]) -> Self {
        for list in [&mut self.config.sdos, &mut self.config.safe_op_sdos] {
            list.retain(|sdo| is_known(sdo, was));
        }
        self
    }

    /// What a jog can't do without and isn't known: its limit, its mode, how it is synchronised.
    pub(super) fn missing(&self, was: &[(u16, u8, Vec<u8>)]) -> Option<ObjectAddress> {
        let synchronised = SYNC_TYPES.into_iter().filter(|_| self.config.sync_mode.is_some());
        let mut needed = [(MAX_TORQUE, 0), (MODE, 0)].into_iter().chain(synchronised);
        needed.find(|object| !has(was, *object)).map(|(index, subindex)| ObjectAddress::new(index, subindex))
    }

    /// Whether it writes this there.
    pub(super) fn writes(&self, object: ObjectAddress, bytes: &[u8]) -> bool {
        self.sdos().any(|sdo| sdo.object == object && sdo.data == bytes)
    }

    fn sdos(&self) -> impl Iterator<Item = &SdoWrite> {
        self.config.sdos.iter().chain(&self.config.safe_op_sdos)
    }
}

/// A drive that no file knows stops by itself, too, and beats as the others do.
fn of_nobody(bus: &BusPlan) -> SubDeviceConfig {
    let (dc, sync_mode) = match bus.synchronisation {
        Synchronisation::Sync0 => {
            let cycle_ns = u32::try_from(bus.cycle_ns).unwrap_or(u32::MAX);
            (DcConfig::Sync0 { cycle_ns, shift_ns: bus.sync0_shift_ns }, Some(SyncMode::Sync0))
        }
        Synchronisation::SyncManagerEvent => (DcConfig::Off, Some(SyncMode::SyncManagerEvent)),
        Synchronisation::FreeRun => (DcConfig::Off, Some(SyncMode::FreeRun)),
    };
    SubDeviceConfig {
        own_bytes: true,
        dc,
        sync_mode,
        watchdogs: bus.watchdogs(),
        ..SubDeviceConfig::default()
    }
}

fn is_known(sdo: &SdoWrite, was: &[(u16, u8, Vec<u8>)]) -> bool {
    sdo.access == SdoAccess::Entry && has(was, (sdo.object.index, sdo.object.subindex))
}

/// Whether this object is among them.
pub(super) fn has(was: &[(u16, u8, Vec<u8>)], object: (u16, u8)) -> bool {
    was.iter().any(|(index, subindex, _)| (*index, *subindex) == object)
}

fn is_same(one: &SdoWrite, other: &SdoWrite) -> bool {
    (one.object, &one.data, one.access) == (other.object, &other.data, other.access)
}
