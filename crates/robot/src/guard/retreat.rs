//! Ways out: whether a motion and the stop after it lead away from what is too near already.
//!
//! Away means: at no moment nearer than a robot that stays where it was a moment before, wherever a moving obstacle is meanwhile.
//!
//! The distance from a convex body to a point is a convex function of the point's place, seen from the body. So with n,
//! its direction of growth, the point is no nearer wherever it has moved along n, and that is all that is asked:
//!
//! 1. The velocities of the rest of the motion lie between three of them (see [`Braking`](super::braking)), so it is
//!    enough that none of these leads along n, for n turned with the body by the ends of its turn.
//! 2. A turn moves the point along n at a rate that is a sine of the angle, so that it keeps its sign between two angles
//!    where it has the same; and so for the corner of a body that turns before something that stands.
//! 3. While an obstacle drives straight on, n turns monotonously from its first value to its last one, but where it gets inside:
//!    there it is each side's in turn through which the way out is the shortest. Where it stays next to the same corner or
//!    side, what is linear in n and its place is bounded by the ends, too. Else no turn.
//!
//! Translation and turn must each lead away for themselves, for one of them may end before the other.

use omnibase_platform::Pose2;

use super::braking::Sweep;
use super::fence::Fence;
use super::outline::{Body, BodyPose, Outline, Sight};
use super::shape::{Point, cross, dot, length, plus};
use crate::signals::Setpoint;

/// What rounding may add to a way or a speed that leads away, m and m/s.
const ROUNDING: f64 = 1e-9;

/// The rest of a motion from where the body is now.
#[derive(Clone, Copy, Debug)]
pub(super) struct Retreat<'a> {
    /// The body as it stands now, and at the end of the stop.
    body: Body<'a>,
    end: Body<'a>,
    /// All velocities lie between these and 0, but for a factor.
    directions: [Point; 3],
    /// The heading lies between these two, rad from now; with sine and cosine.
    turn_rad: [f64; 2],
    turn: [(f64, f64); 2],
}

/// What a normal belongs to.
#[derive(Clone, Copy, Debug)]
enum Carrier {
    Body,
    Floor,
}

impl<'a> Retreat<'a> {
    /// From a place to the next cycle's, and the stop after it; the body at that place, and its footprint.
    pub(super) fn new(
        place: BodyPose,
        footprint: &'a Outline,
        [here, next]: [&Setpoint; 2],
        sweep: &Sweep,
    ) -> Self {
        let speed = |at: &Setpoint| [at.twist_in_odom.vx_m_s, at.twist_in_odom.vy_m_s];
        let (from, to) = (here.odom_from_body, next.odom_from_body);
        let step_rad = to.heading_rad - from.heading_rad;
        let [least, greatest] = sweep.turn_rad;
        let far_rad = if greatest > -least { greatest } else { least };
        let end_origin = plus([to.x_m, to.y_m], sweep.way, 1.0);
        let end = Pose2::new(end_origin[0], end_origin[1], to.heading_rad + far_rad);
        // A stop that turns back counts as a turn to both sides from where it is now: what was gained isn't given back.
        let turn_rad = [step_rad.min(0.0) + least, step_rad.max(0.0) + greatest];
        Retreat {
            body: footprint.at(place),
            end: footprint.placed(&end),
            directions: [speed(here), speed(next), sweep.way],
            turn_rad,
            turn: turn_rad.map(f64::sin_cos),
        }
    }

    fn turns(&self) -> bool {
        self.turn_rad != [0.0; 2]
    }

    fn goes_along(&self, normal: Point) -> bool {
        self.directions.iter().any(|way| dot(*way, normal) > ROUNDING)
    }

    /// Whether any part of it leads the end of an arm along a normal, or a side with that normal towards that end.
    fn leads_along(&self, arm: Point, normal: Point, carrier: Carrier) -> bool {
        let leads_turned = |(end_rad, (sin, cos)): (f64, (f64, f64))| {
            // The body's side turns with it; seen from a turned arm, what stands turns back.
            let sin = match carrier {
                Carrier::Body => sin,
                Carrier::Floor => -sin,
            };
            let turned = [cos * normal[0] - sin * normal[1], sin * normal[0] + cos * normal[1]];
            let turns = [normal, turned].into_iter().any(|normal| {
                let moved_m = match carrier {
                    Carrier::Body => (-end_rad * cross(self.directions[2], normal)).max(0.0),
                    Carrier::Floor => 0.0,
                };
                end_rad * cross(arm, normal) + moved_m > ROUNDING
            });
            let moves = match carrier {
                Carrier::Body => self.goes_along(turned),
                Carrier::Floor => false,
            };
            moves || turns
        };
        // Where it doesn't turn, no end of its turn says more than its way does.
        let leads_by_turning = |end: (f64, (f64, f64))| end.0 != 0.0 && leads_turned(end);
        self.goes_along(normal) || self.turn_rad.into_iter().zip(self.turn).any(leads_by_turning)
    }

    /// Whether it leads away from a point that moves along a straight course.
    pub(super) fn leaves(&self, from: Point, along: Point) -> bool {
        let ends = [from, plus(from, along, 1.0)];
        let sights = ends.map(|point| self.body.sight(point));
        let is_kept = |sight: Sight| !self.turns() || sight.part == sights[0].part;
        let stays = |sight: Sight| is_kept(sight) && !self.goes_along(sight.normal);
        let begins = is_kept(sights[1])
            && ends.iter().zip(sights).all(|(point, sight)| {
                !self.leads_along(plus(*point, self.body.origin(), -1.0), sight.normal, Carrier::Body)
            })
            && self.body.sides_within(from, along).all(stays);
        // What was gained isn't given back at the end, either, where another part of the body may be the nearest.
        begins && {
            let (point, normal) = (ends[1], self.end.sight(ends[1]).normal);
            let moment_m = cross(plus(point, self.end.origin(), -1.0), normal);
            !self.goes_along(normal) && !self.turn_rad.iter().any(|turn| turn * moment_m > ROUNDING)
        }
    }

    /// Whether it leads away from all of a fence that it may come nearer to than `need_m` by a way of `reach_m`.
    pub(super) fn leaves_fence(&self, fence: &Fence, [need_m, reach_m]: [f64; 2]) -> bool {
        let near_m = need_m + reach_m;
        let corner_leaves = |corner: Point| {
            let inside = fence.has_inside(corner);
            let within_m = if inside { near_m } else { fence.nearest_m(corner) + reach_m };
            fence.walls().iter().all(|wall| {
                let towards = wall.side.way_from(corner);
                let distance_m = length(towards);
                let is_far = distance_m > within_m;
                if is_far || (!inside && dot(wall.outward, plus(corner, wall.side.from, -1.0)) < 0.0) {
                    return true;
                }
                let is_clear = inside && distance_m > 1e-6;
                let normal =
                    if is_clear { [towards[0] / distance_m, towards[1] / distance_m] } else { wall.outward };
                let arm = plus(corner, self.body.origin(), -1.0);
                !self.leads_along(arm, normal, Carrier::Floor)
            })
        };
        let vertex_leaves =
            |vertex: Point| self.body.distance_to_m(vertex) > near_m || self.leaves(vertex, [0.0; 2]);
        self.body.corners().all(corner_leaves) && fence.inward_corners().all(vertex_leaves)
    }
}
