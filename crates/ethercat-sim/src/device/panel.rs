//! The terminals of a simple I/O device: inputs to set, outputs to look at, while the segment runs.

use omnibase_ethercat_wire::HostTime;
use omnibase_ethercat_wire::coe::ObjectAddress;
use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// What measures, whenever the device reads its terminals, and sets its inputs. It doesn't allocate.
pub type Feed = Box<dyn FnMut(&IoPanel, HostTime) + Send>;

/// Values of process data as a person at the device sees them. Clones show the same device.
///
/// Values are unsigned numbers of the mapped length; setting and reading never wait.
#[derive(Clone, Debug, Default)]
pub struct IoPanel {
    inputs: Arc<[(ObjectAddress, AtomicU64)]>,
    outputs: Arc<[(ObjectAddress, AtomicU64)]>,
    feed: Arc<Mutex<Fed>>,
}

/// What is at its inputs, where that isn't a person.
#[derive(Default)]
struct Fed(Option<Feed>);

impl fmt::Debug for Fed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Fed").field(&self.0.is_some()).finish()
    }
}

impl IoPanel {
    pub(super) fn new(inputs: &[ObjectAddress], outputs: &[ObjectAddress]) -> Self {
        let values = |objects: &[ObjectAddress]| objects.iter().map(|at| (*at, AtomicU64::new(0))).collect();
        IoPanel { inputs: values(inputs), outputs: values(outputs), feed: Arc::default() }
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

    /// From now on something measures at its inputs.
    pub fn feed(&self, feed: Feed) {
        self.feed.lock().unwrap_or_else(PoisonError::into_inner).0 = Some(feed);
    }

    /// The device reads its terminals.
    pub(super) fn measure(&self, now: HostTime) {
        if let Some(feed) = &mut self.feed.lock().unwrap_or_else(PoisonError::into_inner).0 {
            feed(self, now);
        }
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
