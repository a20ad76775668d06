//! Fence and obstacles: what of a motion the footprint may do.
//!
//! Two layers. `shaping` makes a wish gentle: near a wall only the part that leads outwards is slowed, so that
//! one slides along it, and around an obstacle.
//!
//! What counts is the check behind it: a cycle's motion is let through only if the stop after it (`braking`) is
//! known to keep the footprint inside the fence and off every obstacle. Else the platform brakes, and that stop
//! was let through in the cycle before. So it holds for ever, by induction.
//!
//! Where the floor turns out to carry less than was thought, the stop that was let through stays as hard as it
//! was until a softer one is known to suffice.

mod braking;
mod draft;
pub(crate) mod fence;
pub(crate) mod outline;
mod planes;
mod retreat;
pub(crate) mod shape;
mod shaping;
mod spread;
#[cfg(test)]
mod tests;

use omnibase_platform::{Pose2, PoseGrowth, Twist2, wrap_angle_rad};

use crate::config::{AvoidanceKind, FencePlan, GuardPlan, Limits};
use crate::limiter::{Limiter, SpeedBound};
pub use crate::obstacle::{MAX_OBSTACLES, Obstacle};
use crate::signals::{CycleTime, GuardReport, LimitedBy, PlatformState, Setpoint};
use braking::{Braking, Sweep};
use draft::Draft;
pub use draft::check_fence;
use fence::Fence;
use outline::{Body, BodyPose, Outline};
use retreat::Retreat;
pub use shape::MAX_FENCE_CORNERS;
use shape::{Patch, length, plus};
use shaping::{Detour, Shaped};
pub use spread::spread_m;
use spread::{Spread, WayLeft};

/// By how much less room than must be kept counts as kept: rounding, m.
const ROUNDING_M: f64 = 1e-9;
/// By how much less counts as being inside of what must be kept, from where only the way out is open, m.
const INSIDE_M: f64 = 1e-4;
/// What rounding may add to a speed.
const SPEED_ROUNDING: f64 = 1.0 + 1e-9;
/// A lag behind the plan up to which its time goes on at its rate, m.
const LAG_ALLOWED_M: f64 = 0.1;
/// A lag at which it waits, m.
const LAG_WAITS_M: f64 = 0.3;

/// What a cycle wants to do.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Drive<'a> {
    /// Follow a plan.
    Follow(&'a Followed),
    /// A person's or a program's speed.
    Toward(Twist2),
    /// Stop.
    Stop,
}

/// A plan that is followed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Followed {
    /// Where the platform should be.
    pub(crate) wished: Setpoint,
    /// How fast that may be caught up with.
    pub(crate) most: SpeedBound,
    /// Where its path is never left: the speed on it at its full rate.
    pub(crate) on_path: Option<Twist2>,
}

/// What must be kept, and what room there is now.
#[derive(Clone, Copy, Debug)]
struct Now {
    /// Where the body is.
    place: BodyPose,
    /// The greatest speed of the stop from here, m/s.
    fastest_m_s: f64,
    /// How far the platform isn't where it shall be, m.
    error_m: f64,
    /// What is to be kept, here and at the end of the stop from here.
    fence_need_m: Need,
    obstacle_need_m: Need,
    fence_m: f64,
    /// Infinite where one is so far that it holds nothing back.
    obstacles_m: [f64; MAX_OBSTACLES],
}

/// The room that a place leaves to the fence.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RoomLeft {
    /// From the footprint, m; below 0 outside.
    pub(crate) room_m: f64,
    /// What must be kept, m.
    pub(crate) kept_m: f64,
}

impl RoomLeft {
    pub(crate) fn is_enough(&self) -> bool {
        self.room_m >= self.kept_m
    }
}

/// What is to be kept, m.
#[derive(Clone, Copy, Debug)]
struct Need {
    /// For what isn't followed, and what is wished to be kept.
    apart_m: f64,
    /// With where the platform may truly be now.
    here_m: f64,
    /// With where it may truly be once it stands.
    standing_m: f64,
}

impl Now {
    /// Only the way out is open.
    fn is_too_near_the_fence(&self) -> bool {
        self.fence_m < self.fence_need_m.here_m - INSIDE_M
    }
}

/// Keeps the footprint inside the fence and off obstacles.
#[derive(Clone, Debug)]
pub(crate) struct Guard {
    outline: Outline,
    fence: Option<(FencePlan, Fence)>,
    /// One that is being told while the robot runs.
    draft: Draft,
    braking: Braking,
    limits: Limits,
    /// Those of a plan that is followed.
    followed: Limits,
    period_s: f64,
    obstacles: [Option<Obstacle>; MAX_OBSTACLES],
    any_obstacle: bool,
    /// How uncertain the believed pose is, and how it becomes more so.
    spread: Spread,
    growth: PoseGrowth,
    obstacle_sigmas: f64,
    /// The cycle up to which they moved, ns.
    last_ns: Option<u64>,
    pub(crate) avoidance: AvoidanceKind,
    pub(crate) distance_m: f64,
    pub(crate) circulate_1_s: f64,
    detour: Detour,
    pace: f64,
    /// The greatest rate of a plan that waits on its path.
    waiting_rate: f64,
    limited_by: LimitedBy,
}

impl Guard {
    pub(crate) fn new(plan: &GuardPlan, limits: &Limits, period_s: f64, growth: &PoseGrowth) -> Self {
        let mut obstacles = [None; MAX_OBSTACLES];
        for (slot, obstacle) in obstacles.iter_mut().zip(&plan.obstacles) {
            *slot = Some(*obstacle);
        }
        Guard {
            outline: Outline::new(&plan.footprint_m),
            fence: plan.fence.as_ref().map(|plan| (plan.clone(), Fence::new(&plan.corners_m))),
            draft: Draft::new(),
            braking: Braking::new(limits, period_s),
            limits: *limits,
            followed: *limits,
            period_s,
            any_obstacle: !plan.obstacles.is_empty(),
            obstacles,
            spread: Spread::default(),
            growth: *growth,
            obstacle_sigmas: plan.obstacle_sigmas,
            last_ns: None,
            avoidance: plan.avoidance,
            distance_m: plan.distance_m,
            circulate_1_s: plan.circulate_1_s,
            detour: Detour::default(),
            pace: 1.0,
            waiting_rate: 1.0,
            limited_by: LimitedBy::Nothing,
        }
    }

    pub(crate) fn obstacles(&self) -> &[Option<Obstacle>; MAX_OBSTACLES] {
        &self.obstacles
    }

    /// Puts, moves or takes away an obstacle; `Err` where there is no such place, or no such obstacle.
    pub(crate) fn set(&mut self, index: u32, obstacle: Option<Obstacle>) -> Result<(), ()> {
        let slot = self.obstacles.get_mut(index as usize).ok_or(())?;
        if obstacle.is_some_and(|obstacle| !obstacle.is_possible()) {
            return Err(());
        }
        *slot = obstacle;
        self.any_obstacle = self.obstacles.iter().any(Option::is_some);
        Ok(())
    }

    /// Obstacles move on by the time that passed, however many cycles were left out; and what is known of the pose.
    pub(crate) fn advance(&mut self, time: &CycleTime, state: &PlatformState) {
        self.spread = Spread::of(state);
        let last_ns = self.last_ns.replace(time.now_ns).unwrap_or(time.now_ns);
        let elapsed_s = time.now_ns.saturating_sub(last_ns) as f64 * 1e-9;
        if !self.any_obstacle {
            return;
        }
        for obstacle in self.obstacles.iter_mut().flatten() {
            obstacle.centre_m = obstacle.centre_after_m(elapsed_s);
        }
    }

    /// What is left of the rate at which a plan's time shall go on: it waits for a platform that had to give way, and on a path that is
    /// never left for what stands in it.
    pub(crate) fn left_of(&self, rate: f64) -> f64 {
        (rate * self.pace).min(self.waiting_rate)
    }

    /// What held the motion back in this cycle.
    pub(crate) fn limited_by(&self) -> LimitedBy {
        self.limited_by
    }

    /// The limits to which motions keep from now on; no motion is let through whose stop needs more. What was let through before
    /// keeps the stop that was promised with it.
    /// A plan that is followed keeps to `followed`: then only what stops it is bound to the others.
    pub(crate) fn keep_to(&mut self, limits: &Limits, followed: &Limits) {
        self.followed = *followed;
        if self.limits != *limits {
            (self.limits, self.braking) = (*limits, Braking::new(limits, self.period_s));
        }
    }

    pub(crate) fn has_fence(&self) -> bool {
        self.fence.is_some()
    }

    /// What room a pose leaves to the fence, by what is known of the pose now; infinite without a fence.
    pub(crate) fn room_left(&self, pose: &Pose2) -> RoomLeft {
        let Some((plan, fence)) = &self.fence else {
            return RoomLeft { room_m: f64::INFINITY, kept_m: 0.0 };
        };
        RoomLeft { room_m: fence.room_m(&self.outline.placed(pose)), kept_m: self.fence_kept_m(plan) }
    }

    fn fence_kept_m(&self, fence: &FencePlan) -> f64 {
        fence.margin_m + fence.sigmas * self.spread.at_m(self.outline.reach_m())
    }

    /// Whether an obstacle, where it is now, is nearer to a pose than is to be kept from it.
    pub(crate) fn is_blocked(&self, pose: &Pose2) -> bool {
        let body = self.outline.placed(pose);
        let kept_m =
            self.distance_m + self.obstacle_sigmas * self.spread.at_m(self.outline.reach_m()) - INSIDE_M;
        self.avoidance != AvoidanceKind::Off
            && self.obstacles.iter().flatten().any(|obstacle| distance_m(&body, obstacle) < kept_m)
    }

    /// What is to be shown and recorded, about a believed pose.
    pub(crate) fn report(&self, odom_from_body: &Pose2) -> GuardReport {
        let mut report = GuardReport { limited_by: self.limited_by, ..Default::default() };
        if self.is_idle() || !odom_from_body.is_finite() {
            return report;
        }
        let body = self.outline.placed(odom_from_body);
        if let Some((plan, fence)) = &self.fence {
            report.fence_margin_m = Some(fence.room_m(&body));
            report.fence_kept_m = Some(self.fence_kept_m(plan));
        }
        for (number, obstacle) in (1..).zip(&self.obstacles) {
            let Some(obstacle) = obstacle else { continue };
            let may_be_nearer = |least_m: f64| distance_at_least_m(&body, obstacle) <= least_m;
            if !report.obstacle_distance_m.is_none_or(may_be_nearer) {
                continue;
            }
            let distance_m = distance_m(&body, obstacle);
            if report.obstacle_distance_m.is_none_or(|least| distance_m < least) {
                (report.obstacle_distance_m, report.nearest_obstacle) = (Some(distance_m), number);
            }
        }
        report
    }

    fn is_idle(&self) -> bool {
        self.fence.is_none() && !self.any_obstacle
    }

    fn heeds_obstacles(&self) -> bool {
        self.avoidance == AvoidanceKind::Guarded
    }

    /// The speed of a plan at its full rate, where obstacles never make it leave its path.
    fn path_kept(&self, drive: Drive<'_>) -> Option<Twist2> {
        match drive {
            Drive::Follow(plan) if self.heeds_obstacles() => plan.on_path,
            Drive::Follow(_) | Drive::Toward(_) | Drive::Stop => None,
        }
    }

    /// One period: as much of what is wanted as fence and obstacles let through.
    pub(crate) fn step(
        &mut self,
        limiter: &mut Limiter,
        drive: Drive<'_>,
        state: &PlatformState,
    ) -> Setpoint {
        self.limited_by = LimitedBy::Nothing;
        (self.pace, self.waiting_rate) = (1.0, 1.0);
        let wish = match drive {
            Drive::Follow(plan) => plan.most.hold(limiter.leading_to(&plan.wished)),
            Drive::Toward(twist) => twist,
            Drive::Stop => Twist2::default(),
        };
        let here = limiter.setpoint();
        let driven = match drive {
            Drive::Follow(..) => self.followed,
            Drive::Toward(_) | Drive::Stop => self.limits,
        };
        if self.is_idle() {
            limiter.set_limits(&driven);
            return limiter.toward(wish);
        }
        if !wish.is_finite() || !here.is_finite() || !state.is_finite() {
            // Nothing is known of any motion but of the stop that was let through before.
            return limiter.brake();
        }
        let now = self.now(&here, state);
        let Shaped { twist: shaped, away, by: cause } = self.shape(&here, drive, wish, &now);
        let is_unhindered = cause == LimitedBy::Nothing;
        if let Drive::Follow(plan) = drive {
            self.pace = self.pace_of(&here, &plan.wished, &now);
        }
        let half = shaped.scaled(0.5);
        // Who keeps the path goes along it as a whole.
        let [straight, turning] = match self.path_kept(drive) {
            Some(_) => [Twist2::default(); 2],
            None => [Twist2::new(shaped.vx_m_s, shaped.vy_m_s, 0.0), Twist2::new(0.0, 0.0, shaped.w_rad_s)],
        };
        let mut cause = cause;
        let candidates = [shaped, half, away, straight, turning, Twist2::default()];
        for (number, candidate) in candidates.into_iter().enumerate() {
            if candidates[..number].contains(&candidate) {
                // It was refused already.
                continue;
            }
            let mut tried = limiter.clone();
            // Only the plan itself was planned: a way around it keeps to what every direction carries.
            tried.set_limits(if is_unhindered && number == 0 { &driven } else { &self.limits });
            let next = tried.toward(candidate);
            // The stop after it.
            tried.set_limits(&self.limits);
            match self.check([&here, &next], &now) {
                Ok(()) => {
                    *limiter = tried;
                    self.limited_by = cause;
                    return next;
                }
                Err(by) if cause == LimitedBy::Nothing => cause = by,
                Err(_) => {}
            }
        }
        self.limited_by = cause;
        limiter.brake()
    }

    fn now(&self, here: &Setpoint, state: &PlatformState) -> Now {
        // As far as the platform isn't where it shall be, it may be nearer.
        let (pose, believed) = (here.odom_from_body, state.odom_from_body);
        let turn_rad = wrap_angle_rad(pose.heading_rad - believed.heading_rad);
        let error_m = pose.distance_m(believed) + self.outline.reach_m() * turn_rad.abs();
        let place = BodyPose::of(&pose);
        let body = self.outline.at(place);
        let fence_m = self.fence.as_ref().map_or(f64::INFINITY, |(_, fence)| fence.room_m(&body));
        let stop = self.braking.of(here);
        let (here_m, standing_m) = {
            let left = self.way_left(&stop, here, error_m);
            let standing = self.spread.after(&left, &self.growth);
            (self.spread.at_m(self.outline.reach_m()), standing.at_m(self.outline.reach_m()))
        };
        let need = |kept_m: f64, sigmas: f64| {
            let apart_m = kept_m.max(error_m);
            Need { apart_m, here_m: apart_m + sigmas * here_m, standing_m: apart_m + sigmas * standing_m }
        };
        let (margin_m, sigmas) =
            self.fence.as_ref().map_or((0.0, 0.0), |(fence, _)| (fence.margin_m, fence.sigmas));
        let obstacle_need_m = need(self.distance_m, self.obstacle_sigmas);
        let obstacles_m = self.near_obstacles_m(here, &body, obstacle_need_m.standing_m);
        Now {
            place,
            fastest_m_s: stop.fastest_m_s,
            error_m,
            fence_need_m: need(margin_m, sigmas),
            obstacle_need_m,
            fence_m,
            obstacles_m,
        }
    }

    /// The distances of obstacles that may hold something back.
    fn near_obstacles_m(&self, here: &Setpoint, body: &Body<'_>, need_m: f64) -> [f64; MAX_OBSTACLES] {
        let mut obstacles_m = [f64::INFINITY; MAX_OBSTACLES];
        let standing_far_m = self.far_m(here, 0.0);
        for (slot, obstacle) in obstacles_m.iter_mut().zip(&self.obstacles) {
            let Some(obstacle) = obstacle else { continue };
            let comes_m_s = length(obstacle.velocity_m_s);
            let far_m = if comes_m_s == 0.0 { standing_far_m } else { self.far_m(here, comes_m_s) };
            if distance_at_least_m(body, obstacle) < need_m + far_m {
                *slot = distance_m(body, obstacle);
            }
        }
        obstacles_m
    }

    /// The way, of which the believed pose still knows nothing, until a stop stands.
    fn way_left(&self, sweep: &Sweep, at: &Setpoint, error_m: f64) -> WayLeft {
        let [least, greatest] = sweep.turn_rad;
        let twist = &at.twist_in_odom;
        WayLeft {
            way_m: length(sweep.way) + 2.0 * sweep.bend_m + self.period_s * twist.speed_m_s() + error_m,
            turn_rad: greatest - least + self.period_s * twist.w_rad_s.abs(),
            duration_s: sweep.duration_s + self.period_s,
        }
    }

    /// Whether the stop after a cycle's motion is known to keep off fence and obstacles; `Err` says what it may meet.
    fn check(&self, [here, next]: [&Setpoint; 2], now: &Now) -> Result<(), LimitedBy> {
        let sweep = self.braking.of(next);
        // The stop itself must keep the limit on speed; where the one from here doesn't, for nothing was near while it went round or limits
        // were lowered, it must become no faster.
        if sweep.fastest_m_s > self.limits.speed_m_s.max(now.fastest_m_s) * SPEED_ROUNDING {
            return Err(LimitedBy::Nothing);
        }
        let [least, greatest] = sweep.turn_rad;
        let pose = next.odom_from_body;
        let middle = Pose2 { heading_rad: pose.heading_rad + 0.5 * (least + greatest), ..pose };
        let body = self.outline.placed(&middle);
        let twist = &next.twist_in_odom;
        // A corner moves by its radius times the angle at most; and between two cycles there is a way, too.
        let around_m = sweep.bend_m
            + self.outline.reach_m() * 0.5 * (greatest - least)
            + 0.5 * self.period_s * (twist.speed_m_s() + self.outline.reach_m() * twist.w_rad_s.abs());
        let retreat = || Retreat::new(now.place, &self.outline, [here, next], &sweep);
        let reach_m = length(sweep.way) + 2.0 * around_m;
        // What is known of the pose grows worse until the stop stands.
        let standing = self.spread.after(&self.way_left(&sweep, next, now.error_m), &self.growth);
        let spread_m = standing.at_m(self.outline.reach_m());
        if let Some((plan, fence)) = &self.fence {
            let fence_need_m = now.fence_need_m.apart_m + plan.sigmas * spread_m;
            let is_free = if now.is_too_near_the_fence() {
                retreat().leaves_fence(fence, [fence_need_m, reach_m])
            } else {
                let need_m = kept_m(fence_need_m, now.fence_m);
                let needed_m = need_m + around_m;
                fence.swept_room_m(&body, sweep.way, needed_m) >= needed_m
            };
            if !is_free {
                return Err(LimitedBy::Fence);
            }
        }
        if !self.heeds_obstacles() {
            return Ok(());
        }
        let reach_m = reach_m + self.outline.reach_m();
        let obstacle_need_m = now.obstacle_need_m.apart_m + self.obstacle_sigmas * spread_m;
        for (obstacle, room_now) in self.obstacles.iter().zip(now.obstacles_m) {
            let Some(obstacle) = obstacle else { continue };
            let lasting_s = sweep.duration_s + self.period_s;
            let moves = [obstacle.velocity_m_s[0] * lasting_s, obstacle.velocity_m_s[1] * lasting_s];
            // Too far away for any doubt.
            let apart_m = length(plus(obstacle.centre_m, [pose.x_m, pose.y_m], -1.0));
            if apart_m - obstacle.radius_m - length(moves) > reach_m + obstacle_need_m {
                continue;
            }
            // What moves comes nearer by itself, not by rounding.
            let rounding_m = if obstacle.velocity_m_s == [0.0; 2] { INSIDE_M } else { ROUNDING_M };
            let is_free = if room_now < now.obstacle_need_m.here_m - rounding_m {
                // The cycle that is being computed is driven after this one.
                retreat().leaves(obstacle.centre_m, plus(moves, obstacle.velocity_m_s, self.period_s))
            } else {
                let need_m = kept_m(obstacle_need_m, room_now);
                let across = [-sweep.way[0], -sweep.way[1]];
                let patch = Patch { origin: obstacle.centre_m, along: moves, across };
                let needed_m = need_m + around_m + obstacle.radius_m;
                body.distance_m(&patch, needed_m) >= needed_m
            };
            if !is_free {
                return Err(LimitedBy::Obstacle);
            }
        }
        Ok(())
    }

    /// A plan waits for a platform that had to give way, unless it is just where no platform can be.
    fn pace_of(&self, here: &Setpoint, wished: &Setpoint, now: &Now) -> f64 {
        let lag_m = here.odom_from_body.distance_m(wished.odom_from_body);
        if !self.heeds_obstacles() || lag_m <= LAG_ALLOWED_M {
            return 1.0;
        }
        let body = self.outline.placed(&wished.odom_from_body);
        let free = |obstacle: &Obstacle| distance_m(&body, obstacle) >= now.obstacle_need_m.here_m;
        if self.obstacles.iter().flatten().all(free) {
            ((LAG_WAITS_M - lag_m) / (LAG_WAITS_M - LAG_ALLOWED_M)).clamp(0.0, 1.0)
        } else {
            1.0
        }
    }
}

/// What is to be kept where it is kept now, but for rounding, m.
fn kept_m(need_m: f64, room_m: f64) -> f64 {
    need_m.min(room_m.max(need_m - INSIDE_M)) - ROUNDING_M
}

/// From a body to an obstacle; below 0 where they overlap.
fn distance_m(body: &Body<'_>, obstacle: &Obstacle) -> f64 {
    body.distance_to_m(obstacle.centre_m) - obstacle.radius_m
}

/// At most that.
fn distance_at_least_m(body: &Body<'_>, obstacle: &Obstacle) -> f64 {
    body.distance_at_least_m(obstacle.centre_m) - obstacle.radius_m
}
