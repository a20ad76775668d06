//! The SubDevices without a wheel of a simulated robot.

use omnibase_ethercat::start_up::SdoAccess;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::sii::ImageTooShort;
use omnibase_ethercat_sim::device::Piece;
use omnibase_ethercat_sim::device::generic::Generic;
use omnibase_ethercat_sim::device::panel::{IoPanel, MOST_BYTES};
use omnibase_ethercat_sim::device::parameters;
use omnibase_ethercat_sim::device::simple::{self, Terminal};
use omnibase_ethercat_sim::dictionary::standard::PdoMap;
use omnibase_robot::config::{BusPlace, DevicePlan, ParameterPlan, PdoPlan};

/// Vendor and product where the robot's file gives none.
const VENDOR: u32 = 0xE000_0001;
const PRODUCT: u32 = 1;

/// A terminal with the process data of the plan; one that is ignored has none. Its inputs are as the plan says.
pub(super) fn terminal(device: &DevicePlan, number: usize) -> Result<Generic, ImageTooShort> {
    let terminal = Terminal {
        name: device.name.clone(),
        vendor_id: device.identity.vendor_id.unwrap_or(VENDOR),
        product_code: device.identity.product_code.unwrap_or(PRODUCT),
        revision: device.identity.revision.unwrap_or(1),
        outputs: maps(&device.outputs, "Outputs"),
        inputs: maps(&device.inputs, "Inputs"),
        parameters: device.parameters.iter().flat_map(entries).collect(),
    };
    let generic = simple::terminal(&terminal, &piece(device, number))?;
    show(&device.inputs, &simulated_bytes(device), &generic.panel);
    Ok(generic)
}

/// Its process data with the values that the file says of the simulated robot.
pub(super) fn simulated_bytes(device: &DevicePlan) -> Vec<u8> {
    let mut bytes = vec![0; device.input_bytes()];
    for input in &device.input {
        if let (Some(coding), Some(value)) = (input.coding, input.simulated) {
            coding.write(value, &mut bytes);
        }
    }
    bytes
}

/// Puts process data at a device's terminals.
pub(super) fn show(pdos: &[PdoPlan], bytes: &[u8], panel: &IoPanel) {
    let mut at = 0_usize;
    for entry in pdos.iter().flat_map(|pdo| &pdo.entries) {
        let mut value = [0; MOST_BYTES];
        for n in 0..usize::from(entry.bits) {
            value[n / 8] |= (bytes[(at + n) / 8] >> ((at + n) % 8) & 1) << (n % 8);
        }
        at += usize::from(entry.bits);
        panel.set_input_bytes(ObjectAddress::new(entry.index, entry.subindex), &value);
    }
}

/// The entries that a parameter writes, each with its bytes.
pub(super) fn entries(parameter: &ParameterPlan) -> Vec<(ObjectAddress, usize)> {
    let address = ObjectAddress::new(parameter.index, parameter.subindex);
    match parameter.access {
        SdoAccess::Entry => vec![(address, parameter.data.len())],
        SdoAccess::Complete => parameters::entries_of_whole(address, &parameter.data),
    }
}

/// One piece of its product, unlike all others.
pub(super) fn piece(device: &DevicePlan, number: usize) -> Piece {
    Piece {
        alias: match device.place {
            BusPlace::Alias(alias) => alias,
            BusPlace::Position(_) | BusPlace::Identification(_) => 0,
        },
        identification: match device.place {
            BusPlace::Identification(number) => Some(number),
            BusPlace::Position(_) | BusPlace::Alias(_) => None,
        },
        serial: 100 + number as u32,
        dc_offset_ns: (number as u64 + 1) * 76_543_210,
        ..Piece::default()
    }
}

fn maps(pdos: &[PdoPlan], name: &str) -> Vec<PdoMap> {
    let map = |pdo: &PdoPlan| PdoMap {
        index: pdo.index,
        name: name.to_owned(),
        entries: pdo
            .entries
            .iter()
            .map(|entry| (ObjectAddress::new(entry.index, entry.subindex), entry.bits))
            .collect(),
    };
    pdos.iter().map(map).collect()
}
