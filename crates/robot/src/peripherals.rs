//! Peripherals: SubDevices that drive no wheel, between their process data and their signals.

mod axis;
mod cyclic;
mod io;
mod sources;

use crate::registry::{Kind, PeripheralDefaults, Registry, needed, optional};
use crate::stages::Peripheral;

pub use axis::Axis;
pub(crate) use cyclic::Peripherals;
pub use io::Io;

/// The name of the kind [`Ignored`].
pub const IGNORE: &str = "ignore";
/// The name of the kind [`Axis`].
pub const AXIS: &str = "axis";

/// A SubDevice that is brought along as it describes itself: nobody reads its inputs, its outputs stay 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ignored;

impl Peripheral for Ignored {}

/// Registers the built-in kinds.
pub fn register(registry: &mut Registry) {
    let ignore = Kind {
        name: IGNORE,
        meaning: "Brought along as it describes itself; nobody reads its inputs, its outputs stay 0",
        keys: Vec::new(),
    };
    registry.peripherals.add(ignore, PeripheralDefaults::default(), |_| Ok(Ignored));
    let io = Kind {
        name: "io",
        meaning: "Digital and analog inputs and outputs, as its tables say",
        keys: ["inputs", "outputs", "input", "output", "parameters"].map(optional).into(),
    };
    registry.peripherals.add(io, PeripheralDefaults { by_signals: true, ..Default::default() }, Io::new);
    let axis = Kind {
        name: AXIS,
        meaning: "A drive of the profile CiA 402 that turns no wheel: a lift, a joint, a turret",
        keys: [needed("axis")].into_iter().chain(["inputs", "outputs", "parameters"].map(optional)).collect(),
    };
    registry.peripherals.add(axis, axis::defaults(), Axis::new);
}
