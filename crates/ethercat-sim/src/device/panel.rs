//! The terminals of a simple I/O device: inputs to set, outputs to look at, while the segment runs.

use crate::dictionary::little_endian;
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
    inputs: Arc<[(ObjectAddress, Words)]>,
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

/// The most bytes of an entry of a PDO, which has 255 bits at most.
pub const MOST_BYTES: usize = 32;
/// They in numbers of 8 bytes.
type Words = [AtomicU64; MOST_BYTES / 8];

impl IoPanel {
    pub(super) fn new(inputs: &[ObjectAddress], outputs: &[ObjectAddress]) -> Self {
        IoPanel {
            inputs: inputs.iter().map(|at| (*at, Words::default())).collect(),
            outputs: outputs.iter().map(|at| (*at, AtomicU64::new(0))).collect(),
            feed: Arc::default(),
        }
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
        let mut bytes = [0; MOST_BYTES];
        bytes[..8].copy_from_slice(&value.to_le_bytes());
        self.set_input_bytes(object, &bytes)
    }

    /// The same for an input of any length, byte by byte as they stand in the process data.
    pub fn set_input_bytes(&self, object: ObjectAddress, bytes: &[u8; MOST_BYTES]) -> bool {
        let Some(words) = find(&self.inputs, object) else { return false };
        for (word, bytes) in words.iter().zip(bytes.chunks_exact(8)) {
            word.store(little_endian(bytes), Ordering::Relaxed);
        }
        true
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

    pub(super) fn input_at(&self, position: usize) -> [u8; MOST_BYTES] {
        let mut all = [0; MOST_BYTES];
        for (word, bytes) in self.inputs[position].1.iter().zip(all.chunks_exact_mut(8)) {
            bytes.copy_from_slice(&word.load(Ordering::Relaxed).to_le_bytes());
        }
        all
    }

    pub(super) fn set_output_at(&self, position: usize, value: u64) {
        self.outputs[position].1.store(value, Ordering::Relaxed);
    }
}

fn find<Value>(values: &[(ObjectAddress, Value)], object: ObjectAddress) -> Option<&Value> {
    values.iter().find(|(at, _)| *at == object).map(|(_, value)| value)
}
