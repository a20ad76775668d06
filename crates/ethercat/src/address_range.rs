//! Which addresses a start gives: others than the start before it.
//!
//! A part of the segment that keeps its supply while it is unplugged keeps the station addresses and the logical ones of the start
//! that it took part in. Were they given to others meanwhile, two would answer at once when it is plugged in again.

use crate::image::LOGICAL_START;

/// Station address of the first SubDevice in the first range.
const FIRST: u16 = 0x1001;
/// Addresses of a range.
const LENGTH: u16 = 0x0E00;
/// Ranges, taken in turn.
const RANGES: u16 = 16;
/// Logical addresses of a range: a power of two that no process image reaches.
const LOGICAL_BITS: u32 = 24;

/// The first of `count` station addresses, behind the range of those that the SubDevices have: 0 is none, as after power-on. More
/// than a range holds begin with the first.
pub(crate) fn first_station(before: impl Iterator<Item = u16>, count: u16) -> u16 {
    let latest = before.filter(|station| *station >= FIRST).map(range).max();
    match latest.filter(|_| count <= LENGTH) {
        Some(latest) => FIRST + (latest + 1) % RANGES * LENGTH,
        None => FIRST,
    }
}

/// Where process data begin in the logical address space, by the first SubDevice's station address.
pub(crate) fn logical_start(station: u16) -> u32 {
    LOGICAL_START + (u32::from(range(station)) << LOGICAL_BITS)
}

fn range(station: u16) -> u16 {
    (station.saturating_sub(FIRST) / LENGTH).min(RANGES - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_start_gives_what_the_one_before_gave() {
        let next = |before: &[u16], count| first_station(before.iter().copied(), count);
        assert_eq!(next(&[0, 0], 2), 0x1001);
        assert_eq!(next(&[0x1001, 0], 2), 0x1E01);
        // Who was away for a start comes back with what was given before.
        assert_eq!(next(&[0x1001, 0x1E01], 2), 0x2C01);
        assert_eq!(next(&[0xF000], 2), 0x1001);
        assert_eq!(next(&[0x1001], 0x0E00), 0x1E01);
        assert_eq!(next(&[0x1001], 0x0E01), 0x1001);
        assert_eq!(
            [0x1001, 0x1E00, 0x1E01, 0xF000].map(logical_start),
            [0x1_0000, 0x1_0000, 0x101_0000, 0xF01_0000]
        );
    }
}
