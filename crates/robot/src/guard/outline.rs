//! The footprint: what of it stays the same wherever the body stands, and what it is away from, seen from it.
//!
//! All is computed in the body's own axes, in which sides and normals never change; what stands on the floor is brought there.

use omnibase_platform::Pose2;

use super::shape::{MAX_FOOTPRINT_CORNERS, Patch, Point, dot, length, plus, square};

/// A convex polygon in base_link, counter-clockwise; at most [`MAX_FOOTPRINT_CORNERS`] corners count.
#[derive(Clone, Debug)]
pub(crate) struct Outline {
    sides: Vec<Side>,
    /// A circle around all corners.
    centre: Point,
    radius_m: f64,
    /// From the origin of base_link to the furthest corner, m.
    reach_m: f64,
}

/// A side, from one corner to the next.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side {
    pub(super) from: Point,
    pub(super) along: Point,
    /// 1 divided by the square of its length; 0 for none.
    per_square: f64,
    /// To the right of it, of length 1; 0 where it has no length.
    pub(super) right: Point,
}

impl Side {
    pub(super) fn new(from: Point, to: Point) -> Self {
        let along = plus(to, from, -1.0);
        let size = length(along);
        if size > 0.0 {
            let right = [along[1] / size, -along[0] / size];
            Side { from, along, per_square: 1.0 / (size * size), right }
        } else {
            Side { from, along, per_square: 0.0, right: [0.0; 2] }
        }
    }

    /// From a point to the nearest one of the side.
    pub(super) fn way_from(&self, point: Point) -> Point {
        let away = plus(point, self.from, -1.0);
        let part = dot(away, self.along) * self.per_square;
        plus([-away[0], -away[1]], self.along, part.clamp(0.0, 1.0))
    }

    /// How far right of its line a point lies, m; below 0 to the left.
    pub(super) fn right_of_it_m(&self, point: Point) -> f64 {
        dot(self.right, plus(point, self.from, -1.0))
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

impl Outline {
    pub(crate) fn new(footprint: &[Point]) -> Self {
        let corners = &footprint[..footprint.len().min(MAX_FOOTPRINT_CORNERS)];
        let side = |(number, from): (usize, &Point)| Side::new(*from, corners[(number + 1) % corners.len()]);
        let part = 1.0 / corners.len().max(1) as f64;
        let centre = corners.iter().fold([0.0; 2], |sum, corner| plus(sum, *corner, part));
        let furthest = |from: Point| {
            corners.iter().map(|corner| square(plus(*corner, from, -1.0))).fold(0.0, f64::max).sqrt()
        };
        Outline {
            sides: corners.iter().enumerate().map(side).collect(),
            centre,
            radius_m: furthest(centre),
            reach_m: furthest([0.0; 2]),
        }
    }

    /// From the origin of base_link to the furthest corner, m.
    pub(crate) fn reach_m(&self) -> f64 {
        self.reach_m
    }

    /// Put where the body stands.
    pub(crate) fn placed(&self, odom_from_body: &Pose2) -> Body<'_> {
        self.at(BodyPose::of(odom_from_body))
    }

    pub(super) fn at(&self, place: BodyPose) -> Body<'_> {
        Body { outline: self, place }
    }
}

/// Where a body stands in odom: its origin, sine and cosine of its heading.
#[derive(Clone, Copy, Debug)]
pub(super) struct BodyPose {
    pub(super) origin: Point,
    sin: f64,
    cos: f64,
}

impl BodyPose {
    pub(super) fn of(odom_from_body: &Pose2) -> Self {
        let (sin, cos) = odom_from_body.heading_rad.sin_cos();
        BodyPose { origin: [odom_from_body.x_m, odom_from_body.y_m], sin, cos }
    }
}

/// A footprint where it stands.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Body<'a> {
    outline: &'a Outline,
    place: BodyPose,
}

impl<'a> Body<'a> {
    /// The origin of base_link.
    pub(super) fn origin(&self) -> Point {
        self.place.origin
    }

    /// A direction in odom as seen from the body.
    pub(super) fn seen(&self, way: Point) -> Point {
        let BodyPose { sin, cos, .. } = self.place;
        [cos * way[0] + sin * way[1], cos * way[1] - sin * way[0]]
    }

    /// A direction of the body in odom.
    fn told(&self, way: Point) -> Point {
        let BodyPose { sin, cos, .. } = self.place;
        [cos * way[0] - sin * way[1], sin * way[0] + cos * way[1]]
    }

    /// A place in odom as seen from the body.
    fn place_seen(&self, point: Point) -> Point {
        self.seen(plus(point, self.place.origin, -1.0))
    }

    /// The corners in odom.
    pub(super) fn corners(&self) -> impl Iterator<Item = Point> + use<'a> {
        let body = *self;
        self.outline.sides.iter().map(move |side| plus(body.place.origin, body.told(side.from), 1.0))
    }

    /// The circle around all corners: its centre in odom, and its radius, m.
    pub(super) fn circle(&self) -> (Point, f64) {
        (plus(self.place.origin, self.told(self.outline.centre), 1.0), self.outline.radius_m)
    }

    /// How far its corner that is furthest in a direction is so from the origin, m; the direction has length 1.
    pub(super) fn reach_along_m(&self, way: Point) -> f64 {
        let way = self.seen(way);
        let mut furthest_m = f64::NEG_INFINITY;
        for side in &self.outline.sides {
            let along_m = dot(way, side.from);
            // Without `max`, which takes care of what is no number, too.
            if along_m > furthest_m {
                furthest_m = along_m;
            }
        }
        furthest_m
    }

    /// The point of the outline that is nearest to another one.
    pub(super) fn nearest(&self, point: Point) -> Point {
        let seen = self.place_seen(point);
        let ways = self.outline.sides.iter().map(|side| side.way_from(seen));
        let way = ways.min_by(|a, b| square(*a).total_cmp(&square(*b))).unwrap_or_default();
        plus(point, self.told(way), 1.0)
    }

    /// The distance to a point; where it lies inside, minus how deep.
    pub(crate) fn distance_to_m(&self, point: Point) -> f64 {
        self.outline.distance_to_m(self.place_seen(point))
    }

    /// At most the distance to a point.
    pub(super) fn distance_at_least_m(&self, point: Point) -> f64 {
        let (centre, radius_m) = self.circle();
        length(plus(point, centre, -1.0)) - radius_m
    }

    /// Whether a point lies inside.
    pub(super) fn covers(&self, point: Point) -> bool {
        let seen = self.place_seen(point);
        self.outline.sides.iter().all(|side| side.right_of_it_m(seen) <= 0.0)
    }

    /// Where a point lies as seen from the body; the normal is in odom.
    pub(crate) fn sight(&self, point: Point) -> Sight {
        let sight = self.outline.sight(self.place_seen(point));
        Sight { normal: self.told(sight.normal), ..sight }
    }

    /// The sides through which a point that moves straight on is soonest out, while it is inside: each at some part of its course.
    /// Normals are in odom.
    pub(super) fn sides_within(&self, from: Point, along: Point) -> impl Iterator<Item = Sight> + use<'a> {
        let (body, from, along) = (*self, self.place_seen(from), self.seen(along));
        self.outline
            .sides_within(from, along)
            .map(move |sight| Sight { normal: body.told(sight.normal), ..sight })
    }

    /// The distance to a patch; where both overlap, minus the depth by which they do. Where it isn't less than `enough_m`: any
    /// number that isn't, either.
    pub(crate) fn distance_m(&self, patch: &Patch, enough_m: f64) -> f64 {
        let (centre, radius_m) = self.circle();
        let apart_m = patch.distance_at_least_m(centre) - radius_m;
        if apart_m >= enough_m {
            return apart_m;
        }
        let seen = Patch {
            origin: self.place_seen(patch.origin),
            along: self.seen(patch.along),
            across: self.seen(patch.across),
        };
        let gap_m = self.outline.gap_m(&seen);
        if gap_m <= 0.0 || gap_m >= enough_m { gap_m } else { self.outline.distance_apart_m(&seen) }
    }
}

/// What is seen from the body is in its axes.
impl Outline {
    fn distance_to_m(&self, point: Point) -> f64 {
        let (mut within_m, mut nearest) = (f64::NEG_INFINITY, f64::INFINITY);
        for side in &self.sides {
            let outside_m = side.right_of_it_m(point);
            within_m = within_m.max(outside_m);
            // The nearest part of a convex body is on a side that faces the point.
            if outside_m >= 0.0 {
                nearest = nearest.min(square(side.way_from(point)));
            }
        }
        if within_m < 0.0 { within_m } else { nearest.sqrt() }
    }

    fn sight(&self, point: Point) -> Sight {
        // Inside, the side through which it is soonest out.
        let mut inner = (f64::NEG_INFINITY, Sight { normal: [0.0; 2], part: 0 });
        let mut outer = (f64::INFINITY, inner.1);
        let ends = 2 * self.sides.len();
        for (number, side) in self.sides.iter().enumerate() {
            let away = plus(point, side.from, -1.0);
            let from_plane = dot(side.right, away);
            if from_plane > inner.0 {
                inner = (from_plane, Sight { normal: side.right, part: 2 * number });
            }
            let part = dot(away, side.along) * side.per_square;
            let (from_side, sight) = match part {
                part if part <= 0.0 => (square(away), Sight { normal: away, part: 2 * number + 1 }),
                part if part >= 1.0 => {
                    let away = plus(away, side.along, -1.0);
                    (square(away), Sight { normal: away, part: (2 * number + 3) % ends })
                }
                _ => (from_plane * from_plane, Sight { normal: side.right, part: 2 * number }),
            };
            if from_side < outer.0 {
                outer = (from_side, sight);
            }
        }
        let (from_side, sight) = outer;
        if inner.0 <= 0.0 || from_side == 0.0 {
            inner.1
        } else if sight.part % 2 == 0 {
            sight
        } else {
            let distance = from_side.sqrt();
            Sight { normal: [sight.normal[0] / distance, sight.normal[1] / distance], ..sight }
        }
    }

    fn sides_within(&self, from: Point, along: Point) -> impl Iterator<Item = Sight> + '_ {
        // How far right of a side the point is: at first, and by how much more at the end.
        let courses =
            move || self.sides.iter().map(move |side| [side.right_of_it_m(from), dot(side.right, along)]);
        let is_nearest = move |number: usize, [begin, more]: [f64; 2]| {
            let before =
                |(other, [least, rise]): (usize, [f64; 2])| (other < number, [begin - least, more - rise]);
            let others = courses().enumerate().filter(|(other, _)| *other != number).map(before);
            let (mut least, mut most) = (0.0_f64, 1.0_f64);
            // Each of these is above 0 on one part of the course; of two sides that are equally near the first one counts.
            for (is_strict, [begin, more]) in others.chain([(false, [-begin, -more])]) {
                if more > 0.0 {
                    least = least.max(-begin / more);
                } else if more < 0.0 {
                    most = most.min(-begin / more);
                } else if begin < 0.0 || (is_strict && begin == 0.0) {
                    return false;
                }
            }
            least < most
        };
        let sides = self.sides.iter().zip(courses()).enumerate();
        sides
            .filter(move |(number, (_, course))| is_nearest(*number, *course))
            .map(|(number, (side, _))| Sight { normal: side.right, part: 2 * number })
    }

    /// By how much a line along a side of either parts it from a patch at best (separating axes); where none does, minus by how
    /// much they overlap.
    fn gap_m(&self, patch: &Patch) -> f64 {
        let mut gap_m = f64::NEG_INFINITY;
        for side in &self.sides {
            let least = dot(side.right, patch.along).min(0.0) + dot(side.right, patch.across).min(0.0);
            gap_m = gap_m.max(side.right_of_it_m(patch.origin) + least);
        }
        for (way, other) in [(patch.along, patch.across), (patch.across, patch.along)] {
            let size = length(way);
            if size > 0.0 {
                let normal = [way[1] / size, -way[0] / size];
                let (begin, deep) = (dot(normal, patch.origin), dot(normal, other));
                let theirs = [begin + deep.min(0.0), begin + deep.max(0.0)];
                let mut ours = [f64::INFINITY, f64::NEG_INFINITY];
                for side in &self.sides {
                    let along = dot(normal, side.from);
                    ours = [ours[0].min(along), ours[1].max(along)];
                }
                gap_m = gap_m.max(ours[0] - theirs[1]).max(theirs[0] - ours[1]);
            }
        }
        gap_m
    }

    /// The distance to a patch that doesn't overlap.
    fn distance_apart_m(&self, patch: &Patch) -> f64 {
        let mut nearest = f64::INFINITY;
        let corners = patch.corners();
        for side in &self.sides {
            // Only a side that faces a corner is nearest to it.
            for corner in corners.into_iter().filter(|corner| side.right_of_it_m(*corner) >= 0.0) {
                nearest = nearest.min(square(side.way_from(corner)));
            }
        }
        for side in patch.sides() {
            for ours in &self.sides {
                nearest = nearest.min(square(side.way_from(ours.from)));
            }
        }
        nearest.sqrt()
    }
}
