//! FMMUs: which logical bits are which physical ones.

use crate::subdevice::{Direction, LogicalBits};

/// An FMMU in use, to the bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fmmu {
    /// Where in the logical address space.
    pub logical: LogicalBits,
    /// First byte in the SubDevice's memory.
    pub physical_start: u16,
    /// First bit in that byte, 0 to 7.
    pub physical_start_bit: u8,
    /// Which accesses it answers.
    pub direction: Direction,
}

impl Fmmu {
    /// Its sixteen registers from 0x0600 + 16n, switched on.
    ///
    /// Length counts every logical byte that is touched, first and last bit are those of the first and the last
    /// byte (ETG.1000.4, "FMMU").
    pub fn registers(&self) -> [u8; 16] {
        let end = u32::from(self.logical.start_bit) + self.logical.bit_length;
        let length = (end.div_ceil(8) as u16).to_le_bytes();
        let stop_bit = (end.wrapping_sub(1) % 8) as u8;
        let address = self.logical.address.to_le_bytes();
        let physical = self.physical_start.to_le_bytes();
        let kind = match self.direction {
            Direction::Inputs => 1,
            Direction::Outputs => 2,
        };
        let mut registers = [0; 16];
        registers[..4].copy_from_slice(&address);
        registers[4..6].copy_from_slice(&length);
        registers[6] = self.logical.start_bit;
        registers[7] = stop_bit;
        registers[8..10].copy_from_slice(&physical);
        registers[10] = self.physical_start_bit;
        registers[11] = kind;
        registers[12] = 1;
        registers
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_bits_in_the_middle_of_a_byte() {
        let fmmu = Fmmu {
            logical: LogicalBits { address: 0x0001_0002, start_bit: 4, bit_length: 4 },
            physical_start: 0x0F00,
            physical_start_bit: 0,
            direction: Direction::Outputs,
        };
        assert_eq!(fmmu.registers(), [0x02, 0, 1, 0, 1, 0, 4, 7, 0x00, 0x0F, 0, 2, 1, 0, 0, 0]);
    }

    #[test]
    fn bits_across_a_byte_boundary_touch_both_bytes() {
        let fmmu = Fmmu {
            logical: LogicalBits { address: 0, start_bit: 6, bit_length: 4 },
            physical_start: 0x1000,
            physical_start_bit: 0,
            direction: Direction::Inputs,
        };
        let registers = fmmu.registers();
        assert_eq!((registers[4], registers[6], registers[7], registers[11]), (2, 6, 1, 1));
    }
}
