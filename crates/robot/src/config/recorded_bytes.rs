//! Which bytes of the SubDevices' process data a cycle's record keeps.

use std::ops::Range;

use super::device_plan::{Coding, DevicePlan};
use crate::signals::MAX_DEVICE_BYTES;

/// The recorded bytes of one direction of a SubDevice.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct RecordedBytes {
    /// Where they stand in its process data, ascending.
    parts: Vec<Range<usize>>,
}

impl RecordedBytes {
    fn all(length: usize) -> Self {
        RecordedBytes { parts: std::iter::once(0..length).collect() }
    }

    /// Those in which a signal has a bit.
    fn of_signals(codings: Vec<Coding>) -> Self {
        let mut bytes: Vec<usize> = codings.iter().flat_map(Coding::bytes).collect();
        bytes.sort_unstable();
        bytes.dedup();
        let mut parts: Vec<Range<usize>> = Vec::new();
        for byte in bytes {
            match parts.last_mut() {
                Some(last) if last.end == byte => last.end += 1,
                _ => parts.push(byte..byte + 1),
            }
        }
        RecordedBytes { parts }
    }

    /// How many they are.
    pub(crate) fn count(&self) -> usize {
        self.parts.iter().map(Range::len).sum()
    }

    /// Takes them from process data; both are at least as long as they need.
    pub(crate) fn keep(&self, process_data: &[u8], recorded: &mut [u8]) {
        let mut at = 0;
        for part in &self.parts {
            recorded[at..at + part.len()].copy_from_slice(&process_data[part.clone()]);
            at += part.len();
        }
    }

    /// Makes process data of them: 0 in between; both are at least as long as they need.
    pub(crate) fn restore(&self, recorded: &[u8], process_data: &mut [u8]) {
        process_data.fill(0);
        let mut at = 0;
        for part in &self.parts {
            process_data[part.clone()].copy_from_slice(&recorded[at..at + part.len()]);
            at += part.len();
        }
    }
}

/// The recorded bytes of each SubDevice's inputs.
pub(crate) fn of_inputs(devices: &[DevicePlan]) -> Vec<RecordedBytes> {
    let coding = |device: &DevicePlan| device.input.iter().filter_map(|one| one.coding).collect();
    chosen(devices, DevicePlan::input_bytes, coding)
}

/// The recorded bytes of each SubDevice's outputs.
pub(crate) fn of_outputs(devices: &[DevicePlan]) -> Vec<RecordedBytes> {
    let coding = |device: &DevicePlan| device.output.iter().filter_map(|one| one.coding).collect();
    chosen(devices, DevicePlan::output_bytes, coding)
}

/// All bytes where those of all SubDevices fit into a record, else those of the signals where a kind reads and writes
/// nothing else.
fn chosen(
    devices: &[DevicePlan],
    length: impl Fn(&DevicePlan) -> usize,
    codings: impl Fn(&DevicePlan) -> Vec<Coding>,
) -> Vec<RecordedBytes> {
    let all_fit = devices.iter().map(&length).sum::<usize>() <= MAX_DEVICE_BYTES;
    let of = |device: &DevicePlan| match device.by_signals && !all_fit {
        true => RecordedBytes::of_signals(codings(device)),
        false => RecordedBytes::all(length(device)),
    };
    devices.iter().map(of).collect()
}
