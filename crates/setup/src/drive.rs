//! Where a drive's objects stand in its process data.

use std::ops::Range;

use omnibase_ethercat::image::{ImagePlan, Placement};
use omnibase_ethercat::subdevice::{Direction, MappedObject, SubDevice};
use omnibase_ethercat::wire::coe::ObjectAddress;

/// Below it are gaps, and data types that stand for gaps.
pub(crate) const FIRST_OBJECT: u16 = 0x1000;

const POSITION: u16 = 0x6064;

/// Bytes of the objects that a jog needs, in the whole image.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DriveMap {
    /// Control word, 0x6040.
    pub control: Range<usize>,
    /// Mode, 0x6060; `None` where it is written once, by SDO.
    pub mode: Option<Range<usize>>,
    /// Target velocity, 0x60FF.
    pub velocity: Range<usize>,
    /// Max torque, 0x6072; `None` where it is written once, by SDO.
    pub torque_limit: Option<Range<usize>>,
    /// Status word, 0x6041.
    pub status: Range<usize>,
    /// Mode that runs, 0x6061.
    pub mode_shown: Option<Range<usize>>,
    /// Position, 0x6064.
    pub position: Range<usize>,
    /// Error code, 0x603F.
    pub error: Option<Range<usize>>,
    /// All that the drive says beside its position.
    pub others: Vec<Range<usize>>,
}

/// An object that must be mapped and isn't.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "SubDevice {position}: its map has no 0x{object:04X} of {bits} bits at a whole byte: give its drive in the \
     robot's file `outputs` and `inputs` with it (its maker's file or `omnibase scan` shows what it can map), or jog it by its maker's tool"
)]
pub struct MapProblem {
    /// The SubDevice.
    pub position: u16,
    /// The object.
    pub object: u16,
    /// Its bits.
    pub bits: u8,
}

impl DriveMap {
    /// The map of a SubDevice that is configured.
    pub fn of(one: &SubDevice, plan: &ImagePlan) -> Result<Self, MapProblem> {
        let position = one.position;
        let find = |direction, object, bits| bytes(one, plan, direction, object, bits);
        let need = |direction, object, bits| {
            find(direction, object, bits).ok_or(MapProblem { position, object, bits })
        };
        Ok(DriveMap {
            control: need(Direction::Outputs, 0x6040, 16)?,
            mode: find(Direction::Outputs, 0x6060, 8),
            velocity: need(Direction::Outputs, 0x60FF, 32)?,
            torque_limit: find(Direction::Outputs, 0x6072, 16),
            status: need(Direction::Inputs, 0x6041, 16)?,
            mode_shown: find(Direction::Inputs, 0x6061, 8),
            position: need(Direction::Inputs, POSITION, 32)?,
            error: find(Direction::Inputs, 0x603F, 16),
            others: mapped(one, plan, Direction::Inputs)
                .into_iter()
                .filter(|(entry, _)| entry.object.index != POSITION)
                .map(|(entry, bit)| bit / 8..(bit + usize::from(entry.bit_length)).div_ceil(8))
                .collect(),
        })
    }
}

fn bytes(
    one: &SubDevice,
    plan: &ImagePlan,
    direction: Direction,
    object: u16,
    bits: u8,
) -> Option<Range<usize>> {
    let wanted = (ObjectAddress::new(object, 0), bits);
    let mut all = mapped(one, plan, direction).into_iter();
    let (_, bit) = all.find(|(entry, bit)| (entry.object, entry.bit_length) == wanted && bit % 8 == 0)?;
    Some(bit / 8..(bit + usize::from(bits)) / 8)
}

/// What a SubDevice maps in one direction, gaps left out, and the bit of the whole image at which each begins.
pub(crate) fn mapped<'a>(
    one: &'a SubDevice,
    plan: &ImagePlan,
    direction: Direction,
) -> Vec<(&'a MappedObject, usize)> {
    let mut all = Vec::new();
    for manager in one.process_data(direction) {
        let mut placements = plan.placements_of(one.position).iter();
        let is_its = |place: &&Placement| (place.direction, place.sync_manager) == (direction, manager.index);
        let Some(place) = placements.find(is_its) else { continue };
        let mut bit = 8 * place.offset + usize::from(place.logical.start_bit);
        for entry in manager.pdos.iter().flat_map(|pdo| &pdo.entries) {
            if entry.object.index >= FIRST_OBJECT {
                all.push((entry, bit));
            }
            bit += usize::from(entry.bit_length);
        }
    }
    all
}

/// Puts so many bits of a number, the least first, into an image from this bit on.
pub(crate) fn put_bits(image: &mut [u8], first: usize, bits: u8, number: &[u8]) {
    for at in 0..usize::from(bits) {
        let is_set = number.get(at / 8).is_some_and(|byte| byte >> (at % 8) & 1 == 1);
        let (byte, mask) = ((first + at) / 8, 1 << ((first + at) % 8));
        image[byte] = if is_set { image[byte] | mask } else { image[byte] & !mask };
    }
}

/// Objects that are mapped and their bits: outputs, inputs.
pub(crate) type Objects = [Vec<(ObjectAddress, u8)>; 2];

/// Whether all that a jog needs is among them.
pub(crate) fn can_be_jogged([outputs, inputs]: &Objects) -> bool {
    let has =
        |all: &[(ObjectAddress, u8)], object, bits| all.contains(&(ObjectAddress::new(object, 0), bits));
    has(outputs, 0x6040, 16)
        && has(outputs, 0x60FF, 32)
        && has(inputs, 0x6041, 16)
        && has(inputs, POSITION, 32)
}

#[cfg(test)]
mod tests {
    use super::put_bits;

    #[test]
    fn bits_of_a_number_stand_where_they_belong_and_no_other_changes() {
        let mut image = [0xFF, 0x00, 0xFF];
        put_bits(&mut image, 6, 7, &[0b010_1010]);
        assert_eq!(image, [0b1011_1111, 0b0000_1010, 0xFF]);
        put_bits(&mut image, 8, 16, &[0x34, 0x12]);
        assert_eq!(image, [0b1011_1111, 0x34, 0x12]);
    }
}
