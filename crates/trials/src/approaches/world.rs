//! Worlds of seeds: limits, footprints, fences, obstacles and what is asked of the robot.

use std::f64::consts::{PI, TAU};

use omnibase_platform::{Pose2, Twist2};
use omnibase_robot::config::{
    FencePlan, FootprintSource, InterpolationName, PathFrame, ReferenceTable, Timing,
};
use omnibase_robot::guard::Obstacle;
use omnibase_robot::registry::Kind;
use omnibase_robot::signals::Frame;
use omnibase_robot::{Registry, RobotPlan};

use super::measure::{distance_to_circle_m, room_in_fence_m};
use super::{FRAMES, SIGMAS};

type Point = [f64; 2];

/// Numbers that look random, the same for the same seed (SplitMix64: Steele, Lea and Flood, OOPSLA 2014).
#[derive(Clone, Copy, Debug)]
pub struct Random(u64);

impl Random {
    /// The numbers of a seed.
    pub fn new(seed: u64) -> Self {
        Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x5DEE_CE66)
    }

    fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Between two bounds.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.word() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Between two bounds, each order of magnitude as often.
    pub fn spread(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    /// With mean 0 and deviation 1 (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        let [size, turn] = [self.between(f64::MIN_POSITIVE, 1.0), self.between(0.0, TAU)];
        (-2.0 * size.ln()).sqrt() * turn.cos()
    }

    /// Below a number.
    pub fn below(&mut self, count: u64) -> u64 {
        self.word() % count
    }

    fn direction(&mut self, size: f64) -> Point {
        let angle = self.between(-PI, PI);
        [size * angle.cos(), size * angle.sin()]
    }
}

/// Cycles of an approach at most.
const MOST_CYCLES: u64 = 250;

/// Who leads the robot.
#[derive(Clone, Debug)]
pub enum Source {
    /// A stick: wishes that change every so many cycles.
    Stick {
        /// Their frame.
        frame: Frame,
        /// The wishes, in turn.
        wishes: Vec<Twist2>,
        /// Cycles of each.
        every: u64,
    },
    /// The reference of the plan.
    Plan,
    /// The straight way to a pose.
    Way(Pose2),
}

/// The world of a seed.
#[derive(Clone, Debug)]
pub struct World {
    /// The robot with its fence and obstacles.
    pub plan: RobotPlan,
    /// Who leads it.
    pub source: Source,
    /// Cycles of the approach.
    pub cycles: u64,
    /// A stop is asked for in this cycle; later the motion is gone on with.
    pub stop_at: Option<u64>,
    /// An obstacle that appears or jumps in a cycle, without announcement.
    pub sudden: Option<(u64, u32, Obstacle)>,
    /// Obstacles that nothing is promised about, for they come out of nowhere.
    pub is_sudden: [bool; 16],
    pub(super) tries: u32,
}

impl World {
    /// The world of a seed, around a robot.
    pub fn new(base: &RobotPlan, seed: u64) -> World {
        let mut random = Random::new(seed);
        let r = &mut random;
        let mut plan = base.clone();
        let limits = &mut plan.limits;
        limits.speed_m_s = r.spread(0.1, 1.5);
        limits.acceleration_m_s2 = r.spread(0.3, 4.0);
        limits.jerk_m_s3 = r.spread(2.0, 80.0);
        limits.turn_speed_rad_s = r.spread(0.2, 3.0);
        limits.turn_acceleration_rad_s2 = r.spread(0.5, 8.0);
        limits.turn_jerk_rad_s3 = r.spread(4.0, 120.0);
        limits.wheel_speed_rad_s = 1e3;
        if r.below(2) == 0 {
            plan.guard.footprint_m = footprint(r);
            plan.guard.footprint_source = FootprintSource::Given;
        }
        plan.guard.distance_m = r.between(0.02, 0.15);
        let limits = plan.limits;
        // A standing robot's stopping distance says at which distance an approach is one.
        let stop_m = limits.speed_m_s * limits.speed_m_s / (2.0 * limits.acceleration_m_s2)
            + limits.speed_m_s * limits.acceleration_m_s2 / (2.0 * limits.jerk_m_s3);
        let size_m = 0.3 + 1.5 * stop_m;
        odometry(seed, &mut plan);
        if r.below(4) > 0 {
            plan.guard.fence = fence(r, &plan, size_m);
        }
        let count = if plan.guard.fence.is_some() { r.below(4) } else { 1 + r.below(4) };
        for _ in 0..count {
            plan.guard.obstacles.extend(obstacle(r, &plan, size_m));
        }
        let seconds = 1.5
            * (limits.speed_m_s / limits.acceleration_m_s2 + limits.acceleration_m_s2 / limits.jerk_m_s3)
            + size_m / limits.speed_m_s;
        // Short approaches at 1 ms, long ones at longer cycles: the reaction of one cycle counts there.
        let period_ms = (1000.0 * seconds / MOST_CYCLES as f64).ceil().clamp(1.0, 8.0);
        plan.bus.cycle_ns = period_ms as u64 * 1_000_000;
        let cycles = ((seconds * 1e9) as u64 / plan.bus.cycle_ns).clamp(100, MOST_CYCLES);
        let source = source(r, &mut plan, size_m, cycles);
        let stop_at = (r.below(6) == 0).then(|| r.below(cycles));
        let mut is_sudden = [false; 16];
        let sudden = (r.below(10) == 0).then(|| {
            // A new one, or one that is there already jumps; sometimes onto the robot itself.
            let number = r.below(plan.guard.obstacles.len() as u64 + 1) as u32;
            is_sudden[number as usize] = true;
            let direction = r.between(0.0, size_m);
            let centre_m = r.direction(direction);
            let obstacle = Obstacle { centre_m, radius_m: r.spread(0.02, 0.5), velocity_m_s: [0.0; 2] };
            (r.below(cycles), number, obstacle)
        });
        World { plan, source, cycles, stop_at, sudden, is_sudden, tries: 20 }
    }
}

/// How well odometry knows where it is, from better than usual to hardly at all; and how soon it is known that a way is
/// blocked, for an approach is short. Drawn apart, so that the rest of a seed's world stays what it was.
fn odometry(seed: u64, plan: &mut RobotPlan) {
    let mut random = Random::new(seed ^ 0x0D0E_7000_0000_0000);
    let r = &mut random;
    plan.estimator.start_sigma_m = Some(r.spread(1e-4, 0.05));
    plan.estimator.start_sigma_rad = Some(r.spread(1e-4, 0.05));
    plan.estimator.way_sigma_m = Some(r.spread(3e-4, 0.03));
    plan.estimator.way_sigma_rad = Some(r.spread(3e-4, 0.03));
    plan.estimator.turn_sigma_rad = Some(r.spread(3e-4, 0.03));
    plan.estimator.radius_share = Some(r.spread(3e-4, 0.02));
    plan.guard.give_up_s = r.spread(0.03, 1.0);
}

/// A convex footprint of three to eight corners around the origin.
fn footprint(r: &mut Random) -> Vec<Point> {
    let count = 3 + r.below(6);
    let (long, wide) = (r.between(0.15, 0.6), r.between(0.15, 0.6));
    let first = r.between(0.0, TAU);
    let corner = |number: u64| {
        let angle = first + TAU * number as f64 / count as f64;
        [long * angle.cos(), wide * angle.sin()]
    };
    (0..count).map(corner).collect()
}

/// A rectangle, an L or a T-like polygon at any angle, in which the robot has room at its start; not always found.
fn fence(r: &mut Random, plan: &RobotPlan, size_m: f64) -> Option<FencePlan> {
    let margin_m = r.between(0.01, 0.08);
    let footprint = &plan.guard.footprint_m;
    let reach_m = footprint.iter().map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max);
    let [start_m, start_rad] =
        [plan.estimator.start_sigma_m, plan.estimator.start_sigma_rad].map(Option::unwrap_or_default);
    let needed_m = margin_m + SIGMAS * (start_m + reach_m * start_rad);
    for _ in 0..20 {
        let (w, h) = (r.between(0.5, 1.0) + size_m, r.between(0.5, 1.0) + size_m);
        let (a, b) = (r.between(0.2, 0.8) * w, r.between(0.2, 0.8) * h);
        let shape: Vec<Point> = match r.below(4) {
            0 | 1 => vec![[-w, -h], [w, -h], [w, h], [-w, h]],
            2 => vec![[-w, -h], [w, -h], [w, b - h], [a - w, b - h], [a - w, h], [-w, h]],
            // A wedge points into the room.
            _ => vec![[-w, -h], [w, -h], [w, h], [a - w, b - h * 0.5], [-w, h]],
        };
        let angle = r.between(-PI, PI);
        let shift = [r.between(-0.8, 0.8) * w, r.between(-0.8, 0.8) * h];
        let (sin, cos) = angle.sin_cos();
        let put = |&[x, y]: &Point| {
            let (x, y) = (x - shift[0], y - shift[1]);
            [cos * x - sin * y, sin * x + cos * y]
        };
        let mut corners_m: Vec<Point> = shape.iter().map(put).collect();
        if r.below(2) == 0 {
            corners_m.reverse();
        }
        if room_in_fence_m(footprint, &Pose2::default(), &corners_m) >= needed_m {
            return Some(FencePlan { corners_m, margin_m, sigmas: SIGMAS });
        }
    }
    None
}

/// An obstacle near the robot, standing or moving, that doesn't begin too near.
fn obstacle(r: &mut Random, plan: &RobotPlan, size_m: f64) -> Option<Obstacle> {
    for _ in 0..20 {
        let reach_m = r.between(0.1, size_m + 0.8);
        let centre_m = r.direction(reach_m);
        let radius_m = r.spread(0.02, 0.6);
        let speed_m_s = if r.below(2) == 0 { 0.0 } else { r.between(0.0, 0.9) * plan.limits.speed_m_s };
        let velocity_m_s = r.direction(speed_m_s);
        let start = Pose2::default();
        let distance_m = distance_to_circle_m(&plan.guard.footprint_m, &start, centre_m, radius_m);
        if distance_m > plan.guard.distance_m {
            return Some(Obstacle { centre_m, radius_m, velocity_m_s });
        }
    }
    None
}

/// The references that need nothing but a radius.
fn round() -> Vec<&'static str> {
    let registry = Registry::with_built_in();
    let needs = |kind: &Kind| {
        let needed = kind.keys.iter().filter(|key| key.is_needed);
        needed.map(|key| key.name).eq(["radius_m"])
    };
    registry.references.kinds().filter(|kind| needs(kind)).map(|kind| kind.name).collect()
}

fn source(r: &mut Random, plan: &mut RobotPlan, size_m: f64, cycles: u64) -> Source {
    let limits = plan.limits;
    match r.below(6) {
        0..=2 => {
            let count = 1 + r.below(3);
            let wish = |r: &mut Random| {
                let speed_m_s =
                    [limits.speed_m_s, r.between(0.0, 1.0) * limits.speed_m_s][r.below(2) as usize];
                let [x, y] = r.direction(speed_m_s);
                let turn = limits.turn_speed_rad_s;
                let w_rad_s = if r.below(2) == 0 { 0.0 } else { r.between(-turn, turn) };
                // A resting stick, or a turn alone.
                if r.below(8) == 0 { Twist2::new(0.0, 0.0, w_rad_s) } else { Twist2::new(x, y, w_rad_s) }
            };
            let wishes = (0..count).map(|_| wish(r)).collect();
            Source::Stick { frame: FRAMES[r.below(2) as usize], wishes, every: 1 + cycles / count }
        }
        3 => {
            let [x, y] = r.direction(size_m + 0.5);
            let far = Pose2::new(x, y, r.between(-2.0 * PI, 2.0 * PI));
            Source::Way(Pose2 { heading_rad: far.heading_rad * r.below(2) as f64, ..far })
        }
        kind => {
            let table = &mut plan.reference;
            let is_fastest = r.below(2) == 0;
            if kind == 4 {
                let mut points = vec![[0.0; 4]];
                let mut place = [0.0, 0.0, 0.0];
                for _ in 0..2 {
                    let reach_m = r.between(0.2, 1.0) * (size_m + 0.5);
                    let [x, y] = r.direction(reach_m);
                    let turn = r.between(-1.0, 1.0) * r.below(2) as f64;
                    place = [place[0] + x, place[1] + y, place[2] + turn];
                    // Quintic from rest to rest: the limits' times, and some more.
                    let time_s = 1.1
                        * (1.875 * reach_m / limits.speed_m_s)
                            .max((5.78 * reach_m / limits.acceleration_m_s2).sqrt())
                            .max((60.0 * reach_m / limits.jerk_m_s3).cbrt())
                            .max(1.875 * turn.abs() / limits.turn_speed_rad_s)
                            .max((5.78 * turn.abs() / limits.turn_acceleration_rad_s2).sqrt())
                            .max((60.0 * turn.abs() / limits.turn_jerk_rad_s3).cbrt());
                    let before_s = points.last().map_or(0.0, |point: &[f64; 4]| point[0]);
                    points.push([before_s + time_s, place[0], place[1], place[2]]);
                }
                *table = ReferenceTable {
                    frame: Some(PathFrame::Odom),
                    interpolation: (!is_fastest).then_some(InterpolationName::Quintic),
                    ..ReferenceTable::path(points)
                };
            } else {
                let round = round();
                *table = ReferenceTable {
                    kind: Some(round[r.below(round.len() as u64) as usize].into()),
                    radius_m: Some(r.between(0.2, 0.5) * (size_m + 0.5)),
                    frame: Some(PathFrame::Start),
                    ..Default::default()
                };
            }
            table.timing = is_fastest.then_some(Timing::Fastest);
            Source::Plan
        }
    }
}
