//! Polygons that are in the way exactly, not by the cells that they touch.

use crate::Point;

/// How far shapes may reach into each other, in cells: rounding.
const TOUCH: f64 = 1e-9;

/// A closed polygon, in cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    corners: Vec<Point>,
    low: Point,
    high: Point,
}

impl Solid {
    pub(super) fn new(corners: Vec<Point>) -> Self {
        let [low, high] = range(&corners);
        Solid { corners, low, high }
    }

    /// Its corners, in cells.
    pub(crate) fn corners(&self) -> &[Point] {
        &self.corners
    }

    fn sides(&self) -> impl Iterator<Item = [Point; 2]> + '_ {
        let count = self.corners.len();
        (0..count).map(move |at| [self.corners[at], self.corners[(at + 1) % count]])
    }

    fn is_near(&self, low: Point, high: Point) -> bool {
        (0..2).all(|axis| self.low[axis] < high[axis] - TOUCH && self.high[axis] > low[axis] + TOUCH)
    }

    /// Whether a place lies inside: a ray from it crosses an odd number of sides.
    fn holds(&self, [x, y]: Point) -> bool {
        let crosses = |[from, to]: &[Point; 2]| {
            (from[1] > y) != (to[1] > y)
                && x < from[0] + (y - from[1]) / (to[1] - from[1]) * (to[0] - from[0])
        };
        self.sides().filter(crosses).count() % 2 == 1
    }

    /// Whether a convex polygon, counter-clockwise, of which this is the range, overlaps it.
    pub(crate) fn overlaps(&self, convex: &[Point], [low, high]: [Point; 2]) -> bool {
        self.is_near(low, high)
            && (self.holds(convex[0]) || self.sides().any(|side| goes_through(side, convex)))
    }

    /// From a place to it, 0 inside, or something that isn't below `enough`.
    pub(crate) fn distance(&self, [x, y]: Point, enough: f64) -> f64 {
        let off = |axis: usize, at: f64| (self.low[axis] - at).max(at - self.high[axis]).max(0.0);
        let (across, along) = (off(0, x), off(1, y));
        if across * across + along * along >= enough * enough {
            return enough;
        }
        if self.holds([x, y]) {
            return 0.0;
        }
        let squares = self.sides().map(|side| square_distance([x, y], side));
        squares.fold(enough * enough, f64::min).sqrt()
    }
}

/// The least and the greatest coordinates of corners.
pub(crate) fn range(corners: &[Point]) -> [Point; 2] {
    let far = |pick: fn(f64, f64) -> f64, from: f64| {
        [0, 1].map(|axis| corners.iter().map(|corner| corner[axis]).fold(from, pick))
    };
    [far(f64::min, f64::INFINITY), far(f64::max, f64::NEG_INFINITY)]
}

/// Whether a piece of a line goes through the inside of a convex polygon (Cyrus and Beck's clipping).
fn goes_through([from, to]: [Point; 2], convex: &[Point]) -> bool {
    let way = [to[0] - from[0], to[1] - from[1]];
    let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
    for (at, corner) in convex.iter().enumerate() {
        let next = convex[(at + 1) % convex.len()];
        let side = [next[0] - corner[0], next[1] - corner[1]];
        let size = side[0].hypot(side[1]);
        // How far inside of this side it begins, and how fast it goes further in.
        let inside = (side[0] * (from[1] - corner[1]) - side[1] * (from[0] - corner[0])) / size - TOUCH;
        let rate = (side[0] * way[1] - side[1] * way[0]) / size;
        if rate == 0.0 {
            if inside <= 0.0 {
                return false;
            }
        } else if rate > 0.0 {
            enters = enters.max(-inside / rate);
        } else {
            leaves = leaves.min(-inside / rate);
        }
    }
    enters < leaves
}

fn square_distance(place: Point, [from, to]: [Point; 2]) -> f64 {
    let side = [to[0] - from[0], to[1] - from[1]];
    let away = [place[0] - from[0], place[1] - from[1]];
    let square = side[0] * side[0] + side[1] * side[1];
    let along = side[0] * away[0] + side[1] * away[1];
    let part = if square > 0.0 { (along / square).clamp(0.0, 1.0) } else { 0.0 };
    let off = [away[0] - part * side[0], away[1] - part * side[1]];
    off[0] * off[0] + off[1] * off[1]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_overlap_where_their_insides_meet() {
        // Open upwards, like a U.
        let bay = Solid::new(vec![
            [0.0, 0.0],
            [6.0, 0.0],
            [6.0, 5.0],
            [5.0, 5.0],
            [5.0, 1.0],
            [1.0, 1.0],
            [1.0, 5.0],
            [0.0, 5.0],
        ]);
        let square = |x: f64, y: f64, half: f64| {
            [[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]]
        };
        for (shape, expected) in [
            (square(3.0, 3.0, 2.0), false),
            (square(3.0, 3.0, 2.001), true),
            (square(0.5, 4.0, 0.2), true),
            (square(3.0, 0.5, 9.0), true),
            (square(3.0, 6.0, 1.0), false),
            (square(-1.0, 2.0, 1.0), false),
            (square(5.5, 5.5, 0.6), true),
        ] {
            assert_eq!(bay.overlaps(&shape, range(&shape)), expected, "{shape:?}");
        }
        let turned = [[3.0, 1.01], [5.0, 3.01], [3.0, 5.01], [1.0, 3.01]];
        let moved = turned.map(|[x, y]| [x + 0.02, y]);
        assert!(!bay.overlaps(&turned, range(&turned)) && bay.overlaps(&moved, range(&moved)));
        for (centre, radius, expected) in [
            ([3.0, 3.0], 2.0, false),
            ([3.0, 3.0], 2.001, true),
            ([0.5, 0.5], 0.1, true),
            ([7.0, 6.0], 1.41, false),
            ([7.0, 6.0], 1.42, true),
        ] {
            assert_eq!(bay.distance(centre, radius) < radius, expected, "{centre:?}");
        }
    }
}
