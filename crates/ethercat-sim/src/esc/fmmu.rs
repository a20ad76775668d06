//! A fieldbus memory management unit: which bits of the logical image are which bits of the memory.

use core::ops::Range;
use omnibase_ethercat_wire::bytes::{u16_at, u32_at};

/// One FMMU, decoded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fmmu {
    /// First byte of the logical image.
    pub logical: u32,
    /// Bytes of the logical image that it touches.
    pub length: u16,
    /// First bit in the first byte.
    pub start_bit: u8,
    /// Last bit in the last byte.
    pub stop_bit: u8,
    /// First byte of memory.
    pub physical: u16,
    /// First bit there.
    pub physical_bit: u8,
    /// Logical reads use it.
    pub reads: bool,
    /// Logical writes use it.
    pub writes: bool,
}

impl Fmmu {
    /// Decodes 16 bytes of registers; `None` where it is off or maps nothing.
    pub fn decode(registers: &[u8]) -> Option<Self> {
        let length = u16_at(registers, 4);
        if registers[12] & 1 == 0 || length == 0 {
            return None;
        }
        let fmmu = Fmmu {
            logical: u32_at(registers, 0),
            length,
            start_bit: registers[6] & 7,
            stop_bit: registers[7] & 7,
            physical: u16_at(registers, 8),
            physical_bit: registers[10] & 7,
            reads: registers[11] & 1 != 0,
            writes: registers[11] & 2 != 0,
        };
        (fmmu.bits() > 0).then_some(fmmu)
    }

    /// Whether whole bytes are mapped on whole bytes.
    pub fn bytewise(&self) -> bool {
        self.start_bit == 0 && self.stop_bit == 7 && self.physical_bit == 0
    }

    /// Number of bits mapped.
    pub fn bits(&self) -> usize {
        (usize::from(self.length) * 8 + usize::from(self.stop_bit) + 1)
            .saturating_sub(8 + usize::from(self.start_bit))
    }

    /// The bytes of a datagram at `logical` with `length` bytes that this FMMU touches.
    pub fn overlap(&self, logical: u32, length: usize) -> Option<Range<usize>> {
        let (own, other) = (u64::from(self.logical), u64::from(logical));
        let start = own.max(other);
        let end = (own + u64::from(self.length)).min(other + length as u64);
        (start < end).then(|| (start - other) as usize..(end - other) as usize)
    }

    /// The mapped bits inside bytes `bytes` of a datagram at `logical`, as indices from the FMMU's first bit.
    pub fn bits_in(&self, logical: u32, bytes: &Range<usize>) -> Range<usize> {
        let first = u64::from(logical) + bytes.start as u64 - u64::from(self.logical);
        let start_bit = usize::from(self.start_bit);
        let from = (first as usize * 8).saturating_sub(start_bit);
        let to = ((first as usize + bytes.len()) * 8 - start_bit.min(bytes.len() * 8)).min(self.bits());
        from..to.max(from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fmmu(logical: u32, length: u16, start_bit: u8, stop_bit: u8) -> Fmmu {
        Fmmu {
            logical,
            length,
            start_bit,
            stop_bit,
            physical: 0x1000,
            physical_bit: 3,
            reads: true,
            writes: false,
        }
    }

    #[test]
    fn bits_are_counted_from_start_bit_to_stop_bit() {
        assert_eq!(fmmu(0, 1, 2, 5).bits(), 4);
        assert_eq!(fmmu(0, 2, 6, 1).bits(), 4);
        assert_eq!(fmmu(0, 1, 5, 2).bits(), 0);
        assert_eq!(fmmu(0, 3, 0, 7).bits(), 24);
    }

    #[test]
    fn a_datagram_sees_the_bits_of_its_own_bytes() {
        let f = fmmu(0x100, 2, 6, 1);
        assert_eq!(f.overlap(0xF0, 0x10), None);
        let bytes = f.overlap(0xF0, 0x11).unwrap();
        assert_eq!(bytes, 0x10..0x11);
        assert_eq!(f.bits_in(0xF0, &bytes), 0..2);
        let bytes = f.overlap(0x101, 5).unwrap();
        assert_eq!(bytes, 0..1);
        assert_eq!(f.bits_in(0x101, &bytes), 2..4);
    }

    #[test]
    fn the_end_of_the_logical_space_is_no_trap() {
        let f = fmmu(0xFFFF_FFFF, 16, 0, 7);
        assert_eq!(f.overlap(0xFFFF_FFF0, 64), Some(15..31));
    }
}
