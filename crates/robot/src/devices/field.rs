//! Objects in a drive's process data.

use crate::config::{PdoPlan, Problem};
use crate::registry::{Made, StageError};

/// Where an object lies in a drive's process data; whole bytes only.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Field {
    offset: usize,
    bytes: usize,
}

impl Field {
    pub(crate) fn find(pdos: &[PdoPlan], index: u16, subindex: u8) -> Option<Field> {
        let (bit, bits) = crate::config::find_object(pdos, index, subindex)?;
        (bit % 8 == 0 && bits % 8 == 0 && bits <= 32)
            .then_some(Field { offset: bit as usize / 8, bytes: usize::from(bits / 8) })
    }

    /// One that a drive can't do without; `what` it is, in words.
    pub(crate) fn needed(pdos: &[PdoPlan], index: u16, what: &str) -> Made<Field> {
        let reason = format!("{what} ({index:04X}) must be mapped, whole and at a byte");
        Field::find(pdos, index, 0).ok_or_else(|| StageError::from(Problem::refused("", reason)))
    }

    /// The value, its sign extended; 0 where the data is too short.
    pub(crate) fn read(self, data: &[u8]) -> i32 {
        let Some(bytes) = data.get(self.offset..self.offset + self.bytes) else { return 0 };
        let raw = bytes.iter().rev().fold(0_u32, |value, byte| value << 8 | u32::from(*byte));
        let unused = 32 - 8 * self.bytes as u32;
        ((raw << unused) as i32) >> unused
    }

    pub(crate) fn write(self, data: &mut [u8], value: i32) {
        if let Some(bytes) = data.get_mut(self.offset..self.offset + self.bytes) {
            bytes.copy_from_slice(&value.to_le_bytes()[..self.bytes]);
        }
    }
}

/// The nearest whole number that fits so many bits with a sign; 0 for NaN.
pub(crate) fn nearest(value: f64, bits: u32) -> i32 {
    let greatest = (1_i64 << (bits - 1)) - 1;
    (value.round() as i64).clamp(-greatest - 1, greatest) as i32
}
