//! Polygons that are in the way exactly, not by the cells that they touch.

use crate::Point;

/// How far shapes may reach into each other, in cells: rounding.
const TOUCH: f64 = 1e-9;

/// A closed polygon, in cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    corners: Vec<Point>,
    sides: Vec<Side>,
    /// Of a convex one the sides' directions outwards, and how far out they lie; else none.
    normals: Vec<(Point, f64)>,
    low: Point,
    high: Point,
}

/// A side of a polygon.
#[derive(Clone, Debug, PartialEq)]
struct Side {
    from: Point,
    /// To the next corner.
    way: Point,
    /// One over the square of its length; 0 where both corners are one.
    per_square: f64,
}

impl Solid {
    pub(super) fn new(corners: Vec<Point>) -> Self {
        let [low, high] = range(&corners);
        let side = |(at, from): (usize, &Point)| {
            let to = corners[(at + 1) % corners.len()];
            let way = [to[0] - from[0], to[1] - from[1]];
            let square = way[0] * way[0] + way[1] * way[1];
            Side { from: *from, way, per_square: if square > 0.0 { 1.0 / square } else { 0.0 } }
        };
        let sides: Vec<Side> = corners.iter().enumerate().map(side).collect();
        let normals = normals(&sides);
        Solid { corners, sides, normals, low, high }
    }

    /// Its corners, in cells.
    pub(crate) fn corners(&self) -> &[Point] {
        &self.corners
    }

    /// Of a convex one the sides' directions outwards, and how far out they lie, in cells; else none.
    pub(crate) fn normals(&self) -> &[(Point, f64)] {
        &self.normals
    }

    fn is_near(&self, low: Point, high: Point) -> bool {
        (0..2).all(|axis| self.low[axis] < high[axis] - TOUCH && self.high[axis] > low[axis] + TOUCH)
    }

    /// Whether the box around it comes nearer to a place than this.
    pub(crate) fn is_within(&self, [x, y]: Point, reach: f64) -> bool {
        let off = |axis: usize, at: f64| (self.low[axis] - at).max(at - self.high[axis]).max(0.0);
        let (across, along) = (off(0, x), off(1, y));
        across * across + along * along < reach * reach
    }

    /// Whether a place lies inside: a ray from it crosses an odd number of sides.
    fn holds(&self, [x, y]: Point) -> bool {
        let crosses = |Side { from, way, .. }: &&Side| {
            (from[1] > y) != (from[1] + way[1] > y) && x < from[0] + (y - from[1]) / way[1] * way[0]
        };
        self.sides.iter().filter(crosses).count() % 2 == 1
    }

    /// Whether a convex polygon, counter-clockwise, of which this is the range, overlaps it.
    pub(crate) fn overlaps(&self, convex: &[Point], [low, high]: [Point; 2]) -> bool {
        self.is_near(low, high)
            && (self.holds(convex[0]) || self.sides.iter().any(|side| side.goes_through(convex, [low, high])))
    }

    /// From a place to it, 0 inside, or something that isn't below `enough`.
    pub(crate) fn distance(&self, [x, y]: Point, enough: f64) -> f64 {
        if !self.is_within([x, y], enough) {
            return enough;
        }
        if self.normals.is_empty() {
            if self.holds([x, y]) {
                return 0.0;
            }
            let squares = self.sides.iter().map(|side| side.square_distance([x, y]));
            return squares.fold(enough * enough, f64::min).sqrt();
        }
        // What is nearest of a convex one lies on a side that the place is beyond.
        let (mut square, mut is_inside) = (enough * enough, true);
        for (side, (normal, far)) in self.sides.iter().zip(&self.normals) {
            let out = normal[0] * x + normal[1] * y - far;
            if out >= enough {
                return enough;
            }
            if out > 0.0 || out.is_nan() {
                is_inside = false;
                square = square.min(side.square_distance([x, y]));
            }
        }
        if is_inside { 0.0 } else { square.sqrt() }
    }
}

/// The directions outwards of a convex polygon's sides, and how far out they lie; none of another one.
fn normals(sides: &[Side]) -> Vec<(Point, f64)> {
    let turns_left = |way: Point, next: Point| way[0] * next[1] - way[1] * next[0];
    let area: f64 = sides.iter().map(|side| turns_left(side.from, side.way)).sum();
    let outwards = |side: &Side| {
        let [x, y] = side.way.map(|part| part * side.per_square.sqrt() * area.signum());
        ([y, -x], y * side.from[0] - x * side.from[1])
    };
    let normals: Vec<(Point, f64)> = sides.iter().map(outwards).collect();
    let holds = |side: &Side| {
        let out = |(normal, far): &(Point, f64)| normal[0] * side.from[0] + normal[1] * side.from[1] - far;
        normals.iter().all(|normal| out(normal) <= TOUCH)
    };
    if sides.iter().all(|side| side.per_square > 0.0 && holds(side)) { normals } else { Vec::new() }
}

/// The least and the greatest coordinates of corners.
pub(crate) fn range(corners: &[Point]) -> [Point; 2] {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for corner in corners {
        for axis in 0..2 {
            low[axis] = low[axis].min(corner[axis]);
            high[axis] = high[axis].max(corner[axis]);
        }
    }
    [low, high]
}

impl Side {
    /// Whether it goes through the inside of a convex polygon of this range (Cyrus and Beck's clipping).
    fn goes_through(&self, convex: &[Point], [low, high]: [Point; 2]) -> bool {
        let (from, way) = (self.from, self.way);
        let is_beside = |axis: usize| {
            let to = from[axis] + way[axis];
            from[axis].max(to) <= low[axis] || from[axis].min(to) >= high[axis]
        };
        if is_beside(0) || is_beside(1) {
            return false;
        }
        let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
        for (at, corner) in convex.iter().enumerate() {
            let next = convex[(at + 1) % convex.len()];
            let side = [next[0] - corner[0], next[1] - corner[1]];
            let size = (side[0] * side[0] + side[1] * side[1]).sqrt();
            // How far inside of this side it begins, and how fast it goes further in, both times its length.
            let inside = side[0] * (from[1] - corner[1]) - side[1] * (from[0] - corner[0]) - TOUCH * size;
            let rate = side[0] * way[1] - side[1] * way[0];
            if rate == 0.0 {
                if inside <= 0.0 {
                    return false;
                }
            } else if rate > 0.0 {
                enters = enters.max(-inside / rate);
            } else {
                leaves = leaves.min(-inside / rate);
            }
            if enters >= leaves {
                return false;
            }
        }
        true
    }

    fn square_distance(&self, place: Point) -> f64 {
        let away = [place[0] - self.from[0], place[1] - self.from[1]];
        let along = self.way[0] * away[0] + self.way[1] * away[1];
        let part = (along * self.per_square).clamp(0.0, 1.0);
        let off = [away[0] - part * self.way[0], away[1] - part * self.way[1]];
        off[0] * off[0] + off[1] * off[1]
    }
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
