//! PDO assignment (0x1C10 and up) and mapping (0x16xx, 0x1Axx): the rules for writing them, and what they amount to.

use super::{Access, Dictionary};
use core::ops::RangeInclusive;
use omnibase_ethercat_wire::bytes::{u16_at, u32_at};
use omnibase_ethercat_wire::coe::{AbortCode, ObjectAddress};

/// RxPDOs: the MainDevice's outputs.
pub const RX_PDOS: RangeInclusive<u16> = 0x1600..=0x17FF;
/// TxPDOs: the MainDevice's inputs.
pub const TX_PDOS: RangeInclusive<u16> = 0x1A00..=0x1BFF;
/// PDO assignment of SyncManagers 0 to 31.
pub const ASSIGNMENTS: RangeInclusive<u16> = 0x1C10..=0x1C2F;
/// Indices up to here in a mapping are data types that fill space, not objects.
const LAST_DUMMY: u16 = 0x001F;

/// Which way process data go, seen from the MainDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// RxPDOs.
    Outputs,
    /// TxPDOs.
    Inputs,
}

impl Direction {
    /// The direction of a PDO by its index; `None` where the index is no PDO's.
    pub fn of_pdo(index: u16) -> Option<Self> {
        if RX_PDOS.contains(&index) {
            Some(Direction::Outputs)
        } else if TX_PDOS.contains(&index) {
            Some(Direction::Inputs)
        } else {
            None
        }
    }

    fn access(self) -> Access {
        match self {
            Direction::Outputs => Access::RX_PDO,
            Direction::Inputs => Access::TX_PDO,
        }
    }
}

/// Whether the object's subindex 0 says how many of its entries count.
pub fn is_pdo_object(index: u16) -> bool {
    Direction::of_pdo(index).is_some() || ASSIGNMENTS.contains(&index)
}

/// One value on its way between process image and dictionary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Copy {
    /// First bit in the SyncManager's area.
    pub image_bit: u32,
    /// First byte in the dictionary's arena.
    pub offset: u32,
    /// Bits.
    pub bits: u16,
}

/// The process image of a SyncManager.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Layout {
    /// What it holds, gaps left out.
    pub copies: Vec<Copy>,
    /// Its length with gaps.
    pub bits: u32,
}

impl Layout {
    /// Bytes of the image.
    pub fn bytes(&self) -> usize {
        self.bits.div_ceil(8) as usize
    }

    /// Moves outputs from `image` into the dictionary. `image` has at least [`Layout::bytes`] bytes.
    #[inline]
    pub fn take(&self, image: &[u8], dictionary: &mut Dictionary) {
        let arena = dictionary.arena_mut();
        for copy in &self.copies {
            let (from, to, bits) = (copy.image_bit as usize, copy.offset as usize, usize::from(copy.bits));
            if (from | bits).is_multiple_of(8) {
                copy_bytes(&image[from / 8..], &mut arena[to..], bits / 8);
            } else {
                copy_bits(image, from, arena, to * 8, bits);
            }
        }
    }

    /// Moves inputs from the dictionary into `image`, which has at least [`Layout::bytes`] bytes.
    #[inline]
    pub fn put(&self, dictionary: &Dictionary, image: &mut [u8]) {
        let arena = dictionary.arena();
        for copy in &self.copies {
            let (to, from, bits) = (copy.image_bit as usize, copy.offset as usize, usize::from(copy.bits));
            if (to | bits).is_multiple_of(8) {
                copy_bytes(&arena[from..], &mut image[to / 8..], bits / 8);
            } else {
                copy_bits(arena, from * 8, image, to, bits);
            }
        }
    }
}

/// Sizes of numbers are copied as such: a general `memcpy` of four bytes costs a call.
#[inline]
fn copy_bytes(from: &[u8], to: &mut [u8], bytes: usize) {
    match bytes {
        1 => to[0] = from[0],
        2 => to[..2].copy_from_slice(&from[..2]),
        4 => to[..4].copy_from_slice(&from[..4]),
        _ => to[..bytes].copy_from_slice(&from[..bytes]),
    }
}

/// Copies `bits` bits between any bit positions (bit 0 is the lowest of byte 0).
pub fn copy_bits(from: &[u8], from_bit: usize, to: &mut [u8], to_bit: usize, bits: usize) {
    for bit in 0..bits {
        let (source, target) = (from_bit + bit, to_bit + bit);
        let mask = 1 << (target % 8);
        if from[source / 8] >> (source % 8) & 1 != 0 {
            to[target / 8] |= mask;
        } else {
            to[target / 8] &= !mask;
        }
    }
}

/// Why an assignment or a mapping can't be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayoutError {
    /// The object in which the mistake is.
    pub at: ObjectAddress,
    /// What an SDO would be refused with.
    pub abort: AbortCode,
}

/// Whether an SDO may write `data` to an entry of an assignment or a mapping, whose rights and length are right.
///
/// While subindex 0 isn't 0, no other entry may be written; when it becomes greater than 0, the entries up to it
/// must make sense. `max_bytes` bounds the mapped length.
pub fn check_write(
    dictionary: &Dictionary,
    address: ObjectAddress,
    data: &[u8],
    max_bytes: usize,
) -> Result<(), AbortCode> {
    if address.subindex != 0 {
        let count = dictionary.peek_number(ObjectAddress::new(address.index, 0)).unwrap_or(0);
        if count != 0 {
            return Err(AbortCode::SUBINDEX_ZERO_FIRST);
        }
        return match Direction::of_pdo(address.index) {
            Some(direction) => check_mapped(dictionary, direction, u32_at(data, 0)).map(|_| ()),
            None => check_assigned(dictionary, u16_at(data, 0)).map(|_| ()),
        };
    }
    let count = data[0];
    let mut bits = 0;
    for subindex in 1..=count {
        let entry = ObjectAddress::new(address.index, subindex);
        let value = dictionary.peek_number(entry).ok_or(AbortCode::VALUE_TOO_HIGH)?;
        bits += match Direction::of_pdo(address.index) {
            Some(direction) => check_mapped(dictionary, direction, value as u32)?,
            None => {
                check_assigned(dictionary, value as u16)?;
                pdo_bits(dictionary, value as u16).map_err(|error| error.abort)?
            }
        };
    }
    if bits.div_ceil(8) as usize > max_bytes { Err(AbortCode::PDO_LENGTH) } else { Ok(()) }
}

/// The process image of the SyncManager whose assignment object is `assignment`.
pub fn layout(dictionary: &Dictionary, assignment: u16, direction: Direction) -> Result<Layout, LayoutError> {
    let mut layout = Layout::default();
    for pdo in listed(dictionary, assignment)? {
        let (at, pdo) = (pdo.0, pdo.1 as u16);
        if Direction::of_pdo(pdo) != Some(direction) {
            return Err(LayoutError { at, abort: AbortCode::NOT_MAPPABLE });
        }
        for (at, mapped) in listed(dictionary, pdo)? {
            let bits = check_mapped(dictionary, direction, mapped as u32)
                .map_err(|abort| LayoutError { at, abort })?;
            if let Some(entry) = dictionary.entry(mapped_object(mapped as u32)) {
                layout.copies.push(Copy {
                    image_bit: layout.bits,
                    offset: entry.offset() as u32,
                    bits: bits as u16,
                });
            }
            layout.bits += bits;
        }
    }
    Ok(layout)
}

/// The PDOs that an assignment object lists.
pub fn assigned(dictionary: &Dictionary, assignment: u16) -> Result<Vec<u16>, LayoutError> {
    Ok(listed(dictionary, assignment)?.into_iter().map(|(_, pdo)| pdo as u16).collect())
}

/// The entries of an object that its subindex 0 counts, with their addresses.
fn listed(dictionary: &Dictionary, index: u16) -> Result<Vec<(ObjectAddress, u64)>, LayoutError> {
    let missing = |at| LayoutError { at, abort: AbortCode::NO_SUCH_OBJECT };
    let first = ObjectAddress::new(index, 0);
    let count = dictionary.peek_number(first).ok_or(missing(first))?;
    (1..=count.min(255) as u8)
        .map(|subindex| {
            let at = ObjectAddress::new(index, subindex);
            dictionary.peek_number(at).map(|value| (at, value)).ok_or(missing(at))
        })
        .collect()
}

/// Bits that a PDO maps.
fn pdo_bits(dictionary: &Dictionary, pdo: u16) -> Result<u32, LayoutError> {
    Ok(listed(dictionary, pdo)?.iter().map(|(_, mapped)| *mapped as u32 & 0xFF).sum())
}

fn mapped_object(mapped: u32) -> ObjectAddress {
    ObjectAddress::new((mapped >> 16) as u16, (mapped >> 8) as u8)
}

/// Bits of a mapping entry, where the object exists, may be mapped this way, and has that length.
fn check_mapped(dictionary: &Dictionary, direction: Direction, mapped: u32) -> Result<u32, AbortCode> {
    let (object, bits) = (mapped_object(mapped), mapped & 0xFF);
    if object.index <= LAST_DUMMY {
        return Ok(bits);
    }
    if dictionary.object(object.index).is_none() {
        return Err(AbortCode::NO_SUCH_OBJECT);
    }
    let entry = dictionary.entry(object).ok_or(AbortCode::NO_SUCH_SUBINDEX)?;
    if !entry.access.contains(direction.access()) || u32::from(entry.bit_length) != bits {
        return Err(AbortCode::NOT_MAPPABLE);
    }
    Ok(bits)
}

fn check_assigned(dictionary: &Dictionary, pdo: u16) -> Result<(), AbortCode> {
    if Direction::of_pdo(pdo).is_none() || dictionary.object(pdo).is_none() {
        return Err(AbortCode::NOT_MAPPABLE);
    }
    Ok(())
}
