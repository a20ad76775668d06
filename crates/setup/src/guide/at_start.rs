//! What the file has written at every start, for jogs: a drive that is turned otherwise than the robot will turn it shows nothing.

use omnibase_ethercat::config::{SubDeviceConfig, WatchdogConfig};
use omnibase_ethercat::start_up::{ReadBack, Refusal, SdoAccess, SdoWrite};
use omnibase_ethercat::subdevice::SubDevice;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_robot::RobotPlan;
use omnibase_robot::config::{BusPlace, DevicePlan};

use super::{is_identity, is_product};
use crate::record::FoundDrive;

/// What a jog writes over in a drive of its own: max torque, mode, how it is synchronised.
pub(super) const JOG_WRITES: [(u16, u8); 4] = [(MAX_TORQUE, 0), (0x6060, 0), (0x1C32, 1), (0x1C33, 1)];
pub(super) const MAX_TORQUE: u16 = 0x6072;
/// Has a drive store what it holds, for one the max torque of a jog.
pub(super) const STORE: u16 = 0x1010;

/// The SDOs for one SubDevice, and its watchdogs.
#[derive(Debug, Default)]
pub(super) struct AtStart {
    pub(super) pre_op: Vec<SdoWrite>,
    pub(super) safe_op: Vec<SdoWrite>,
    pub(super) watchdogs: WatchdogConfig,
}

impl AtStart {
    /// Those that every drive of this product is written: whose wheel it turns isn't known yet. Another product may refuse what
    /// it hasn't.
    pub(super) fn of_drive(plan: &RobotPlan, drive: &FoundDrive) -> AtStart {
        let drives = plan.drives.iter().filter(|one| is_product(one, drive));
        let mut all = drives.map(|one| AtStart::from(one.subdevice_config(&plan.bus)));
        // A drive that no file knows stops by itself, too.
        let nothing = || AtStart { watchdogs: plan.bus.watchdogs(), ..AtStart::default() };
        let mut common = all.next().unwrap_or_else(nothing);
        for other in all {
            common.pre_op.retain(|sdo| other.pre_op.iter().any(|one| is_same(one, sdo)));
            common.safe_op.retain(|sdo| other.safe_op.iter().any(|one| is_same(one, sdo)));
        }
        for list in [&mut common.pre_op, &mut common.safe_op] {
            list.retain(|SdoWrite { object, .. }| {
                object.index != STORE && !JOG_WRITES.contains(&(object.index, object.subindex))
            });
            list.iter_mut()
                .for_each(|sdo| (sdo.refusal, sdo.read_back) = (Refusal::IsTolerated, ReadBack::Skip));
        }
        common
    }

    /// Those of a SubDevice that the file has in this place: a coupler that waits for its list of modules keeps all from OP.
    pub(super) fn of_device(plan: &RobotPlan, found: &SubDevice) -> AtStart {
        let is_it = |place: BusPlace| match place {
            BusPlace::Position(position) => position == found.position,
            BusPlace::Alias(alias) => found.alias == Some(alias),
            BusPlace::Identification(number) => found.identification == Some(number),
        };
        let (vendor_id, product_code) = (found.identity.vendor_id, found.identity.product_code);
        let is_there =
            |one: &&DevicePlan| is_it(one.place) && is_identity(&one.identity, vendor_id, product_code);
        let device = plan.devices.iter().find(is_there);
        device.map_or_else(AtStart::default, |one| one.subdevice_config(&plan.bus).into())
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
        for list in [&mut self.pre_op, &mut self.safe_op] {
            list.retain(|sdo| is_known(sdo, was));
        }
        self
    }

    fn sdos(&self) -> impl Iterator<Item = &SdoWrite> {
        self.pre_op.iter().chain(&self.safe_op)
    }
}

impl From<SubDeviceConfig> for AtStart {
    fn from(config: SubDeviceConfig) -> Self {
        AtStart { pre_op: config.sdos, safe_op: config.safe_op_sdos, watchdogs: config.watchdogs }
    }
}

fn is_known(sdo: &SdoWrite, was: &[(u16, u8, Vec<u8>)]) -> bool {
    let object = (sdo.object.index, sdo.object.subindex);
    sdo.access == SdoAccess::Entry && was.iter().any(|(index, subindex, _)| (*index, *subindex) == object)
}

fn is_same(one: &SdoWrite, other: &SdoWrite) -> bool {
    (one.object, &one.data, one.access) == (other.object, &other.data, other.access)
}
