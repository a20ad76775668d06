//! What a tracking robot follows: its reference at a rate, a velocity command, or the way to a pose.

mod begin;
mod catch_up;
mod foothold;
mod headway;
mod room;
mod way;

use omnibase_platform::{Pose2, Twist2};
use omnibase_trajectory::{LimitsError, TwistLimiter};

use crate::config::{GuardPlan, Limits, SafetyPlan};
use crate::guard::{Followed, Guard};
use crate::limiter::SpeedBound;
use crate::settings::Settings;
use crate::signals::{Course, CycleTime, Inputs, Outputs, ReferenceStatus, Request, Setpoint};
use crate::stages::Reference;
pub(crate) use begin::From;
use catch_up::CatchUp;
pub(crate) use foothold::{Asked, Carried};
use foothold::{Foothold, LEAST_RATE, limits_of_rate, rate_limits};
pub(crate) use headway::is_there;
use headway::{Headway, PlanStep};
use room::{Ahead, LOOK_STEP_S, RoomHad};
use way::{PlannedMotion, Then};

/// A setpoint whose speed is nearer to its wish than this goes with it, m/s and rad/s.
const WITH_PLAN: f64 = 0.02;

/// Farther than this from the place that was wished the platform has left its plan, m, whatever kept it from there.
const LEFT_M: f64 = 0.05;

/// What is followed, and where it is on its way.
pub(crate) struct Motion {
    reference: Box<dyn Reference>,
    /// Its number; 0 for the one of the plan.
    number: u32,
    /// Came from outside and waits for its request; afterwards the one that it replaced.
    offered: Option<(u32, Box<dyn Reference>)>,
    /// What is offered was asked for while the present one was followed: it is begun with the next `track`.
    is_next: bool,
    /// Where the reference was laid from.
    laid_from: Pose2,
    course: Course,
    velocity: Option<Request>,
    way: PlannedMotion,
    /// One that is planned, and gone only where it can be.
    tried: PlannedMotion,
    /// Fence or obstacles changed the last wish; and one since the plan began, or the platform left it.
    is_hindered: bool,
    was_hindered: bool,
    catch_up: CatchUp,
    /// Where the last wish was.
    wished_last: Pose2,
    /// The reference's own time, ns: exact as long as it runs at its full rate.
    time_ns: f64,
    now_ns: u64,
    /// Rate of the reference's time, and how it may change.
    rate: TwistLimiter,
    rate_now: f64,
    rate_change_1_s: f64,
    pausing: Pausing,
    /// How fast the rate may change, and how fast that may, 1/s and 1/s².
    rate_limits: [f64; 2],
    /// What the floor carries.
    carried: Carried,
    foothold: Foothold,
    /// The platform was led as a plan goes, since it began or since that needed no exemption.
    is_on_plan: bool,
    /// The greatest rate of a plan by how warm the motors were when it began.
    warm_rate: f64,
    ahead: Ahead,
    room_had: RoomHad,
    /// How much more room to the fence than it must its place leaves, m.
    spare_room_m: f64,
    /// The reference's speed at its full rate.
    planned: Twist2,
    /// Speed and acceleration at full rate of the place that was wished last.
    own: [Twist2; 2],
    /// The reference was begun and isn't at its end.
    begun: bool,
    headway: Headway,
    step: PlanStep,
    limits: Limits,
    start_distance_m: f64,
    start_heading_rad: f64,
}

/// Whether the reference shall come to a halt on its path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Pausing {
    No,
    Yes,
    /// Before the fence.
    AtFence,
}

/// Why a motion can't begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CantBegin {
    /// There is nothing to go on with, or no such reference.
    Nothing,
    /// The platform stands too far from the reference's start.
    TooFar,
    /// It would end outside of the fence.
    OutsideFence,
    /// An obstacle stands where it would begin, away from where the platform stands, or end.
    Blocked,
    /// The platform moves so that nothing leads onto the reference's beginning.
    Moving,
    /// Something is followed already.
    UnderWay,
}

impl Motion {
    pub(crate) fn new(
        reference: Box<dyn Reference>,
        limits: &Limits,
        safety: &SafetyPlan,
        guard: &GuardPlan,
        period_s: f64,
    ) -> Result<Self, LimitsError> {
        let rate_limits = rate_limits(limits, 1.0);
        Ok(Motion {
            reference,
            number: 0,
            offered: None,
            is_next: false,
            laid_from: Pose2::default(),
            course: Course::Reference,
            velocity: None,
            way: PlannedMotion::default(),
            tried: PlannedMotion::default(),
            is_hindered: false,
            was_hindered: false,
            catch_up: CatchUp::default(),
            wished_last: Pose2::default(),
            time_ns: 0.0,
            now_ns: 0,
            rate: TwistLimiter::new(&limits_of_rate(limits, rate_limits), period_s)?,
            rate_now: 1.0,
            rate_change_1_s: 0.0,
            pausing: Pausing::No,
            rate_limits,
            carried: Carried::ALL,
            foothold: Foothold::NEW,
            is_on_plan: false,
            warm_rate: 1.0,
            ahead: Ahead::from(0.0),
            room_had: RoomHad::default(),
            spare_room_m: f64::INFINITY,
            planned: Twist2::default(),
            own: Default::default(),
            begun: false,
            headway: Headway::new(guard),
            step: PlanStep::default(),
            limits: *limits,
            start_distance_m: safety.start_distance_m,
            start_heading_rad: safety.start_heading_rad,
        })
    }

    /// What the floor carries from now on: what is followed goes so much more slowly that it keeps to it.
    pub(crate) fn keep_to(&mut self, carried: Carried) {
        if carried.share != self.carried.share {
            self.rate_limits = rate_limits(&self.limits, carried.share);
            // They were possible with all of it.
            let _ = self.rate.set_limits(&limits_of_rate(&self.limits, self.rate_limits));
        }
        self.carried = carried;
    }

    /// Whether the platform goes as a plan for this floor and this mass says, so that nothing more holds it back.
    pub(crate) fn is_planned(&self) -> bool {
        self.course == Course::Reference
            && self.is_on_plan
            && self.reference.planned_for().is_some_and(|plan| self.carried.carries(&plan))
    }

    /// Whether a plan brakes already with all that it was planned with: to be slowed down as well would be too much.
    fn brakes_as_planned(&self) -> bool {
        let [v, a] = &self.own;
        self.is_planned()
            && self.carried.asked > Asked::AsPlanned
            && v.vx_m_s * a.vx_m_s + v.vy_m_s * a.vy_m_s < 0.0
    }

    /// The greatest rate of the reference from here on.
    fn foothold(&mut self) -> f64 {
        if self.is_planned() {
            return self.planned_rate();
        }
        let time_s = self.time_s();
        self.foothold.rate(&*self.reference, time_s, &self.limits, self.carried.share).min(self.warm_rate)
    }

    /// The rate of a plan that is gone along: it rises no further where wheels give all that was planned already.
    fn planned_rate(&self) -> f64 {
        let rate = self.full_rate();
        if self.carried.asked == Asked::AsPlanned { rate } else { rate.min(self.rate_now) }
    }

    /// The greatest rate of a plan, by how warm the motors are and how steep the floor is.
    fn full_rate(&self) -> f64 {
        let slope_rate = self.reference.planned_for().map_or(1.0, |plan| self.carried.slope_rate(&plan));
        self.warm_rate.min(slope_rate)
    }

    pub(crate) fn course(&self) -> Course {
        match (self.course, self.way.then) {
            (Course::Way, Then::Joins { .. }) => Course::Onto,
            (course, _) => course,
        }
    }

    pub(crate) fn velocity(&self) -> Option<&Request> {
        self.velocity.as_ref().filter(|_| self.course == Course::Velocity)
    }

    pub(crate) fn reference(&self) -> &dyn Reference {
        &*self.reference
    }

    /// The numbers of the reference that is followed, or would be gone on with, and of the one that is begun next.
    pub(crate) fn numbers(&self) -> [u32; 2] {
        let next = self.offered.as_ref().filter(|_| self.is_next);
        [self.number, next.map_or(self.number, |(number, _)| *number)]
    }

    /// The reference's own time, s.
    pub(crate) fn time_s(&self) -> f64 {
        self.time_ns * 1e-9
    }

    /// How far what is followed is beside the motion that was asked for, in its axes.
    pub(crate) fn correction(&self) -> Pose2 {
        match self.course {
            Course::Reference => self.reference.correction(self.time_s()),
            Course::Velocity | Course::Way | Course::Onto => Pose2::default(),
        }
    }

    pub(crate) fn rate(&self) -> f64 {
        self.rate_now
    }

    /// Whether the reference was left before its end, so that it can be gone on with.
    pub(crate) fn is_interrupted(&self) -> bool {
        self.begun
    }

    /// From a place with so much room to the fence, m.
    pub(crate) fn begin_with(&mut self, room_m: f64) {
        self.room_had = RoomHad::from(room_m);
    }

    /// A velocity command; one that counts already is replaced.
    pub(crate) fn follow(&mut self, request: Request) {
        self.velocity = Some(request);
        self.course = Course::Velocity;
    }

    /// The reference slows down on its path until it stands.
    pub(crate) fn pause(&mut self) -> Result<(), CantBegin> {
        if self.course != Course::Reference {
            return Err(CantBegin::Nothing);
        }
        self.pausing = Pausing::Yes;
        Ok(())
    }

    /// Whether the reference stands on its path because it was paused.
    pub(crate) fn is_paused(&self) -> bool {
        self.course == Course::Reference && self.pausing != Pausing::No && self.rate_now == 0.0
    }

    /// Whether that is because its path leads out of the fence.
    pub(crate) fn is_paused_at_fence(&self) -> bool {
        self.is_paused() && self.pausing == Pausing::AtFence
    }

    /// Looks along the path; before the place where it leads out of the fence the reference comes to a halt on it.
    fn look_ahead(&mut self, guard: &Guard) {
        let [acceleration, jerk] = self.rate_limits;
        // The rate may still rise while its own change ends.
        let change = self.rate_change_1_s.max(0.0);
        let rate = self.rate_now + change * change / (2.0 * jerk);
        let stop_s =
            rate * (rate / (2.0 * acceleration) + (acceleration + change) / jerk) + 2.0 * LOOK_STEP_S;
        let needed_s = self.time_s() + stop_s;
        let leads_out = self.ahead.leads_out(&*self.reference, guard, needed_s);
        if leads_out && self.pausing == Pausing::No {
            self.pausing = Pausing::AtFence;
        }
    }

    /// What was followed is left; a reference can be gone on with.
    pub(crate) fn leave(&mut self) {
        self.velocity = None;
        self.course = Course::Reference;
    }

    /// Nothing of what was begun counts any more.
    pub(crate) fn forget(&mut self) {
        self.leave();
        self.begun = false;
    }

    /// The wish of a cycle, at a part of its rate where the platform had to give way; not for velocity commands, whose wish needs the setpoint.
    pub(crate) fn sample(
        &mut self,
        time: &CycleTime,
        here: &Setpoint,
        settings: &Settings,
        guard: &Guard,
    ) -> Setpoint {
        self.catch_up(&From { time, setpoint: *here, is_under_way: true, settings, guard });
        let wished = match self.course {
            Course::Way => self.sample_way(time, here, settings, guard),
            Course::Reference | Course::Velocity | Course::Onto => {
                self.sample_reference(time, settings, guard)
            }
        };
        self.spare_room_m = self.room_had.spare_m(guard.room_left(&wished.odom_from_body));
        wished
    }

    /// What comes in beside the drives, for the reference where one is followed.
    pub(crate) fn signals(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) {
        if self.course == Course::Reference {
            self.reference.signals(inputs, outputs);
        }
    }

    /// By how much what is followed keeps off the fence more than it must, m; below 0 where it leads out.
    pub(crate) fn spare_room_m(&self) -> f64 {
        self.spare_room_m
    }

    fn sample_way(
        &mut self,
        time: &CycleTime,
        here: &Setpoint,
        settings: &Settings,
        guard: &Guard,
    ) -> Setpoint {
        self.plan_anew(time, here, settings, guard);
        let carried = self.way.carried(self.carried.share).sqrt().max(LEAST_RATE);
        let rate = settings.rate(self.planned).min(carried);
        let left_s = self.way.left_s();
        self.way.time_ns += self.advance(time, rate, guard, left_s);
        if let Then::Joins { at_ns, rate } = self.way.then {
            // The path's own time that it would be at, were it followed so far.
            self.time_ns = self.time_ns.max(at_ns - rate * 1e9 * self.way.left_s());
            if self.way.is_over() {
                let was_hindered = self.was_hindered;
                self.begin_reference(time, rate);
                self.was_hindered = was_hindered;
                return self.sample_reference(time, settings, guard);
            }
        }
        let own = self.way.sample();
        self.step.speed = self.step.speed.greater(&SpeedBound::of(&own.twist_in_odom));
        let wished = self.at_rate(own);
        // From a state of motion at a limit, where its acceleration still ends, a way may lead beyond it for a moment.
        let Limits { speed_m_s, turn_speed_rad_s, .. } = self.limits;
        let twist_in_odom = SpeedBound { speed_m_s, turn_speed_rad_s }.hold(wished.twist_in_odom);
        Setpoint { twist_in_odom, ..wished }
    }

    fn sample_reference(&mut self, time: &CycleTime, settings: &Settings, guard: &Guard) -> Setpoint {
        if guard.has_fence() {
            self.look_ahead(guard);
        }
        let rate = match self.pausing {
            Pausing::Yes | Pausing::AtFence => 0.0,
            Pausing::No => settings.rate(self.planned).min(self.foothold()),
        };
        let rate = if self.brakes_as_planned() { rate.max(self.rate_now) } else { rate };
        let left_s = self.reference.duration_s().map_or(f64::INFINITY, |end_s| end_s - self.time_s());
        self.time_ns += self.advance(time, rate, guard, left_s);
        let own = self.reference.sample(self.time_s());
        self.planned = own.twist_in_odom;
        self.begun = own.status != ReferenceStatus::Finished;
        self.at_rate(own)
    }

    /// The rate goes towards what obstacles leave of what is wished; gives the time that passes at it, ns.
    fn advance(&mut self, time: &CycleTime, rate: f64, guard: &Guard, left_s: f64) -> f64 {
        let elapsed_ns = time.now_ns.saturating_sub(self.now_ns) as f64;
        self.now_ns = time.now_ns;
        if elapsed_ns > 0.0 {
            let before = self.rate_now;
            let limited = self.rate.step(Twist2::new(guard.left_of(rate), 0.0, 0.0));
            self.rate_now = limited.twist_in_odom.vx_m_s.clamp(0.0, 1.0);
            self.rate_change_1_s = limited.acceleration_in_odom.vx_m_s;
            self.wait_for_traction(before, elapsed_ns * 1e-9);
        }
        let passed_ns = self.rate_now * elapsed_ns;
        // It is still faster than it shall be while it is slowed down.
        let planned = self.planned.scaled(rate.max(self.rate_now));
        let passed_s = (passed_ns * 1e-9).min(left_s).max(0.0);
        let speed = SpeedBound::of(&planned);
        self.step = PlanStep { elapsed_s: elapsed_ns * 1e-9, passed_s, rate, speed };
        passed_ns
    }

    /// Where the wish speeds up more than the floor carries its rate falls at once, so that it doesn't: that asks for less of the floor.
    fn wait_for_traction(&mut self, before: f64, elapsed_s: f64) {
        let share = if self.is_planned() { 1.0 } else { self.carried.share };
        let carried = Carried { share, ..self.carried };
        let most_1_s = carried.rate_change(before, self.own, &self.limits);
        let Some(most_1_s) = most_1_s.filter(|most| self.rate_change_1_s > *most) else { return };
        self.rate_now = (before + elapsed_s * most_1_s).max(LEAST_RATE).min(self.rate_now);
        self.rate_change_1_s = (self.rate_now - before) / elapsed_s;
        self.rate.restart(Twist2::new(self.rate_now, 0.0, 0.0));
    }

    /// How fast the platform may be while it follows.
    fn bound(&self) -> SpeedBound {
        self.headway.bound(&self.step.speed)
    }

    /// What is followed, where it should be now.
    pub(crate) fn followed(&self, wished: &Setpoint) -> Followed {
        let on_path = self.keeps_path().then_some(self.own[0]);
        Followed { wished: *wished, most: self.bound(), on_path }
    }

    /// Whether obstacles make it wait on its path, and never leave it.
    fn keeps_path(&self) -> bool {
        self.needs_reference() && self.reference.keeps_path()
    }

    /// What became of a cycle's wish, and whether fence or obstacles changed it.
    pub(crate) fn note(&mut self, wished: &Setpoint, setpoint: &Setpoint, is_hindered: bool) {
        self.is_hindered = is_hindered;
        let lag_m = wished.odom_from_body.distance_m(setpoint.odom_from_body);
        self.was_hindered |= is_hindered || lag_m > LEFT_M;
        self.wished_last = wished.odom_from_body;
        if self.course != Course::Velocity {
            self.headway.note(&self.step, [wished, setpoint]);
        }
        if is_hindered && self.course == Course::Reference && self.reference.keeps_path() {
            self.fall_back(wished, setpoint);
        }
        let (plan, here) = (&wished.twist_in_odom, &setpoint.twist_in_odom);
        let goes_with = headway::is_there(&wished.odom_from_body, &setpoint.odom_from_body)
            && omnibase_platform::length([plan.vx_m_s - here.vx_m_s, plan.vy_m_s - here.vy_m_s]) <= WITH_PLAN
            && (plan.w_rad_s - here.w_rad_s).abs() <= WITH_PLAN;
        // Who was off comes back where the floor carries the plan at its full rate in whatever direction.
        self.is_on_plan = goes_with && !is_hindered && (self.is_on_plan || self.rate_now >= self.full_rate());
    }

    /// A platform that is held back on a path that is kept has the path's time beside it: a place ahead would draw it across bends.
    fn fall_back(&mut self, wished: &Setpoint, setpoint: &Setpoint) {
        let [own, _] = self.own;
        let along = |x: f64, y: f64, turn: f64| x * own.vx_m_s + y * own.vy_m_s + turn * own.w_rad_s;
        let square = along(own.vx_m_s, own.vy_m_s, own.w_rad_s);
        let (place, here, twist) = (wished.odom_from_body, setpoint.odom_from_body, setpoint.twist_in_odom);
        let turn_rad = place.heading_rad - here.heading_rad;
        let late_s = along(place.x_m - here.x_m, place.y_m - here.y_m, turn_rad) / square;
        let rate = along(twist.vx_m_s, twist.vy_m_s, twist.w_rad_s) / square;
        if late_s.is_finite() && late_s > 0.0 {
            self.time_ns = (self.time_ns - late_s * 1e9).max(0.0);
            self.rate_now = rate.clamp(0.0, self.rate_now);
            self.rate.restart(Twist2::new(self.rate_now, 0.0, 0.0));
        }
    }

    /// Whether obstacles let the plan make no headway for too long.
    pub(crate) fn is_blocked(&self) -> bool {
        self.course != Course::Velocity && self.headway.is_blocked()
    }

    /// A place on the way, at the speed and acceleration that follow from the present rate.
    fn at_rate(&mut self, own: Setpoint) -> Setpoint {
        self.own = [own.twist_in_odom, own.acceleration_in_odom];
        let (rate, change) = (self.rate_now, self.rate_change_1_s);
        if rate == 1.0 && change == 0.0 {
            return own;
        }
        let (v, a) = (own.twist_in_odom, own.acceleration_in_odom.scaled(rate * rate));
        let bend = v.scaled(change);
        Setpoint {
            twist_in_odom: v.scaled(rate),
            acceleration_in_odom: Twist2::new(
                a.vx_m_s + bend.vx_m_s,
                a.vy_m_s + bend.vy_m_s,
                a.w_rad_s + bend.w_rad_s,
            ),
            ..own
        }
    }
}
