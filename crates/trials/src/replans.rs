//! Motions that are replaced while they are under way, at random: ways, paths, sticks, pauses, overrides, stops, lost exchanges.
//!
//! Worlds and body are those of [`approaches`](crate::approaches): a whole robot's cycle, seeded limits, fences and obstacles, wheels that
//! turn as they are told. Of each cycle speed, acceleration and jerk of what the platform is led to are counted by their limits. That a stop
//! was left is shown by driving it: every stop that is asked for, and each that the robot makes by itself, ends inside the fence.

use std::time::{Duration, Instant};

use omnibase_platform::{Pose2, Twist2};
use omnibase_robot::config::{AvoidanceKind, PathFrame, ReferenceTable, Timing};
use omnibase_robot::guard::Obstacle;
use omnibase_robot::signals::{Batch, Course, Phase, RequestAnswer, SafetyReason, StopCategory};
use omnibase_robot::stages::Reference;
use omnibase_robot::{
    Ability, CycleRecord, CycleTime, Exchange, ImageBuffer, Registry, Request, RequestKind, Robot, RobotPlan,
};

use crate::approaches::{FRAMES, Random, World, room_in_fence_m};

/// What a share of a limit may be more than 1 by rounding.
pub const ROUNDING: f64 = 1e-6;
/// A place that is nearer than this to another is the same one, m and rad.
const HELD: f64 = 1e-4;
/// Cycles after a stop in which nobody asks for anything.
const REST: u64 = 20;
/// Paths that are loaded by turns.
const PATHS: usize = 3;

/// What is asked, as it is counted.
pub const SORTS: [&str; 11] = [
    "go_to",
    "load and track",
    "track",
    "resume",
    "pause",
    "stick",
    "speed",
    "obstacle",
    "stop",
    "no number",
    "lost cycles",
];

/// What came of random requests.
#[derive(Clone, Debug, Default)]
pub struct Replans {
    /// Of each sort: asked, taken, and taken while the platform moved.
    pub counts: [[u64; 3]; SORTS.len()],
    /// Ways and paths that were refused while the platform moved, by the answer.
    pub refused: Vec<(RequestAnswer, u64)>,
    /// Cycles that were computed.
    pub cycles: u64,
    /// Greatest shares of speed, acceleration and jerk, straight and turning.
    pub shares: [f64; 6],
    /// Cycles in which one of them was beyond its limit.
    pub beyond: u64,
    /// Cycles whose place isn't where speed leads from the place before.
    pub steps: u64,
    /// Least room of the footprint to the fence, m; infinite without one.
    pub fence_m: f64,
    /// Cycles in which it was below 0: no stop was left.
    pub outside: u64,
    /// Stops that were driven to their end.
    pub stops: u64,
    /// Cycles further than 0.1 mm or mrad from where it held after a stop, before a person asked for a motion.
    pub moved: u64,
    /// Paths that were joined while moving, and reached.
    pub joined: u64,
    /// Times at which the robot stopped by itself, by the reason.
    pub by_itself: Vec<(SafetyReason, u64)>,
    /// The longest cycle with a request that was taken while moving, and the longest without a request.
    pub longest: [Duration; 2],
}

impl Replans {
    /// All of them.
    pub fn asked(&self) -> u64 {
        self.counts.iter().map(|[asked, ..]| asked).sum()
    }

    /// Adds others.
    pub fn add(&mut self, other: &Replans) {
        for (all, more) in self.counts.iter_mut().flatten().zip(other.counts.iter().flatten()) {
            *all += more;
        }
        for (all, more) in self.shares.iter_mut().zip(other.shares) {
            *all = all.max(more);
        }
        for (all, more) in self.longest.iter_mut().zip(other.longest) {
            *all = (*all).max(more);
        }
        self.cycles += other.cycles;
        self.beyond += other.beyond;
        self.steps += other.steps;
        self.outside += other.outside;
        self.stops += other.stops;
        self.moved += other.moved;
        self.joined += other.joined;
        self.fence_m = self.fence_m.min(other.fence_m);
        for (reason, times) in &other.by_itself {
            count(&mut self.by_itself, *reason, *times);
        }
        for (answer, times) in &other.refused {
            count(&mut self.refused, *answer, *times);
        }
    }
}

fn count<T: PartialEq>(all: &mut Vec<(T, u64)>, what: T, times: u64) {
    match all.iter_mut().find(|(known, _)| *known == what) {
        Some((_, known)) => *known += times,
        None => all.push((what, times)),
    }
}

/// A robot of whom something else is asked again and again.
struct Session {
    plan: RobotPlan,
    robot: Robot,
    image: ImageBuffer,
    index: u64,
    before: CycleRecord,
    /// A stop was asked for or made, and no person asked for anything since.
    is_stopped: bool,
    /// Where it holds since then.
    held_at: Option<Pose2>,
    /// What is held of a stick.
    stick: Option<RequestKind>,
    paths: Vec<Box<dyn Reference>>,
    number: u32,
    exchange: Exchange,
    result: Replans,
}

/// Asks so much of the robot of a seed.
///
/// # Panics
/// Where the robot can't be built.
pub fn run(base: &RobotPlan, registry: &Registry, seed: u64, events: u64) -> Replans {
    let mut world = World::new(base, seed);
    world.plan.guard.avoidance = AvoidanceKind::Guarded;
    world.plan.guard.give_up_s = 2.0;
    let robot = match Robot::build(&world.plan, registry) {
        Ok(robot) => robot,
        Err(error) => panic!("seed {seed}: {error}"),
    };
    let mut random = Random::new(seed ^ 0x5EED_0000_0000);
    let plan = world.plan;
    let mut session = Session {
        image: ImageBuffer::new(&plan),
        before: *robot.record(),
        robot,
        index: 0,
        is_stopped: true,
        held_at: None,
        stick: None,
        paths: (0..PATHS).filter_map(|_| path(&mut random, &plan, registry)).collect(),
        number: 0,
        exchange: Exchange::Complete,
        result: Replans { fence_m: f64::INFINITY, ..Default::default() },
        plan,
    };
    session.rest(2);
    session.enable();
    for _ in 0..events {
        session.event(&mut random);
        let cycles = random.spread(1.0, 200.0) as u64;
        for _ in 0..cycles {
            let kind = session.stick.filter(|_| session.index.is_multiple_of(8));
            session.cycle(kind);
        }
    }
    session.stop();
    session.result
}

/// A path from where it begins, as fast as it may be.
fn path(random: &mut Random, plan: &RobotPlan, registry: &Registry) -> Option<Box<dyn Reference>> {
    let mut place = [0.0; 3];
    let size_m = random.spread(0.1, 2.0);
    let points = (0..4).map(|number| {
        let point = [f64::from(number), place[0], place[1], place[2]];
        place[0] += random.between(-1.0, 1.0) * size_m;
        place[1] += random.between(-1.0, 1.0) * size_m;
        place[2] += random.between(-0.5, 0.5);
        point
    });
    let table = ReferenceTable {
        timing: Some(Timing::Fastest),
        frame: Some(PathFrame::Start),
        ..ReferenceTable::path(points.collect())
    };
    registry.make_reference(&table, &Ability::of(plan)).ok()
}

fn moves(record: &CycleRecord) -> bool {
    let twist = &record.setpoint.twist_in_odom;
    twist.speed_m_s() > 1e-3 || twist.w_rad_s.abs() > 1e-3
}

impl Session {
    fn rest(&mut self, cycles: u64) {
        for _ in 0..cycles {
            self.cycle(None);
        }
    }

    /// A person brings it to where it holds.
    fn enable(&mut self) {
        for _ in 0..200 {
            let kind = match self.robot.phase() {
                Phase::Holding => return,
                Phase::Disabled => Some(RequestKind::Enable),
                Phase::Fault => Some(RequestKind::Acknowledge),
                _ => None,
            };
            self.cycle(kind);
        }
    }

    /// Stops, and sees that it stays so.
    fn stop(&mut self) {
        self.stick = None;
        self.cycle(Some(RequestKind::Stop(StopCategory::RampAndHold)));
        for _ in 0..20_000 {
            if !matches!(self.robot.phase(), Phase::Tracking | Phase::Stopping | Phase::QuickStopping) {
                break;
            }
            self.cycle(None);
        }
        self.result.stops += 1;
        self.rest(REST);
    }

    fn event(&mut self, random: &mut Random) {
        if matches!(self.robot.phase(), Phase::Disabled | Phase::Fault) {
            self.rest(REST);
            self.enable();
        }
        let sort = match random.below(20) {
            0..=5 => 0,
            6..=8 => 1,
            9 => 2,
            10 => 3,
            11 => 4,
            12..=14 => 5,
            15 => 6,
            16 => 7,
            17 => 8,
            18 => 9,
            _ => 10,
        };
        let was_moving = moves(&self.before);
        let answer = self.ask(sort, random);
        let [asked, taken, moving] = &mut self.result.counts[sort];
        *asked += 1;
        let is_taken = answer == RequestAnswer::Taken;
        *taken += u64::from(is_taken);
        *moving += u64::from(is_taken && was_moving);
        if sort <= 1 && was_moving && !is_taken {
            count(&mut self.result.refused, answer, 1);
        }
    }

    fn ask(&mut self, sort: usize, random: &mut Random) -> RequestAnswer {
        let here = self.before.setpoint.odom_from_body;
        let speed_m_s = self.plan.limits.speed_m_s;
        let far_m = random.spread(0.01, 2.0);
        let mut near = |pose: Pose2| {
            Pose2::new(
                pose.x_m + random.between(-far_m, far_m),
                pose.y_m + random.between(-far_m, far_m),
                pose.heading_rad + random.between(-1.0, 1.0),
            )
        };
        match sort {
            0 => self.lead(RequestKind::GoTo { odom_from_body: near(here) }),
            1 => {
                let Some(path) = self.paths.pop() else { return RequestAnswer::None };
                self.number += 1;
                let number = self.number;
                if let Some((_, path)) = self.robot.offer_reference(number, path) {
                    self.paths.insert(0, path);
                }
                self.cycle(Some(RequestKind::UseReference { number }));
                self.lead(RequestKind::Track)
            }
            2 => self.lead(RequestKind::Track),
            3 => self.lead(RequestKind::Resume),
            4 => self.cycle(Some(RequestKind::Pause)).answer,
            5 => {
                let place = near(Pose2::default());
                let twist = Twist2::new(place.x_m, place.y_m, place.heading_rad);
                let size = twist.speed_m_s().max(1e-9) / (random.between(0.0, 0.99) * speed_m_s);
                let turn = self.plan.limits.turn_speed_rad_s * twist.w_rad_s.clamp(-0.99, 0.99);
                let twist = Twist2::new(twist.vx_m_s / size, twist.vy_m_s / size, turn);
                let kind = RequestKind::Velocity { twist, frame: FRAMES[random.below(2) as usize] };
                self.stick = Some(kind);
                self.is_stopped = false;
                self.cycle(self.stick).answer
            }
            6 => {
                let value = random.between(0.1, 1.0);
                self.cycle(Some(RequestKind::Set { index: 0, value, batch: Batch::ALONE })).answer
            }
            7 => {
                let Pose2 { x_m, y_m, .. } = near(here);
                let index = random.below(4) as u32;
                let obstacle = Obstacle {
                    centre_m: [x_m, y_m],
                    radius_m: random.spread(0.02, 0.4),
                    velocity_m_s: [0.0; 2],
                };
                let kind = match random.below(3) {
                    0 => RequestKind::SetObstacle { index, obstacle },
                    _ => RequestKind::RemoveObstacle { index },
                };
                self.cycle(Some(kind)).answer
            }
            8 => {
                self.stop();
                RequestAnswer::Taken
            }
            9 => {
                let odom_from_body = Pose2 { x_m: f64::NAN, ..here };
                self.cycle(Some(RequestKind::GoTo { odom_from_body })).answer
            }
            _ => {
                // One is tolerated; of many in a row the robot stops.
                self.exchange = Exchange::Lost;
                self.rest(1 + random.below(12));
                self.exchange = Exchange::Complete;
                RequestAnswer::Taken
            }
        }
    }

    /// Somebody leads it elsewhere; who held a stick let it go.
    fn lead(&mut self, kind: RequestKind) -> RequestAnswer {
        let answer = self.cycle(Some(kind)).answer;
        if answer == RequestAnswer::Taken {
            self.stick = None;
        }
        answer
    }

    fn cycle(&mut self, kind: Option<RequestKind>) -> CycleRecord {
        let time = CycleTime::on_grid(self.index, self.plan.bus.cycle_ns);
        self.index += 1;
        let valid_until_ns = match kind {
            Some(RequestKind::Velocity { .. }) => time.now_ns + 200_000_000,
            _ => u64::MAX,
        };
        let request = kind.map(|kind| Request { kind, valid_until_ns });
        let begun = Instant::now();
        let record = *self.robot.compute(time, self.exchange, request, &mut self.image);
        let took = begun.elapsed();
        let is_taken = record.answer == RequestAnswer::Taken;
        let longest = &mut self.result.longest;
        match kind {
            Some(RequestKind::GoTo { .. } | RequestKind::Track | RequestKind::Resume)
                if is_taken && moves(&self.before) =>
            {
                longest[0] = longest[0].max(took);
            }
            None => longest[1] = longest[1].max(took),
            _ => {}
        }
        let asks_for_motion = matches!(
            kind,
            Some(
                RequestKind::GoTo { .. }
                    | RequestKind::Track
                    | RequestKind::Resume
                    | RequestKind::Velocity { .. }
            )
        );
        self.look(&record, is_taken && asks_for_motion);
        self.before = record;
        record
    }

    fn look(&mut self, record: &CycleRecord, is_asked_for: bool) {
        let (before, plan, result) = (&self.before, &self.plan, &mut self.result);
        result.cycles += 1;
        let (was, is) = (&before.setpoint, &record.setpoint);
        let is_led = |phase| matches!(phase, Phase::Holding | Phase::Tracking | Phase::Stopping);
        let period_s = record.time.period_s();
        let limits = &plan.limits;
        if is_led(record.phase) && is_led(before.phase) {
            let change = |from: Twist2, to: Twist2| {
                let by = 1.0 / period_s;
                Twist2::new(to.vx_m_s - from.vx_m_s, to.vy_m_s - from.vy_m_s, to.w_rad_s - from.w_rad_s)
                    .scaled(by)
            };
            let acceleration = change(was.twist_in_odom, is.twist_in_odom);
            let jerk = change(was.acceleration_in_odom, is.acceleration_in_odom);
            let shares = [
                is.twist_in_odom.speed_m_s() / limits.speed_m_s,
                acceleration.speed_m_s() / limits.acceleration_m_s2,
                jerk.speed_m_s() / limits.jerk_m_s3,
                is.twist_in_odom.w_rad_s.abs() / limits.turn_speed_rad_s,
                acceleration.w_rad_s.abs() / limits.turn_acceleration_rad_s2,
                jerk.w_rad_s.abs() / limits.turn_jerk_rad_s3,
            ];
            result.beyond += u64::from(shares.iter().any(|share| *share > 1.0 + ROUNDING));
            for (greatest, share) in result.shares.iter_mut().zip(shares) {
                *greatest = greatest.max(share);
            }
            let led_m = |from: f64, to: f64, v: f64, w: f64| (to - from - 0.5 * period_s * (v + w)).abs();
            let (p, q, v, w) =
                (&was.odom_from_body, &is.odom_from_body, &was.twist_in_odom, &is.twist_in_odom);
            let off = led_m(p.x_m, q.x_m, v.vx_m_s, w.vx_m_s)
                .max(led_m(p.y_m, q.y_m, v.vy_m_s, w.vy_m_s))
                .max(led_m(p.heading_rad, q.heading_rad, v.w_rad_s, w.w_rad_s));
            // What isn't a number is no place.
            result.steps += u64::from(off > 1e-9 || off.is_nan());
        }
        if let Some(fence) = &plan.guard.fence {
            let room_m = room_in_fence_m(&plan.guard.footprint_m, &is.odom_from_body, &fence.corners_m);
            result.fence_m = result.fence_m.min(room_m);
            result.outside += u64::from(room_m < 0.0 || room_m.is_nan());
        }
        result.joined += u64::from(
            before.course == Course::Onto
                && record.course == Course::Reference
                && record.phase == Phase::Tracking
                && moves(record),
        );
        if is_asked_for {
            self.is_stopped = false;
        }
        let holds = self.is_stopped && record.phase == Phase::Holding;
        self.held_at = holds.then(|| self.held_at.unwrap_or(is.odom_from_body));
        result.moved += u64::from(self.held_at.is_some_and(|place| {
            is.odom_from_body.distance_m(place) > HELD
                || (is.odom_from_body.heading_rad - place.heading_rad).abs() > HELD
        }));
        let now = self.robot.phase();
        if record.phase == Phase::Tracking && now != Phase::Tracking {
            // It ended; by itself, or because it was asked for.
            self.is_stopped = true;
            self.stick = None;
            if !matches!(record.stop_reason, SafetyReason::None | SafetyReason::Requested) {
                count(&mut result.by_itself, record.stop_reason, 1);
            }
        }
    }
}
