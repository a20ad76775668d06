//! Devices: between a drive's process data and its wheel's units.

mod cia402;
mod field;
mod sgdv;

use crate::config::{MapEntry, ParameterPlan, PdoPlan};
use crate::registry::{DeviceDefaults, Kind, Registry};

pub use cia402::Cia402Device;
pub(crate) use cia402::mode_of;
pub(crate) use field::{Field, nearest};

/// Registers the built-in devices; keys of the drives' tables are read for each of them.
pub fn register(registry: &mut Registry) {
    let cia402 = ("cia402", "Any drive of the profile CiA 402, as its tables say", cia402::defaults());
    let sgdv =
        ("sgdv", "The Yaskawa SGDV with its EtherCAT option, maps and encoder known", sgdv::defaults());
    for (name, meaning, defaults) in [cia402, sgdv] {
        registry.devices.add(Kind { name, meaning, keys: Vec::new() }, defaults, Cia402Device::new);
    }
}

/// A PDO of objects `(index, subindex, bits)`.
pub(crate) fn pdo(index: u16, entries: &[(u16, u8, u8)]) -> PdoPlan {
    let entry = |&(index, subindex, bits): &(u16, u8, u8)| MapEntry { index, subindex, bits };
    PdoPlan { index, entries: entries.iter().map(entry).collect() }
}

/// A parameter of 16 bits, written and read back.
fn written(index: u16, value: i16, origin: &str) -> ParameterPlan {
    ParameterPlan::entry((index, 0), value.to_le_bytes().to_vec(), origin.to_owned())
}
