//! Shapes on the floor: points, polygons, and what a fence or an obstacle sweeps.

use super::outline::Side;

/// Most corners of a footprint.
pub const MAX_FOOTPRINT_CORNERS: usize = 16;
/// Most corners of a fence.
pub const MAX_FENCE_CORNERS: usize = 32;

/// A place on the floor, or a way between two: x and y, m.
pub type Point = [f64; 2];

pub(crate) fn plus(a: Point, b: Point, factor: f64) -> Point {
    [a[0] + b[0] * factor, a[1] + b[1] * factor]
}

pub(crate) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// a × b: positive where b lies counter-clockwise of a.
pub(crate) fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// x² + y².
pub(crate) fn square(a: Point) -> f64 {
    dot(a, a)
}

pub(crate) fn length(a: Point) -> f64 {
    omnibase_platform::length(a)
}

/// The point of a segment that is nearest to another one.
pub(crate) fn nearest_on(from: Point, to: Point, point: Point) -> Point {
    let along = plus(to, from, -1.0);
    let square = dot(along, along);
    let part = if square > 0.0 { dot(plus(point, from, -1.0), along) / square } else { 0.0 };
    plus(from, along, part.clamp(0.0, 1.0))
}

/// A parallelogram: a point, a side of a fence or an obstacle's centre, moved along one or two straight ways.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Patch {
    pub(crate) origin: Point,
    pub(crate) along: Point,
    pub(crate) across: Point,
}

impl Patch {
    pub(super) fn corners(&self) -> [Point; 4] {
        let far = plus(self.origin, self.along, 1.0);
        [self.origin, far, plus(far, self.across, 1.0), plus(self.origin, self.across, 1.0)]
    }

    /// Its outline, without what has no length.
    pub(super) fn sides(&self) -> impl Iterator<Item = Side> {
        let [a, b, c, d] = self.corners();
        let count = match (self.along != [0.0; 2], self.across != [0.0; 2]) {
            (true, true) => 4,
            (true, false) | (false, false) => 1,
            // From its far end to its near one.
            (false, true) => 2,
        };
        [(a, b), (b, c), (c, d), (d, a)].into_iter().take(count).map(|(from, to)| Side::new(from, to))
    }

    /// At most the distance to a point, m.
    pub(super) fn distance_at_least_m(&self, point: Point) -> f64 {
        let (along, across) = (square(self.along), square(self.across));
        let (long, short) = if along > across { (self.along, across) } else { (self.across, along) };
        let side = Side::new(self.origin, plus(self.origin, long, 1.0));
        length(side.way_from(point)) - short.sqrt()
    }
}

/// The sides of a closed polygon.
pub(crate) fn sides(polygon: &[Point]) -> impl Iterator<Item = (Point, Point)> + '_ {
    polygon.iter().enumerate().map(|(i, from)| (*from, polygon[(i + 1) % polygon.len()]))
}

/// Whether a point lies inside a polygon, convex or not: a ray from it crosses its sides an odd number of times.
pub(crate) fn is_inside(polygon: &[Point], point: Point) -> bool {
    let crosses = |(from, to): &(Point, Point)| {
        (from[1] > point[1]) != (to[1] > point[1])
            && point[0] < from[0] + (point[1] - from[1]) / (to[1] - from[1]) * (to[0] - from[0])
    };
    sides(polygon).filter(crosses).count() % 2 == 1
}

/// The convex hull of points, counter-clockwise, without points on its sides (Andrew's monotone chain).
pub(crate) fn hull(points: &[Point]) -> Vec<Point> {
    let mut sorted: Vec<Point> = points.to_vec();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    sorted.dedup();
    let chain = |points: &mut dyn Iterator<Item = Point>| {
        let mut chain: Vec<Point> = Vec::new();
        for point in points {
            while let [.., before, last] = chain[..]
                && cross(plus(last, before, -1.0), plus(point, last, -1.0)) <= 0.0
            {
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut hull = chain(&mut sorted.iter().copied());
    hull.extend(chain(&mut sorted.iter().rev().copied()));
    hull
}

/// Two sides of a polygon that cross or touch; neighbours where they share more than their corner.
pub(crate) fn crossing(polygon: &[Point]) -> Option<(usize, usize)> {
    let count = polygon.len();
    let side = |i: usize| (polygon[i], polygon[(i + 1) % count]);
    let on = |from, to, point| length(plus(point, nearest_on(from, to, point), -1.0)) < 1e-9;
    let meet = |(a, b): (Point, Point), (c, d): (Point, Point)| {
        let turn = |a: Point, b: Point, c: Point| cross(plus(b, a, -1.0), plus(c, a, -1.0));
        let apart = turn(a, b, c) * turn(a, b, d) < 0.0 && turn(c, d, a) * turn(c, d, b) < 0.0;
        apart || on(a, b, c) || on(a, b, d) || on(c, d, a) || on(c, d, b)
    };
    let folds = |(a, b): (Point, Point), (_, c): (Point, Point)| on(a, b, c) || on(b, c, a);
    let mut pairs = (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j)));
    pairs.find(|(i, j)| match (*i, *j) {
        (i, j) if j == i + 1 => folds(side(i), side(j)),
        (0, j) if j == count - 1 => folds(side(j), side(0)),
        (i, j) => meet(side(i), side(j)),
    })
}

/// Twice a polygon's area; positive where it goes counter-clockwise.
pub(crate) fn double_area(polygon: &[Point]) -> f64 {
    sides(polygon).map(|(from, to)| cross(from, to)).sum()
}
