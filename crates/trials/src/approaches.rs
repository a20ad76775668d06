//! Approaches to fences and obstacles: seeded worlds in which a whole robot's cycle drives a kinematic body.
//!
//! The body is wheels that turn as they are told, one cycle late, and don't slip. Its true pose drifts away
//! from the believed one as far as the estimator says of itself that it may. So what is shown is what the cycle
//! itself guarantees; tyres and motors are the margin's business.
//!
//! Distances are measured here with geometry of its own, which shares nothing with the robot's.

mod drift;
mod measure;
mod wheel;
mod world;

use omnibase_platform::{Pose2, Twist2};
use omnibase_robot::config::AvoidanceKind;
use omnibase_robot::signals::{Frame, Phase, RequestAnswer, SafetyReason, StopCategory};
use omnibase_robot::{
    CycleRecord, CycleTime, Exchange, ImageBuffer, Registry, Request, RequestKind, Robot, RobotPlan,
};

pub use drift::Drift;
pub(crate) use drift::{Matrix, Vector, root, sigmas};
pub use measure::{distance_to_circle_m, room_in_fence_m};
pub use wheel::register_kinematic;
pub use world::{Random, Source, World};

/// Less than that isn't nearer, m.
const ROUNDING_M: f64 = 1e-9;
/// So many standard deviations the fence counts with.
const SIGMAS: f64 = 3.0;

/// What one approach came to.
#[derive(Clone, Copy, Debug)]
pub struct Approach {
    /// Least room of the believed footprint to the fence, m; infinite without one.
    pub fence_m: f64,
    /// Least room of the true footprint while the believed pose was off by three standard deviations at most, m.
    pub true_fence_m: f64,
    /// Cycles in which the true footprint was outside, and the believed pose off by more than that.
    pub beyond: u64,
    /// The greatest error of the believed pose, m.
    pub error_m: f64,
    /// The same in standard deviations.
    pub error_sigmas: f64,
    /// A motion was given up because obstacles blocked its way.
    pub given_up: bool,
    /// One was refused beforehand for that.
    pub refused: bool,
    /// Least distance to a standing obstacle that didn't come out of nowhere, m; infinite without one.
    pub standing_m: f64,
    /// Least distance to a moving one, m: it may drive into a robot that stands.
    pub moving_m: f64,
    /// Least distance to any obstacle in a cycle whose motion brought it nearer, m: with the same motion of the
    /// obstacle, a robot that stays would have been further away.
    pub own_m: f64,
    /// Least part of the distance that is to be kept, likewise.
    pub own_share: f64,
    /// The greatest way by which a cycle's motion brought an obstacle nearer that was touched already, m.
    pub own_step_m: f64,
    /// Greatest shares of the limits on speed, acceleration and jerk, straight and turning, that were used.
    pub shares: [f64; 6],
    /// Greatest speed, m/s.
    pub speed_m_s: f64,
    /// Cycles that were computed.
    pub cycles: u64,
    /// Cycles that fence or obstacles limited.
    pub limited: u64,
}

/// Runs the approach of a seed.
///
/// # Panics
/// Where the robot can't be built.
pub fn run(base: &RobotPlan, registry: &Registry, seed: u64, avoidance: AvoidanceKind) -> Approach {
    let mut world = World::new(base, seed);
    world.plan.guard.avoidance = avoidance;
    let mut robot = match Robot::build(&world.plan, registry) {
        Ok(robot) => robot,
        Err(error) => panic!("seed {seed}: {error}"),
    };
    let mut image = ImageBuffer::new(&world.plan);
    let mut result = Approach {
        fence_m: f64::INFINITY,
        true_fence_m: f64::INFINITY,
        beyond: 0,
        error_m: 0.0,
        error_sigmas: 0.0,
        given_up: false,
        refused: false,
        standing_m: f64::INFINITY,
        moving_m: f64::INFINITY,
        own_m: f64::INFINITY,
        own_share: f64::INFINITY,
        own_step_m: 0.0,
        shares: [0.0; 6],
        speed_m_s: 0.0,
        cycles: 0,
        limited: 0,
    };
    let mut drift = Drift::new(seed);
    let mut acceleration = Twist2::default();
    let mut setpoint_before = Pose2::default();
    for index in 0..world.cycles + 8 {
        let request = match index {
            1 => Some(RequestKind::Enable),
            0..8 => None,
            _ => world.request(index - 8, robot.record(), robot.phase()),
        };
        let time = CycleTime::on_grid(index, world.plan.bus.cycle_ns);
        let valid_until_ns = match request {
            Some(RequestKind::Velocity { .. }) => time.now_ns + 200_000_000,
            _ => u64::MAX,
        };
        let request = request.map(|kind| Request { kind, valid_until_ns });
        let record = *robot.compute(time, Exchange::Complete, request, &mut image);
        let pose = record.state.odom_from_body;
        let setpoint = record.setpoint.odom_from_body;
        if let Some(fence) = &world.plan.guard.fence {
            let room = |pose: &Pose2| room_in_fence_m(&world.plan.guard.footprint_m, pose, &fence.corners_m);
            result.fence_m = result.fence_m.min(room(&pose));
            let (truth, sigmas) = drift.truth(&record.state, room);
            let room_m = room(&truth);
            if sigmas <= SIGMAS {
                result.true_fence_m = result.true_fence_m.min(room_m);
            } else {
                result.beyond += u64::from(room_m < 0.0);
            }
            result.error_m = result.error_m.max(truth.distance_m(pose));
            result.error_sigmas = result.error_sigmas.max(sigmas);
        }
        result.given_up |= record.allowed.reason == SafetyReason::WayBlocked;
        result.refused |= record.answer == RequestAnswer::Blocked;
        take_shares(&mut result, &record, acceleration, &world.plan);
        acceleration = record.setpoint.acceleration_in_odom;
        result.cycles += 1;
        result.limited += u64::from(record.guard.limited_by.code() != 0);
        for (number, obstacle) in robot.obstacles().iter().enumerate() {
            let Some(obstacle) = obstacle.filter(|_| !world.is_sudden[number]) else { continue };
            let footprint = &world.plan.guard.footprint_m;
            let distance =
                |pose: &Pose2| distance_to_circle_m(footprint, pose, obstacle.centre_m, obstacle.radius_m);
            let distance_m = distance(&pose);
            let stands = obstacle.velocity_m_s.iter().all(|speed| *speed == 0.0);
            let least_m = if stands { &mut result.standing_m } else { &mut result.moving_m };
            *least_m = least_m.min(distance_m);
            // The body follows the setpoint a cycle later, while the obstacle drives on.
            let nearer_m = distance(&setpoint_before) - distance(&setpoint);
            if nearer_m > ROUNDING_M {
                if distance_m < 0.0 {
                    result.own_step_m = result.own_step_m.max(nearer_m);
                }
                result.own_m = result.own_m.min(distance_m);
                result.own_share = result.own_share.min(distance_m / world.plan.guard.distance_m);
            }
        }
        setpoint_before = setpoint;
    }
    result
}

fn take_shares(result: &mut Approach, record: &CycleRecord, before: Twist2, plan: &RobotPlan) {
    let limits = &plan.limits;
    let period_s = record.time.period_s();
    let (twist, now) = (record.setpoint.twist_in_odom, record.setpoint.acceleration_in_odom);
    result.speed_m_s = result.speed_m_s.max(twist.speed_m_s());
    // A drive that is being enabled begins at rest.
    let is_driven = matches!(record.phase, Phase::Holding | Phase::Tracking | Phase::Stopping);
    if !is_driven {
        return;
    }
    let jerk =
        Twist2::new(now.vx_m_s - before.vx_m_s, now.vy_m_s - before.vy_m_s, now.w_rad_s - before.w_rad_s)
            .scaled(1.0 / period_s);
    let shares = [
        twist.speed_m_s() / limits.speed_m_s,
        now.speed_m_s() / limits.acceleration_m_s2,
        jerk.speed_m_s() / limits.jerk_m_s3,
        twist.w_rad_s.abs() / limits.turn_speed_rad_s,
        now.w_rad_s.abs() / limits.turn_acceleration_rad_s2,
        jerk.w_rad_s.abs() / limits.turn_jerk_rad_s3,
    ];
    for (greatest, share) in result.shares.iter_mut().zip(shares) {
        *greatest = greatest.max(share);
    }
}

impl World {
    /// What is asked in a cycle, counted from where the robot holds.
    fn request(&mut self, index: u64, last: &CycleRecord, phase: Phase) -> Option<RequestKind> {
        if let Some((at, number, obstacle)) = self.sudden
            && index == at
        {
            return Some(RequestKind::SetObstacle { index: number, obstacle });
        }
        if Some(index) == self.stop_at {
            return Some(RequestKind::Stop(StopCategory::RampAndHold));
        }
        let is_stopped = self.stop_at.is_some_and(|stop| (stop..stop + 150).contains(&index));
        if is_stopped {
            return None;
        }
        match &self.source {
            Source::Stick { frame, wishes, every } => {
                let wish = wishes[(index / every) as usize % wishes.len()];
                // A stick repeats itself.
                let is_due = index.is_multiple_of(8) && matches!(phase, Phase::Holding | Phase::Tracking);
                is_due.then_some(RequestKind::Velocity { twist: wish, frame: *frame })
            }
            Source::Plan if phase == Phase::Holding => {
                let may_try = self.tries > 0 && last.answer != RequestAnswer::TooFar;
                self.tries = self.tries.saturating_sub(1);
                let goes_on = last.reference_begun != 0;
                may_try.then_some(if goes_on { RequestKind::Resume } else { RequestKind::Track })
            }
            Source::Way(pose) if phase == Phase::Holding => {
                let may_try = self.tries > 0;
                self.tries = self.tries.saturating_sub(1);
                may_try.then_some(RequestKind::GoTo { odom_from_body: *pose })
            }
            Source::Plan | Source::Way(_) => None,
        }
    }
}

/// The frames of sticks.
pub const FRAMES: [Frame; 2] = [Frame::Body, Frame::Odom];
