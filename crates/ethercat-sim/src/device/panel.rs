//! The terminals of a simple I/O device: inputs to set, outputs to look at, while the segment runs.

use omnibase_ethercat_wire::coe::ObjectAddress;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Values of process data as a person at the device sees them. Clones show the same device.
///
/// Values are unsigned numbers of the mapped length; setting and reading never wait.
#[derive(Clone, Debug, Default)]
pub struct IoPanel {
    inputs: Arc<[(ObjectAddress, AtomicU64)]>,
    outputs: Arc<[(ObjectAddress, AtomicU64)]>,
}

impl IoPanel {
    pub(super) fn new(inputs: &[ObjectAddress], outputs: &[ObjectAddress]) -> Self {
        let values = |objects: &[ObjectAddress]| objects.iter().map(|at| (*at, AtomicU64::new(0))).collect();
        IoPanel { inputs: values(inputs), outputs: values(outputs) }
    }

    /// Objects that the MainDevice reads.
    pub fn inputs(&self) -> impl Iterator<Item = ObjectAddress> {
        self.inputs.iter().map(|(object, _)| *object)
    }

    /// Objects that the MainDevice writes.
    pub fn outputs(&self) -> impl Iterator<Item = ObjectAddress> {
        self.outputs.iter().map(|(object, _)| *object)
    }

    /// Sets an input; `false` where the device has none at this address.
    pub fn set_input(&self, object: ObjectAddress, value: u64) -> bool {
        find(&self.inputs, object).map(|input| input.store(value, Ordering::Relaxed)).is_some()
    }

    /// An output as the device gives it now; `None` where the device has none at this address.
    pub fn output(&self, object: ObjectAddress) -> Option<u64> {
        find(&self.outputs, object).map(|output| output.load(Ordering::Relaxed))
    }

    pub(super) fn input_at(&self, position: usize) -> u64 {
        self.inputs[position].1.load(Ordering::Relaxed)
    }

    pub(super) fn set_output_at(&self, position: usize, value: u64) {
        self.outputs[position].1.store(value, Ordering::Relaxed);
    }
}

fn find(values: &[(ObjectAddress, AtomicU64)], object: ObjectAddress) -> Option<&AtomicU64> {
    values.iter().find(|(at, _)| *at == object).map(|(_, value)| value)
}
