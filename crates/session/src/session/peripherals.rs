//! SubDevices without a wheel at set-up: what can be asked of each is known once it was seen.

use omnibase_ethercat::config::SubDeviceConfig;
use omnibase_ethercat::subdevice::{Direction, SubDevice};
use omnibase_ethercat::wire::sii::{self, SyncManagerUsage};
use omnibase_robot::RobotPlan;
use omnibase_robot::config::{BusPlace, BusPlan, DevicePlan, MapEntry, PdoPlan, sync_manager};

use super::SessionError;

/// The SubDevice at a place.
pub(super) fn found(place: BusPlace, subdevices: &[SubDevice]) -> Option<&SubDevice> {
    subdevices.iter().find(|one| match place {
        BusPlace::Position(position) => one.position == position,
        BusPlace::Alias(alias) => one.alias == Some(alias),
        BusPlace::Identification(number) => one.identification == Some(number),
    })
}

fn speaks_coe(subdevice: &SubDevice) -> bool {
    subdevice.sii.header.mailbox_protocols & sii::PROTOCOL_COE != 0
}

/// What the bus is asked for it: its maps are written where it has a mailbox for that.
pub(super) fn config(device: &DevicePlan, bus: &BusPlan, subdevices: &[SubDevice]) -> SubDeviceConfig {
    let config = device.subdevice_config(bus);
    let Some(subdevice) = found(device.place, subdevices).filter(|one| speaks_coe(one)) else {
        return config;
    };
    let maps = [
        (Direction::Outputs, SyncManagerUsage::Outputs, &device.outputs, 2),
        (Direction::Inputs, SyncManagerUsage::Inputs, &device.inputs, 3),
    ];
    let maps = maps.into_iter().filter(|(.., pdos, _)| !pdos.is_empty());
    let pdos = maps.map(|(direction, usage, pdos, usual)| {
        let found = subdevice.sii.sync_managers.iter().position(|manager| manager.usage == usage);
        sync_manager(found.map_or(usual, |index| index as u8), direction, pdos)
    });
    SubDeviceConfig { pdos: pdos.collect(), ..config }
}

/// The hot-connect groups that aren't there; those that are stand behind everybody who is known by position.
pub(super) fn absent_groups(plan: &RobotPlan, subdevices: &[SubDevice]) -> Result<Vec<String>, SessionError> {
    let mut absent: Vec<String> = Vec::new();
    let places = plan.drives.iter().map(|drive| drive.place).chain(plan.devices.iter().map(|one| one.place));
    let known_by_position = places.filter_map(|place| match place {
        BusPlace::Position(position) => Some(position),
        _ => None,
    });
    let last = known_by_position.max();
    for device in &plan.devices {
        let Some(group) = &device.group else { continue };
        // A part of it that is there is refused later, with what is missing.
        let is_of_it = |one: &&DevicePlan| one.group.as_ref() == Some(group);
        let mut members = plan.devices.iter().filter(is_of_it);
        match (found(device.place, subdevices), last) {
            (None, _) if absent.contains(group) => {}
            (None, _) if members.any(|one| found(one.place, subdevices).is_some()) => {}
            (None, _) => absent.push(group.clone()),
            (Some(one), Some(last)) if one.position <= last => {
                let (name, position) = (device.name.clone(), one.position);
                return Err(SessionError::GroupInFront { name, position, last });
            }
            (Some(_), _) => {}
        }
    }
    Ok(absent)
}

/// What it really maps is what its file says: signals are taken from the places that follow from it.
pub(super) fn check_maps(device: &DevicePlan, subdevices: &[SubDevice]) -> Result<(), SessionError> {
    let Some(subdevice) = found(device.place, subdevices) else { return Ok(()) };
    for (direction, words, pdos) in
        [(Direction::Outputs, "outputs", &device.outputs), (Direction::Inputs, "inputs", &device.inputs)]
    {
        let managers = subdevice.sync_managers.iter().filter(|one| one.direction() == Some(direction));
        let objects = managers.flat_map(|manager| &manager.pdos).flat_map(|pdo| &pdo.entries);
        let has: Vec<MapEntry> = objects
            .map(|entry| MapEntry {
                index: entry.object.index,
                subindex: if entry.object.index == 0 { 0 } else { entry.object.subindex },
                bits: entry.bit_length,
            })
            .collect();
        let wanted: Vec<MapEntry> = pdos.iter().flat_map(|pdo: &PdoPlan| pdo.entries.clone()).collect();
        if wanted.is_empty() || wanted == has {
            continue;
        }
        return Err(SessionError::Map {
            name: device.name.clone(),
            position: subdevice.position,
            direction: words,
            expected: shown(&wanted),
            found: shown(&has),
        });
    }
    Ok(())
}

fn shown(entries: &[MapEntry]) -> String {
    entries.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ")
}
