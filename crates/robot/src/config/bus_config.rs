//! What the bus is asked for, from the plan.

use omnibase_ethercat::config as bus_config;
use omnibase_ethercat::start_up::{Refusal, SdoWrite};
use omnibase_ethercat::subdevice::Direction;
use omnibase_ethercat::wire::coe::ObjectAddress;

use super::bus_plan::{BusPlace, BusPlan, Identity, ParameterPlan};
use super::drive_plan::DrivePlan;
use super::drive_tables::ParameterState;
use super::mapping::PdoPlan;

impl DrivePlan {
    /// Bytes of process data from the drive.
    pub fn input_bytes(&self) -> usize {
        bytes(&self.inputs)
    }

    /// Bytes of process data to the drive.
    pub fn output_bytes(&self) -> usize {
        bytes(&self.outputs)
    }

    /// What the bus is asked for this drive.
    pub fn subdevice_config(&self, bus: &BusPlan) -> bus_config::SubDeviceConfig {
        bus_config::SubDeviceConfig {
            // What is read and written by bytes, and zeroed while its owner is away.
            own_bytes: true,
            name: Some(self.name.clone()),
            place: Some(matched(self.place)),
            identity: expected_identity(&self.identity),
            sdos: sdos(&self.parameters, ParameterState::PreOp),
            safe_op_sdos: sdos(&self.parameters, ParameterState::SafeOp),
            pdos: vec![
                sync_manager(2, Direction::Outputs, &self.outputs),
                sync_manager(3, Direction::Inputs, &self.inputs),
            ],
            dc: self.dc.map_or(bus_config::DcConfig::Off, |dc| dc.config(bus.cycle_ns)),
            assign_activate: self.dc.map(|dc| dc.assign_activate),
            sync_mode: bus.sync_mode(self.dc.as_ref()),
            timeouts: self.timeouts,
            watchdogs: bus.watchdogs(),
            ..Default::default()
        }
    }
}

impl ParameterPlan {
    fn sdo_write(&self) -> SdoWrite {
        SdoWrite {
            object: ObjectAddress::new(self.index, self.subindex),
            data: self.data.clone(),
            access: self.access,
            refusal: Refusal::IsError,
            read_back: self.read_back,
            origin: Some(self.origin.as_str().into()),
        }
    }
}

/// The SDOs of a state, in their order.
pub(super) fn sdos(parameters: &[ParameterPlan], state: ParameterState) -> Vec<SdoWrite> {
    let of_state = parameters.iter().filter(|parameter| parameter.state == state);
    of_state.map(ParameterPlan::sdo_write).collect()
}

/// Where the bus finds a SubDevice.
pub(super) fn matched(place: BusPlace) -> bus_config::Match {
    match place {
        BusPlace::Position(position) => bus_config::Match::Position(position),
        BusPlace::Alias(alias) => bus_config::Match::Alias(alias),
        BusPlace::Identification(number) => bus_config::Match::Identification(number),
    }
}

pub(super) fn expected_identity(identity: &Identity) -> bus_config::ExpectedIdentity {
    let Identity { vendor_id, product_code, revision } = *identity;
    bus_config::ExpectedIdentity { vendor_id, product_code, revision, serial: None }
}

/// What a SyncManager is asked to carry.
pub fn sync_manager(index: u8, direction: Direction, pdos: &[PdoPlan]) -> bus_config::SyncManagerPdos {
    let pdo = |pdo: &PdoPlan| bus_config::PdoConfig {
        index: pdo.index,
        entries: Some(
            pdo.entries
                .iter()
                .map(|entry| (ObjectAddress::new(entry.index, entry.subindex), entry.bits))
                .collect(),
        ),
    };
    bus_config::SyncManagerPdos {
        sync_manager: index,
        direction,
        pdos: pdos.iter().map(pdo).collect(),
        origin: None,
    }
}

pub(super) fn bytes(pdos: &[PdoPlan]) -> usize {
    pdos.iter().map(PdoPlan::bits).sum::<u32>().div_ceil(8) as usize
}
