//! Where a drive's objects stand in the process data that it maps by itself.

use std::ops::Range;

use omnibase_ethercat::image::ImagePlan;
use omnibase_ethercat::subdevice::{Direction, SubDevice};

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
}

/// An object that must be mapped and isn't.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "SubDevice {position}: its map has no 0x{object:04X} of {bits} bits at a whole byte: write a map with it (its maker's \
     file or `omnibase scan` shows what it can map), or jog it by its maker's tool"
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
            position: need(Direction::Inputs, 0x6064, 32)?,
            error: find(Direction::Inputs, 0x603F, 16),
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
    for manager in one.process_data(direction) {
        let mut placements = plan.placements_of(one.position).iter();
        let Some(place) =
            placements.find(|place| place.direction == direction && place.sync_manager == manager.index)
        else {
            continue;
        };
        let mut bit = usize::from(place.logical.start_bit);
        for entry in manager.pdos.iter().flat_map(|pdo| &pdo.entries) {
            let is_it = (entry.object.index, entry.object.subindex, entry.bit_length) == (object, 0, bits);
            if is_it && bit.is_multiple_of(8) {
                let first = place.offset + bit / 8;
                return Some(first..first + usize::from(bits) / 8);
            }
            bit += usize::from(entry.bit_length);
        }
    }
    None
}
