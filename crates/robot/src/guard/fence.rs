//! The fence: how much room a body has inside it, where it stands and while it moves straight on.
//!
//! In a convex fence a convex body's room is the least over sides of how far its corner nearest to that side's line is from it: the
//! nearest line's foot lies on the fence. Else every side that may be near is looked at for itself.

use super::outline::{Body, Side};
use super::shape::{MAX_FENCE_CORNERS, Patch, Point, cross, double_area, is_inside, length, plus, square};

/// A closed polygon, and what of it never changes.
#[derive(Clone, Debug)]
pub(crate) struct Fence {
    corners_m: Vec<Point>,
    sides: Vec<Wall>,
    is_convex: bool,
}

/// A side of a fence.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wall {
    pub(super) side: Side,
    /// Out of the fence, of length 1.
    pub(super) outward: Point,
    /// The corner where it begins points into the fence.
    points_inwards: bool,
}

impl Fence {
    pub(crate) fn new(corners_m: &[Point]) -> Self {
        let mut fence = Fence {
            corners_m: Vec::with_capacity(MAX_FENCE_CORNERS),
            sides: Vec::with_capacity(MAX_FENCE_CORNERS),
            is_convex: true,
        };
        fence.become_one_of(corners_m);
        fence
    }

    /// Another one in its place; up to [`MAX_FENCE_CORNERS`] corners allocate nothing.
    pub(super) fn become_one_of(&mut self, corners_m: &[Point]) {
        let count = corners_m.len();
        let out = if double_area(corners_m) > 0.0 { 1.0 } else { -1.0 };
        let wall = |number: usize| {
            let [before, from, to] = [count - 1, 0, 1].map(|offset| corners_m[(number + offset) % count]);
            let side = Side::new(from, to);
            let turn = out * cross(plus(from, before, -1.0), side.along);
            Wall { side, outward: side.right.map(|part| out * part), points_inwards: turn < 0.0 }
        };
        self.sides.clear();
        self.sides.extend((0..count).map(wall));
        self.is_convex = self.sides.iter().all(|wall| !wall.points_inwards);
        self.corners_m.clear();
        self.corners_m.extend_from_slice(corners_m);
    }

    pub(super) fn corners_m(&self) -> &[Point] {
        &self.corners_m
    }

    pub(super) fn walls(&self) -> &[Wall] {
        &self.sides
    }

    /// The corners that point into it.
    pub(super) fn inward_corners(&self) -> impl Iterator<Item = Point> + '_ {
        self.sides.iter().filter(|wall| wall.points_inwards).map(|wall| wall.side.from)
    }

    pub(super) fn has_inside(&self, point: Point) -> bool {
        is_inside(&self.corners_m, point)
    }

    /// From a point to the nearest of its sides, m.
    pub(super) fn nearest_m(&self, point: Point) -> f64 {
        let squares = self.sides.iter().map(|wall| square(wall.side.way_from(point)));
        squares.fold(f64::INFINITY, f64::min).sqrt()
    }

    /// How much room a body has to the inside; below 0: how far it is outside.
    pub(crate) fn room_m(&self, body: &Body<'_>) -> f64 {
        let room_m = self.swept_room_m(body, [0.0; 2], f64::INFINITY);
        if room_m > 0.0 {
            return room_m;
        }
        let outside = body.corners().filter(|corner| !self.has_inside(*corner));
        let mut outside_m = outside.map(|corner| self.nearest_m(corner)).fold(0.0, f64::max);
        // A corner of the fence that points inwards may stand in the body.
        for corner in &self.corners_m {
            outside_m = outside_m.max(-body.distance_to_m(*corner));
        }
        if outside_m > 0.0 { -outside_m } else { room_m }
    }

    /// The least room while a body moves straight along `way` without turning, or `enough_m` where there is more; not above
    /// 0 where it leaves the fence.
    pub(crate) fn swept_room_m(&self, body: &Body<'_>, way: Point, enough_m: f64) -> f64 {
        if self.is_convex {
            self.convex_room_m(body, way, enough_m)
        } else {
            self.any_room_m(body, way, enough_m)
        }
    }

    fn convex_room_m(&self, body: &Body<'_>, way: Point, enough_m: f64) -> f64 {
        let ((centre, radius_m), origin) = (body.circle(), body.origin());
        let mut least_m = enough_m;
        for wall in &self.sides {
            let [out_x, out_y] = wall.outward;
            let inside_m = |point: Point| {
                let away = plus(point, wall.side.from, -1.0);
                -(out_x * away[0] + out_y * away[1])
            };
            let way_out_m = (out_x * way[0] + out_y * way[1]).max(0.0);
            // A side that is further away in any case needs no closer look.
            if inside_m(centre) - radius_m - way_out_m < least_m {
                least_m = least_m.min(inside_m(origin) - body.reach_along_m(wall.outward) - way_out_m);
            }
        }
        // What isn't finite is nowhere.
        if least_m.is_nan() || !centre[0].is_finite() || !centre[1].is_finite() { 0.0 } else { least_m }
    }

    fn any_room_m(&self, body: &Body<'_>, way: Point, enough_m: f64) -> f64 {
        if !body.corners().next().is_some_and(|corner| self.has_inside(corner)) {
            return 0.0;
        }
        let (centre, radius_m) = body.circle();
        let reach_m = radius_m + length(way);
        let mut least_m = enough_m;
        for wall in &self.sides {
            if length(wall.side.way_from(centre)) - reach_m < least_m {
                // The body moves along the way: that is as if the fence moved back.
                let side =
                    Patch { origin: wall.side.from, along: wall.side.along, across: [-way[0], -way[1]] };
                least_m = least_m.min(body.distance_m(&side, least_m));
            }
        }
        least_m
    }
}
