//! Which addresses a start gives: none of those that SubDevices have, and hardly any of a start before.
//!
//! A part of the segment that keeps its supply while it is unplugged keeps the station addresses and the logical ones of the start
//! that it took part in. Were they given to others meanwhile, two would answer at once when it is plugged in again. Nobody tells
//! whether there is such a part, so a start begins anywhere.

use crate::image::LOGICAL_START;

/// The first station address, and where nothing speaks for another one.
const FIRST: u16 = 0x1001;
/// Station addresses that are given.
const STATIONS: u32 = 0xE000;
/// Logical addresses of a SubDevice: it has no more memory.
const LOGICAL_BITS: u32 = 16;

/// The first of `count` station addresses in a row. `before` are those that the SubDevices have now, 0 where they have none, as
/// after power-on; `chance` is another number at each start, and 0 begins with the first address.
pub(crate) fn first_station(before: impl Iterator<Item = u16> + Clone, count: u16, chance: u64) -> u16 {
    let places = STATIONS.saturating_sub(count.into()).max(1);
    let taken = before.map(|station| u32::from(station.saturating_sub(FIRST - 1)));
    // Knuth's multiplicative hash spreads what differs in its low bits alone.
    let mut first = (chance.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32) as u32 % places;
    // Behind whoever is in the way, as often as there may be somebody.
    for _ in 0..=taken.clone().count() {
        let own = first + 1..=first + u32::from(count);
        let Some(last) = taken.clone().filter(|station| own.contains(station)).max() else { break };
        first = last % places;
    }
    FIRST + first as u16
}

/// Where process data begin in the logical address space, by the first SubDevice's station address: as many SubDevices as follow
/// each other have room behind it.
pub(crate) fn logical_start(station: u16) -> u32 {
    LOGICAL_START + (u32::from(station.saturating_sub(FIRST)) << LOGICAL_BITS)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn next(before: &[u16], count: u16, chance: u64) -> u16 {
        first_station(before.iter().copied(), count, chance)
    }

    #[test]
    fn no_start_gives_what_somebody_has() {
        assert_eq!(next(&[0, 0], 2, 0), 0x1001);
        assert_eq!(next(&[0x1001, 0], 2, 0), 0x1002);
        assert_eq!(next(&[0x1003, 0x1001, 0x1002], 3, 0), 0x1004);
        assert_eq!(next(&[0xF000], 2, 0), 0x1001);
        let before: Vec<u16> = (0..40).map(|number| 0x1001 + 1400 * number).collect();
        for chance in 0..2000 {
            let first = next(&before, 900, chance);
            let given = first..first + 900;
            assert!(before.iter().all(|station| !given.contains(station)), "{chance}: {first}");
        }
    }

    /// A part of the segment that is away and keeps its addresses is met by one start in hundreds, though all others were without
    /// power.
    #[test]
    fn starts_begin_anywhere() {
        let starts = 100_000;
        let meets = |chance: &u64| (0x1001 - 10..0x1001 + 10).contains(&next(&[0; 10], 10, *chance));
        let met = (0..starts).map(|start| start * 1_000_003).filter(meets).count();
        assert!(met < starts as usize / 1000, "{met}");
    }

    #[test]
    fn process_data_of_two_starts_are_apart_where_the_stations_are() {
        assert_eq!([0x1001, 0x1002, 0xF000].map(logical_start), [0x1_0000, 0x2_0000, 0xDFFF_0000 + 0x1_0000]);
    }
}
