//! Shapes on the floor: the footprint, what a fence or an obstacle sweeps, and the distance between them.

use omnibase_platform::Pose2;

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

pub(crate) fn length(a: Point) -> f64 {
    a[0].hypot(a[1])
}

/// The point of a segment that is nearest to another one.
pub(crate) fn nearest_on(from: Point, to: Point, point: Point) -> Point {
    let along = plus(to, from, -1.0);
    let square = dot(along, along);
    let part = if square > 0.0 { dot(plus(point, from, -1.0), along) / square } else { 0.0 };
    plus(from, along, part.clamp(0.0, 1.0))
}

/// Corners of a convex polygon, counter-clockwise.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Corners {
    points: [Point; MAX_FOOTPRINT_CORNERS],
    count: usize,
}

impl Corners {
    /// A footprint in base_link, put where the body stands.
    pub(crate) fn placed(footprint: &[Point], odom_from_body: &Pose2) -> Self {
        let (sin, cos) = odom_from_body.heading_rad.sin_cos();
        let mut points = [[0.0; 2]; MAX_FOOTPRINT_CORNERS];
        for (slot, [x, y]) in points.iter_mut().zip(footprint) {
            *slot = [odom_from_body.x_m + cos * x - sin * y, odom_from_body.y_m + sin * x + cos * y];
        }
        Corners { points, count: footprint.len().min(MAX_FOOTPRINT_CORNERS) }
    }

    pub(crate) fn points(&self) -> &[Point] {
        &self.points[..self.count]
    }

    /// The sides, each from one corner to the next.
    pub(crate) fn sides(&self) -> impl Iterator<Item = (Point, Point)> + '_ {
        let points = self.points();
        points.iter().enumerate().map(|(i, from)| (*from, points[(i + 1) % points.len()]))
    }

    /// The point of the outline that is nearest to another one.
    pub(crate) fn nearest(&self, point: Point) -> Point {
        let mut best = (f64::INFINITY, point);
        for (from, to) in self.sides() {
            let on = nearest_on(from, to, point);
            let distance = length(plus(point, on, -1.0));
            if distance < best.0 {
                best = (distance, on);
            }
        }
        best.1
    }

    /// The distance to a point; where it lies inside, minus how deep.
    pub(crate) fn distance_to_m(&self, point: Point) -> f64 {
        let mut square = f64::INFINITY;
        let mut is_inside = true;
        for (from, to) in self.sides() {
            let away = plus(point, nearest_on(from, to, point), -1.0);
            square = square.min(dot(away, away));
            is_inside &= cross(plus(to, from, -1.0), plus(point, from, -1.0)) >= 0.0;
        }
        if is_inside { -square.sqrt() } else { square.sqrt() }
    }

    /// Where a point lies as seen from the body.
    pub(crate) fn sight(&self, point: Point) -> Sight {
        // Inside, the side through which it is soonest out.
        let mut inner = (f64::NEG_INFINITY, Sight { normal: [0.0; 2], part: 0 });
        let mut outer = (f64::INFINITY, inner.1);
        for (number, (from, to)) in self.sides().enumerate() {
            let side = plus(to, from, -1.0);
            let outward = [side[1] / length(side), -side[0] / length(side)];
            let part = dot(plus(point, from, -1.0), side) / dot(side, side);
            let from_plane = dot(outward, plus(point, from, -1.0));
            if from_plane > inner.0 {
                inner = (from_plane, Sight { normal: outward, part: 2 * number });
            }
            let away = plus(point, plus(from, side, part.clamp(0.0, 1.0)), -1.0);
            let distance = length(away);
            if distance < outer.0 {
                let sight = match part {
                    part if part <= 0.0 => Sight { normal: away, part: 2 * number + 1 },
                    part if part >= 1.0 => Sight { normal: away, part: (2 * number + 3) % (2 * self.count) },
                    _ => Sight { normal: outward, part: 2 * number },
                };
                outer = (distance, sight);
            }
        }
        let (distance, sight) = outer;
        if inner.0 <= 0.0 || distance == 0.0 {
            inner.1
        } else if sight.part % 2 == 0 {
            sight
        } else {
            Sight { normal: [sight.normal[0] / distance, sight.normal[1] / distance], ..sight }
        }
    }

    /// A circle around all corners: centre and radius, m.
    fn circle(&self) -> (Point, f64) {
        let part = 1.0 / self.count.max(1) as f64;
        let centre = self.points().iter().fold([0.0; 2], |sum, point| plus(sum, *point, part));
        let square = |point: &Point| {
            let away = plus(*point, centre, -1.0);
            dot(away, away)
        };
        (centre, self.points().iter().map(square).fold(0.0, f64::max).sqrt())
    }

    /// The distance to a patch; where both overlap, minus the depth by which they do.
    ///
    /// Convex shapes that don't overlap are parted by a line along a side of one of them (separating axes).
    pub(crate) fn distance_m(&self, patch: &Patch) -> f64 {
        let corners = patch.corners();
        let mut gap = f64::NEG_INFINITY;
        for (from, to) in self.sides() {
            let side = plus(to, from, -1.0);
            let size = length(side);
            if size > 0.0 {
                let outward = [side[1] / size, -side[0] / size];
                let least = corners
                    .iter()
                    .map(|corner| dot(outward, plus(*corner, from, -1.0)))
                    .fold(f64::INFINITY, f64::min);
                gap = gap.max(least);
            }
        }
        for side in [patch.along, patch.across] {
            let size = length(side);
            if size > 0.0 {
                let normal = [side[1] / size, -side[0] / size];
                let range = |points: &[Point]| {
                    points
                        .iter()
                        .map(|point| dot(normal, *point))
                        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                            (low.min(value), high.max(value))
                        })
                };
                let (ours, theirs) = (range(self.points()), range(&corners));
                gap = gap.max(ours.0 - theirs.1).max(theirs.0 - ours.1);
            }
        }
        if gap <= 0.0 {
            return gap;
        }
        let to_side =
            |point: Point, (from, to): (Point, Point)| length(plus(point, nearest_on(from, to, point), -1.0));
        let mut least = f64::INFINITY;
        for side in self.sides() {
            least = corners.iter().fold(least, |least, corner| least.min(to_side(*corner, side)));
        }
        for number in 0..4 {
            let side = (corners[number], corners[(number + 1) % 4]);
            least = self.points().iter().fold(least, |least, point| least.min(to_side(*point, side)));
        }
        least
    }
}

/// Where a point lies as seen from a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sight {
    /// The direction in which its distance grows.
    pub(crate) normal: Point,
    /// The part of the body that is nearest: twice the number of a side, or one more: the corner where it begins.
    pub(crate) part: usize,
}

/// A parallelogram: a point, a side of a fence or an obstacle's centre, moved along one or two straight ways.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Patch {
    pub(crate) origin: Point,
    pub(crate) along: Point,
    pub(crate) across: Point,
}

impl Patch {
    fn corners(&self) -> [Point; 4] {
        let far = plus(self.origin, self.along, 1.0);
        [self.origin, far, plus(far, self.across, 1.0), plus(self.origin, self.across, 1.0)]
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

/// How much room a body has to the inside of a fence; below 0: how far it is outside.
pub(crate) fn room_m(fence: &[Point], body: &Corners) -> f64 {
    let mut outside_m = 0.0_f64;
    for corner in body.points() {
        if !is_inside(fence, *corner) {
            let distance = |(from, to)| length(plus(*corner, nearest_on(from, to, *corner), -1.0));
            outside_m = outside_m.max(sides(fence).map(distance).fold(f64::INFINITY, f64::min));
        }
    }
    // A corner of the fence that points inwards may stand in the body.
    for corner in fence {
        outside_m = outside_m.max(-body.distance_to_m(*corner));
    }
    if outside_m > 0.0 { -outside_m } else { swept_room_m(fence, body, [0.0; 2], f64::INFINITY) }
}

/// The least room while a body moves straight along `way` without turning, or `enough_m` where there is more; not above
/// 0 where it leaves the fence.
pub(crate) fn swept_room_m(fence: &[Point], body: &Corners, way: Point, enough_m: f64) -> f64 {
    if !body.points().first().is_some_and(|corner| is_inside(fence, *corner)) {
        return 0.0;
    }
    let (centre, radius_m) = body.circle();
    let reach_m = radius_m + length(way);
    let mut least_m = enough_m;
    for (from, to) in sides(fence) {
        // A side that is further away in any case needs no closer look.
        if length(plus(centre, nearest_on(from, to, centre), -1.0)) - reach_m < least_m {
            // The body moves along the way: that is as if the fence moved back.
            let side = Patch { origin: from, along: plus(to, from, -1.0), across: [-way[0], -way[1]] };
            least_m = least_m.min(body.distance_m(&side));
        }
    }
    least_m
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
