//! Which polygons may be the nearest ones: a list for each square of cells.
//!
//! From a place of a tile the nearest polygon is no farther than from the tile's middle and from there to the place; one that is farther from
//! the middle than the nearest and twice as far as the tile's corners is the nearest from nowhere in it.

use crate::Point;
use crate::map::{Map, Solid};

/// The side of a tile, in cells.
const SIDE: usize = 16;
/// From a tile's middle to its corners, in cells.
const HALF_DIAGONAL: f64 = std::f64::consts::FRAC_1_SQRT_2 * SIDE as f64;

/// Of a map's polygons those that count for each tile.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tiles {
    across: usize,
    /// Where in the numbers each tile's begin, and where the last one's end.
    begins: Vec<u32>,
    numbers: Vec<u32>,
}

impl Tiles {
    pub(crate) fn new(map: &Map) -> Tiles {
        if map.solids.is_empty() {
            return Tiles::default();
        }
        let (across, along) = (map.width.div_ceil(SIDE), map.height.div_ceil(SIDE));
        let half = 0.5 * SIDE as f64;
        let mut tiles = Tiles { across, begins: vec![0], numbers: Vec::new() };
        for tile in 0..across * along {
            let middle = [tile % across, tile / across].map(|at| (at * SIDE) as f64 + half);
            let near = |enough, solid: &Solid| solid.distance(middle, enough);
            let nearest = map.solids.iter().fold(f64::INFINITY, near);
            let enough = (nearest + 2.0 * HALF_DIAGONAL).next_up();
            let counts = |(_, solid): &(usize, &Solid)| near(enough, solid) < enough;
            let numbers = map.solids.iter().enumerate().filter(counts).map(|(number, _)| number as u32);
            tiles.numbers.extend(numbers);
            tiles.begins.push(tiles.numbers.len() as u32);
        }
        tiles
    }

    /// Those of which the nearest one to a place in the map, in cells, is one.
    pub(crate) fn nearest<'a>(
        &'a self,
        solids: &'a [Solid],
        [x, y]: Point,
    ) -> impl Iterator<Item = &'a Solid> {
        let tile = (y as usize / SIDE) * self.across + x as usize / SIDE;
        let numbers = match (self.begins.get(tile), self.begins.get(tile + 1)) {
            (Some(begin), Some(end)) => &self.numbers[*begin as usize..*end as usize],
            _ => &[],
        };
        numbers.iter().map(|number| &solids[*number as usize])
    }

    /// Those that may reach nearer to a place in the map than `reach`, in cells.
    pub(crate) fn within<'a>(
        &'a self,
        solids: &'a [Solid],
        place: Point,
        reach: f64,
    ) -> impl Iterator<Item = &'a Solid> {
        // What isn't listed is farther from each place of the tile than its half diagonal.
        let is_listed = reach <= HALF_DIAGONAL;
        let (listed, all) =
            if is_listed { (Some(self.nearest(solids, place)), None) } else { (None, Some(solids)) };
        listed.into_iter().flatten().chain(all.into_iter().flatten())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_tile_no_polygon_is_left_out_that_is_the_nearest_or_within_reach() {
        let mut state = 9_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / (1_u64 << 31) as f64
        };
        let size = [100, 75];
        let mut map = Map::empty(size, 1.0).unwrap();
        for _ in 0..60 {
            let [x, y] = [next() * 100.0, next() * 75.0];
            let corner = |far: f64, turn: f64| [x + far * turn.cos(), y + far * turn.sin()];
            map.block_polygon(&[0.5, 2.6, 4.7].map(|turn| corner(0.2 + 4.0 * next(), turn)));
        }
        let tiles = Tiles::new(&map);
        let mut listed = 0;
        for _ in 0..3000 {
            let place = [next() * 100.0, next() * 75.0];
            let least = |near: f64, solid: &Solid| solid.distance(place, near);
            let nearest = tiles.nearest(&map.solids, place).fold(1e3, least);
            assert!((nearest - map.solids.iter().fold(1e3, least)).abs() < 1e-9, "{place:?}");
            listed += tiles.nearest(&map.solids, place).count();
            for reach in [6.0, 11.0, 30.0] {
                let is_within = |solid: &&Solid| solid.distance(place, reach) < reach;
                let found = tiles.within(&map.solids, place, reach).filter(is_within).count();
                assert_eq!(found, map.solids.iter().filter(is_within).count(), "{place:?}, {reach}");
            }
        }
        assert!(listed < 3000 * 40, "{listed}");
    }
}
