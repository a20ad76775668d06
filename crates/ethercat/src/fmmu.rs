//! FMMUs: which logical bits are which physical ones.

use alloc::vec::Vec;
use core::fmt;

use crate::process_data::{Direction, LogicalBits};
use crate::subdevice::SubDevice;

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
    /// Whether an area goes on where this one ends, in the process image and in the SubDevice's memory.
    fn is_followed_by(&self, logical: LogicalBits, physical_start: u16) -> bool {
        let bits = self.logical.bit_length;
        let ends_on_byte = bits.is_multiple_of(8) && self.logical.start_bit == logical.start_bit;
        ends_on_byte
            && self.logical.address.checked_add(bits / 8) == Some(logical.address)
            && u32::from(self.physical_start) + bits / 8 == u32::from(physical_start)
    }

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

/// Why a SubDevice's FMMUs don't suffice for its place in the process image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FmmuError {
    /// The SubDevice.
    pub position: u16,
    /// Why.
    pub cause: FmmuFailure,
}

/// What is wrong with a set of FMMUs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FmmuFailure {
    /// The controller has fewer than are needed.
    TooFew {
        /// FMMUs needed.
        needed: usize,
        /// FMMUs that the controller has.
        count: u8,
    },
    /// The controller maps whole bytes, the place in the image starts within one.
    NotOnByte(LogicalBits),
}

impl fmt::Display for FmmuError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SubDevice {}: ", self.position)?;
        match self.cause {
            FmmuFailure::TooFew { needed, count } => {
                write!(f, "its process data need {needed} FMMUs, the controller has {count}")
            }
            FmmuFailure::NotOnByte(LogicalBits { address, start_bit, .. }) => write!(
                f,
                "its controller maps whole bytes only, but its data start at bit {start_bit} of logical \
                 0x{address:08x}"
            ),
        }
    }
}

impl core::error::Error for FmmuError {}

/// The FMMUs that put a SubDevice's process data at the logical places of its SyncManagers: outputs first, areas
/// that follow each other on both sides sharing one.
pub fn of_subdevice(subdevice: &SubDevice) -> Result<Vec<Fmmu>, FmmuError> {
    let (position, count) = (subdevice.position, subdevice.esc.fmmu_count);
    let mut fmmus: Vec<Fmmu> = Vec::new();
    for direction in [Direction::Outputs, Direction::Inputs] {
        for manager in subdevice.process_data(direction) {
            let Some(logical) = manager.logical else { continue };
            if !subdevice.esc.maps_bits() && logical.start_bit != 0 {
                return Err(FmmuError { position, cause: FmmuFailure::NotOnByte(logical) });
            }
            let physical_start = manager.area.start;
            match fmmus.last_mut() {
                Some(last) if last.direction == direction && last.is_followed_by(logical, physical_start) => {
                    last.logical.bit_length += logical.bit_length;
                }
                _ => fmmus.push(Fmmu { logical, physical_start, physical_start_bit: 0, direction }),
            }
        }
    }
    if !subdevice.esc.maps_bits() {
        for fmmu in &mut fmmus {
            fmmu.logical.bit_length = fmmu.logical.bit_length.next_multiple_of(8);
        }
    }
    if fmmus.len() > usize::from(count) {
        return Err(FmmuError { position, cause: FmmuFailure::TooFew { needed: fmmus.len(), count } });
    }
    Ok(fmmus)
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
