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
        match *bytes {
            [a] => i8::from_le_bytes([a]).into(),
            [a, b] => i16::from_le_bytes([a, b]).into(),
            [a, b, c] => i32::from_le_bytes([0, a, b, c]) >> 8,
            [a, b, c, d] => i32::from_le_bytes([a, b, c, d]),
            _ => 0,
        }
    }

    pub(crate) fn write(self, data: &mut [u8], value: i32) {
        if let Some(bytes) = data.get_mut(self.offset..self.offset + self.bytes) {
            let value = value.to_le_bytes();
            match bytes {
                [a] => *a = value[0],
                [a, b] => [*a, *b] = [value[0], value[1]],
                [a, b, c, d] => [*a, *b, *c, *d] = value,
                _ => bytes.copy_from_slice(&value[..self.bytes]),
            }
        }
    }
}

/// The nearest whole number that fits so many bits with a sign; 0 for NaN.
pub(crate) fn nearest(value: f64, bits: u32) -> i32 {
    let greatest = (1_i64 << (bits - 1)) - 1;
    (value.round() as i64).clamp(-greatest - 1, greatest) as i32
}
