//! Devices: between a drive's process data and its wheel's units.

mod cia402;
mod sgdv;

use crate::config::{MapEntry, PdoPlan};
use crate::registry::{DeviceDefaults, Registry};

pub use cia402::Cia402Device;
pub(crate) use cia402::mode_of;

/// Registers the built-in devices: `cia402` and `sgdv`.
pub fn register(registry: &mut Registry) {
    let make = |plan: &crate::config::DrivePlan| -> Result<Box<dyn crate::stages::Device>, _> {
        Ok(Box::new(Cia402Device::new(plan)?))
    };
    registry.device("cia402", cia402::defaults(), make);
    registry.device("sgdv", sgdv::defaults(), make);
}

/// A PDO of objects `(index, subindex, bits)`.
fn pdo(index: u16, entries: &[(u16, u8, u8)]) -> PdoPlan {
    let entry = |&(index, subindex, bits): &(u16, u8, u8)| MapEntry { index, subindex, bits };
    PdoPlan { index, entries: entries.iter().map(entry).collect() }
}
