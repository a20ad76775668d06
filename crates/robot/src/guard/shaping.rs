//! How a wish is made gentle near fence and obstacles, before it is checked.
//!
//! - Near a wall the speed towards it is damped by the distance (velocity damper: Faverjon and Tournassoud, "A local
//!   based approach for path planning of manipulators with a high number of degrees of freedom", ICRA 1987), at every
//!   corner of the footprint; the rest of the speed stays: one slides along the wall.
//! - `circulate`: the thesis's 8.3.6, see [`Guard::circulating`].
//! - `guarded`: where an obstacle leaves little of the wish of a plan, the platform goes around it in one sense.

use omnibase_platform::Twist2;

use super::fence::Wall;
use super::planes::{MOST, Plane, Planes};
use super::shape::{MAX_FENCE_CORNERS, Point, cross, dot, length, plus};
use super::{Drive, Guard, Now};
use crate::config::AvoidanceKind;
use crate::signals::{LimitedBy, Setpoint};

/// Distance that is kept more than must be, at least and at most, m: what the check's own bounds cost.
const BUFFER_M: [f64; 2] = [0.003, 0.05];
/// How fast a place too near is left while moving along, 1/s, and as a part of the wished speed.
const PUSH_BACK_1_S: f64 = 2.0;
const PUSH_BACK_SHARE: f64 = 0.2;
/// What rounding may add to a distance from which on nothing is held back.
const FAR: f64 = 1.001;
/// The part of the limit on speed that is left in any case.
const LEAST_SHARE: f64 = 0.8;
/// Less than this part of the wished speed calls for a way around.
const LITTLE: f64 = 0.5;
/// The part of the greatest speed with which the way around is gone.
const AROUND: f64 = 0.7;
/// A way around ends when for so long none was needed, s.
const FREE_S: f64 = 0.2;
/// It turns back when for so long it led nowhere, s.
const STUCK_S: f64 = 0.5;

/// What a corner's speed may be at most towards something.
#[derive(Clone, Copy, Debug, Default)]
struct Constraint {
    /// Towards it.
    normal: Point,
    /// Speed of the corner along the normal at a turn of 1 rad/s, m/rad.
    moment_m: f64,
    /// Greatest speed along the normal, m/s.
    most_m_s: f64,
    by: LimitedBy,
    /// From the obstacle's centre to the body's origin.
    around: Point,
}

/// Speeds by which constraints are measured, m/s.
struct Towards {
    wished_m_s: f64,
    fastest_m_s: f64,
}

/// The constraints of a cycle.
struct Constraints {
    list: [Constraint; MOST],
    count: usize,
}

/// A wish made gentle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shaped {
    pub(super) twist: Twist2,
    /// What of it only leads away from what is too near.
    pub(super) away: Twist2,
    /// What held it back.
    pub(super) by: LimitedBy,
}

/// The way around an obstacle that is being gone.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Detour {
    sense: Option<Sense>,
    free_s: f64,
    stuck_s: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sense {
    Clockwise,
    CounterClockwise,
}

impl Sense {
    /// The direction around a centre, seen from which the body is at `around`.
    fn tangent(self, around: Point) -> Point {
        let size = length(around);
        match self {
            _ if size == 0.0 => [0.0; 2],
            Sense::Clockwise => [around[1] / size, -around[0] / size],
            Sense::CounterClockwise => [-around[1] / size, around[0] / size],
        }
    }

    /// The sense that is nearer to a wished speed.
    fn nearer(around: Point, wish: Point) -> Self {
        if cross(around, wish) >= 0.0 { Sense::CounterClockwise } else { Sense::Clockwise }
    }

    fn other(self) -> Self {
        match self {
            Sense::Clockwise => Sense::CounterClockwise,
            Sense::CounterClockwise => Sense::Clockwise,
        }
    }
}

impl Constraints {
    fn all(&self) -> &[Constraint] {
        &self.list[..self.count]
    }

    fn push(&mut self, constraint: Constraint) {
        if let Some(slot) = self.list.get_mut(self.count) {
            *slot = constraint;
            self.count += 1;
        } else if let Some(slot) = self.list.iter_mut().max_by(|a, b| a.most_m_s.total_cmp(&b.most_m_s))
            && constraint.most_m_s < slot.most_m_s
        {
            *slot = constraint;
        }
    }

    /// The part of a turn that no constraint forbids at standstill.
    fn turn(&self, w_rad_s: f64) -> f64 {
        self.all().iter().fold(w_rad_s, |w_rad_s, constraint| {
            let corner = w_rad_s * constraint.moment_m;
            let most = constraint.most_m_s.max(0.0);
            if corner > most { w_rad_s * (most / corner) } else { w_rad_s }
        })
    }

    /// The greatest part of a speed that they all leave, and what leaves no more.
    fn part(&self, speed: &Twist2) -> (f64, LimitedBy) {
        self.all().iter().fold((1.0, LimitedBy::Nothing), |least, constraint| {
            let towards = dot(constraint.normal, [speed.vx_m_s, speed.vy_m_s]);
            let towards = towards + speed.w_rad_s * constraint.moment_m;
            let most = constraint.most_m_s.max(0.0);
            if towards * least.0 > most { (most / towards, constraint.by) } else { least }
        })
    }

    /// What they leave of speeds while the body turns so fast.
    fn at_turn(&self, w_rad_s: f64) -> Speeds<'_> {
        let leaving = Some(self.planes(w_rad_s, f64::NEG_INFINITY));
        Speeds { constraints: self, w_rad_s, leaving, staying: None }
    }

    /// At a turn, none of them stricter than `least_m_s`.
    fn planes(&self, w_rad_s: f64, least_m_s: f64) -> Planes {
        Planes::of(self.all().iter().map(|constraint| {
            let most_m_s = constraint.most_m_s.max(least_m_s) - w_rad_s * constraint.moment_m;
            Plane { normal: constraint.normal, most_m_s }
        }))
    }
}

/// Speeds that leave what is too near; in a pocket that closes not everything can be left at once, and then it is enough to come
/// nearer to nothing.
struct Speeds<'a> {
    constraints: &'a Constraints,
    w_rad_s: f64,
    leaving: Option<Planes>,
    staying: Option<Planes>,
}

impl Speeds<'_> {
    /// The speed within all constraints that is nearest to a wished one.
    fn within(&mut self, wish: Point) -> Point {
        if let Some(leaving) = &self.leaving {
            match leaving.nearest(wish) {
                Some(speed) => return speed,
                // It isn't tried with another wish in this cycle.
                None => self.leaving = None,
            }
        }
        let staying = self.staying.get_or_insert_with(|| self.constraints.planes(self.w_rad_s, 0.0));
        staying.nearest(wish).unwrap_or_default()
    }
}

impl Guard {
    /// A wish made gentle, and what held it back.
    pub(super) fn shape(&mut self, here: &Setpoint, drive: Drive<'_>, wish: Twist2, now: &Now) -> Shaped {
        let mut wish = self.clipped(wish);
        let mut by = LimitedBy::Nothing;
        if self.avoidance == AvoidanceKind::Circulate
            && let Some(circular) = self.circulating(here, drive, wish)
        {
            (wish, by) = (circular, LimitedBy::Obstacle);
        }
        let constraints = self.constraints(here, drive, wish, now);
        if constraints.count == 0 {
            self.detour_is_free();
            return Shaped { twist: wish, away: Twist2::default(), by };
        }
        if let Some(own) = self.path_kept(drive) {
            self.detour_is_free();
            self.waiting_rate = constraints.part(&own).0;
            let (part, by) = constraints.part(&wish);
            return Shaped { twist: wish.scaled(part), away: Twist2::default(), by };
        }
        let wished = [wish.vx_m_s, wish.vy_m_s];
        let w_rad_s = constraints.turn(wish.w_rad_s);
        let mut speeds = constraints.at_turn(w_rad_s);
        let mut speed = speeds.within(wished);
        let is_against = |constraint: &&Constraint| {
            dot(constraint.normal, wished) + w_rad_s * constraint.moment_m > constraint.most_m_s + 1e-9
        };
        if let Some(first) = constraints.all().iter().find(is_against) {
            by = first.by;
        }
        if let Drive::Follow(_) = drive
            && self.avoidance == AvoidanceKind::Guarded
        {
            speed = self.around(here, &constraints, &mut speeds, wished, speed, w_rad_s);
        }
        if w_rad_s != wish.w_rad_s && by == LimitedBy::Nothing {
            by = constraints.all().first().map_or(by, |constraint| constraint.by);
        }
        let [vx_m_s, vy_m_s] = speeds.within([0.0; 2]);
        Shaped {
            twist: Twist2::new(speed[0], speed[1], w_rad_s),
            away: Twist2 { vx_m_s, vy_m_s, w_rad_s },
            by,
        }
    }

    /// Little less than the limits let through anyway, the direction kept: the acceleration across a turn at full speed
    /// must have room to end.
    fn clipped(&self, wish: Twist2) -> Twist2 {
        let (limit, change) = (self.limits.speed_m_s, self.braking.greatest_change_m_s());
        let most = (limit * limit - change * change).max(0.0).sqrt().max(LEAST_SHARE * limit);
        let speed = wish.speed_m_s();
        let part = if speed > most { most / speed } else { 1.0 };
        let turn = self.limits.turn_speed_rad_s;
        Twist2::new(wish.vx_m_s * part, wish.vy_m_s * part, wish.w_rad_s.clamp(-turn, turn))
    }

    fn constraints(&self, here: &Setpoint, drive: Drive<'_>, wish: Twist2, now: &Now) -> Constraints {
        let mut constraints = Constraints { list: [Constraint::default(); MOST], count: 0 };
        let wished_m_s = length([wish.vx_m_s, wish.vy_m_s]);
        let towards = Towards { wished_m_s, fastest_m_s: self.fastest_m_s() };
        if self.fence.is_some() {
            self.keep_inside(&mut constraints, drive, now, &towards);
        }
        if self.heeds_obstacles() {
            self.keep_off(&mut constraints, here, drive, now, &towards);
        }
        constraints
    }

    /// No part of the body is ever faster, m/s.
    fn fastest_m_s(&self) -> f64 {
        self.limits.speed_m_s + self.outline.reach_m() * self.limits.turn_speed_rad_s
    }

    /// What is kept more than must be, m. Who keeps a path doesn't slide along anything.
    fn buffer_m(&self, drive: Drive<'_>) -> f64 {
        if self.path_kept(drive).is_some() { BUFFER_M[0] } else { self.most_buffer_m() }
    }

    fn most_buffer_m(&self) -> f64 {
        (BUFFER_M[0] + self.braking.greatest_bend_m()).min(BUFFER_M[1])
    }

    /// How much further than must be kept an obstacle that comes at a speed is where it holds nothing back, m.
    pub(super) fn far_m(&self, here: &Setpoint, comes_m_s: f64) -> f64 {
        let stop_s = if comes_m_s > 0.0 { self.braking.stop(here.twist_in_odom.speed_m_s()).1 } else { 0.0 };
        let approach_m = self.braking.approach_way_m(self.fastest_m_s() + comes_m_s, self.outline.reach_m());
        FAR * (self.most_buffer_m() + comes_m_s * stop_s + approach_m)
    }

    /// The greatest speed towards something with so much more room than is needed, m/s.
    fn most_m_s(&self, gap_m: f64, towards: &Towards) -> f64 {
        if gap_m < 0.0 {
            return -(-gap_m * PUSH_BACK_1_S).min(PUSH_BACK_SHARE * towards.wished_m_s);
        }
        self.braking.approach_m_s(gap_m, self.outline.reach_m())
    }

    fn keep_inside(&self, constraints: &mut Constraints, drive: Drive<'_>, now: &Now, towards: &Towards) {
        let Some((_, fence)) = &self.fence else { return };
        let (body, origin) = (self.outline.at(now.place), now.place.origin);
        let need_m = now.fence_need_m.standing_m + self.buffer_m(drive);
        // A plan from where there is too little room gains it on its own path.
        let keeps_its_path = matches!(drive, Drive::Follow(_)) && now.is_too_near_the_fence();
        let least_m_s = if keeps_its_path { 0.0 } else { f64::NEG_INFINITY };
        let most_m_s = |distance_m: f64| self.most_m_s(distance_m - need_m, towards).max(least_m_s);
        let approach_m = self.braking.approach_way_m(towards.fastest_m_s, self.outline.reach_m());
        let far_m = need_m + FAR * approach_m;
        let is_inside = now.fence_m > 0.0;
        // No part of the body is nearer.
        if is_inside && now.fence_m > far_m {
            return;
        }
        let (centre, radius_m) = body.circle();
        let is_near = |wall: &Wall| !is_inside || length(wall.side.way_from(centre)) <= far_m + radius_m;
        let mut add = |corner: Point, way: Point, distance_m: f64| {
            let (size, most_m_s) = (length(way), most_m_s(distance_m));
            if most_m_s < towards.fastest_m_s && size > 0.0 {
                let normal = [way[0] / size, way[1] / size];
                let moment_m = cross(plus(corner, origin, -1.0), normal);
                let by = LimitedBy::Fence;
                constraints.push(Constraint { normal, moment_m, most_m_s, by, around: [0.0; 2] });
            }
        };
        let mut near = [false; MAX_FENCE_CORNERS];
        fence.walls().iter().zip(&mut near).for_each(|(wall, near)| *near = is_near(wall));
        for corner in body.corners() {
            let inside = is_inside || fence.has_inside(corner);
            for wall in fence.walls().iter().zip(near).filter_map(|(wall, is_near)| is_near.then_some(wall)) {
                let way = wall.side.way_from(corner);
                let distance_m = length(way);
                if inside && distance_m > 1e-6 {
                    if distance_m > far_m {
                        continue;
                    }
                    add(corner, way, distance_m);
                } else if distance_m <= 1e-6 || distance_m <= fence.nearest_m(corner) {
                    // On the fence or outside: outwards is away from the side that is nearest.
                    add(corner, wall.outward, -distance_m);
                }
            }
        }
        for corner in fence.inward_corners() {
            let on = body.nearest(corner);
            let way = plus(corner, on, -1.0);
            if body.covers(corner) {
                add(on, [-way[0], -way[1]], -length(way));
            } else {
                add(on, way, length(way));
            }
        }
    }

    fn keep_off(
        &self,
        constraints: &mut Constraints,
        here: &Setpoint,
        drive: Drive<'_>,
        now: &Now,
        towards: &Towards,
    ) {
        let (body, origin) = (self.outline.at(now.place), now.place.origin);
        let need_m = now.obstacle_need_m.standing_m + self.buffer_m(drive);
        let (_, stop_s) = self.braking.stop(here.twist_in_odom.speed_m_s());
        for (obstacle, room_m) in self.obstacles.iter().zip(now.obstacles_m) {
            let Some(obstacle) = obstacle.filter(|_| room_m < f64::INFINITY) else { continue };
            let normal = body.sight(obstacle.centre_m).normal;
            // While the platform stops, an obstacle that comes nearer comes nearer.
            let comes = (-dot(normal, obstacle.velocity_m_s)).max(0.0);
            let mut most_m_s = self.most_m_s(room_m - need_m - comes * stop_s, towards);
            if matches!(drive, Drive::Follow(_)) && self.path_kept(drive).is_none() {
                // A plan gives way; a person's speed, or who keeps a path, is only held back.
                most_m_s -= comes;
            } else if comes > 0.0 {
                most_m_s = (most_m_s - comes).max(most_m_s.min(0.0));
            }
            if most_m_s < towards.fastest_m_s {
                let moment_m = cross(plus(obstacle.centre_m, origin, -1.0), normal);
                let around = plus(origin, obstacle.centre_m, -1.0);
                let by = LimitedBy::Obstacle;
                constraints.push(Constraint { normal, moment_m, most_m_s, by, around });
            }
        }
    }

    /// The way around: where obstacles leave little of a wish, along them, in one sense until it is no longer needed.
    fn around(
        &mut self,
        here: &Setpoint,
        constraints: &Constraints,
        speeds: &mut Speeds<'_>,
        wished: Point,
        speed: Point,
        w_rad_s: f64,
    ) -> Point {
        let size = length(wished);
        let obstacles = || constraints.all().iter().filter(|constraint| constraint.by == LimitedBy::Obstacle);
        let blocks = |constraint: &Constraint| {
            dot(constraint.normal, wished) + w_rad_s * constraint.moment_m > constraint.most_m_s
        };
        let is_little = size > 0.0 && dot(speed, wished) < LITTLE * size * size;
        let blocking = obstacles().find(|constraint| blocks(constraint));
        let (Some(first), true) = (blocking, is_little) else {
            if blocking.is_none() {
                self.detour_is_free();
            }
            return speed;
        };
        self.detour.free_s = 0.0;
        let sense = *self.detour.sense.get_or_insert(Sense::nearer(first.around, wished));
        let pace = (AROUND * self.limits.speed_m_s).min(size);
        let mut best = ([0.0; 2], 0.0);
        for constraint in obstacles() {
            let tangent = sense.tangent(constraint.around);
            let along = speeds.within([tangent[0] * pace, tangent[1] * pace]);
            let progress = dot(along, tangent);
            if progress > best.1 {
                best = (along, progress);
            }
        }
        if best.1 < 0.1 * pace && here.twist_in_odom.speed_m_s() < 0.1 * pace {
            self.detour.stuck_s += self.period_s;
            if self.detour.stuck_s > STUCK_S {
                self.detour.sense = Some(sense.other());
                self.detour.stuck_s = 0.0;
            }
        } else {
            self.detour.stuck_s = 0.0;
        }
        if best.1 > 0.0 { best.0 } else { speed }
    }

    fn detour_is_free(&mut self) {
        self.detour.free_s += self.period_s;
        if self.detour.free_s > FREE_S {
            self.detour = Detour::default();
        }
    }

    /// The thesis's avoidance (8.3.6), of the nearest obstacle alone: within its safety circle the speed is
    /// replaced by a circular one, in the sense nearer to the wished speed, of a coefficient times the circle's
    /// radius, until the straight way to where the plan is no longer enters the circle.
    ///
    /// Like there, the platform's limits and braking aren't counted.
    fn circulating(&self, here: &Setpoint, drive: Drive<'_>, wish: Twist2) -> Option<Twist2> {
        let origin = [here.odom_from_body.x_m, here.odom_from_body.y_m];
        let reach = |centre: Point, radius_m: f64| length(plus(origin, centre, -1.0)) - radius_m;
        let obstacle = self
            .obstacles
            .iter()
            .flatten()
            .min_by(|a, b| reach(a.centre_m, a.radius_m).total_cmp(&reach(b.centre_m, b.radius_m)))?;
        let circle_m = obstacle.radius_m + self.outline.reach_m() + self.distance_m;
        let around = plus(origin, obstacle.centre_m, -1.0);
        let wished = [wish.vx_m_s, wish.vy_m_s];
        let way = match drive {
            Drive::Follow(plan) => {
                let place = plan.wished.odom_from_body;
                plus([place.x_m, place.y_m], origin, -1.0)
            }
            Drive::Toward(_) => wished,
            Drive::Stop => return None,
        };
        if length(around) >= circle_m || dot(way, around) >= 0.0 || length(wished) == 0.0 {
            return None;
        }
        let tangent = Sense::nearer(around, wished).tangent(around);
        let speed = self.circulate_1_s * circle_m;
        Some(Twist2::new(tangent[0] * speed, tangent[1] * speed, wish.w_rad_s))
    }
}
