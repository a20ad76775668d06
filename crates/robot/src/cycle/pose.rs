//! Where the platform stands: what wheels rolled unread, and a person who says it.

use omnibase_platform::{Pose2, Twist2, wrap_angle_rad};

use super::Robot;
use crate::signals::{
    CycleTime, DriveMeasurement, Exchange, Frame, MAX_WHEELS, Phase, PlatformState, RequestAnswer,
    RequestKind, Setpoint,
};
use crate::stages::Device;
use crate::unread::Unread;

/// A platform whose place nobody knows is led by a person who sees it, at reduced speed: 250 mm/s as ISO 10218-1 has it
/// for that, and as much in rad/s.
const UNKNOWN_M_S: f64 = 0.25;
const UNKNOWN_RAD_S: f64 = 0.25;
/// Standard deviations beyond these say nothing, m and rad.
const GREATEST_SIGMA_M: f64 = 10.0;
const GREATEST_SIGMA_RAD: f64 = std::f64::consts::PI;

/// What is known of the way that wheels went.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counted {
    /// What wheels turned that odometry doesn't know of yet, rad.
    unused_rad: [f64; MAX_WHEELS],
    /// How far they may have rolled that nobody counted, and odometry doesn't know of yet, rad.
    unread_rad: [f64; MAX_WHEELS],
    unread: Unread,
    /// Drives that started anew and weren't read since: bit n for wheel n.
    restarted: u16,
    /// Drives that said last of their count what is no number.
    uncounted: u16,
    /// Some wheel rolled unread, and nobody said since where the platform stands.
    pub(super) pose_lost: bool,
}

impl Counted {
    /// Drives started anew.
    pub(super) fn restart(&mut self, wheels: u16) {
        self.restarted |= wheels;
    }

    /// What a wheel turned since odometry knew of it, rad, and 0 while that has to wait for the others.
    pub(super) fn count(
        &mut self,
        wheel: usize,
        device: &mut dyn Device,
        time: &CycleTime,
        exchange: Exchange,
        inputs: &[u8],
    ) -> DriveMeasurement {
        let bit = 1 << wheel;
        let has_restarted = self.restarted & bit != 0;
        self.restarted &= !bit;
        if has_restarted && device.count_range_rad().is_none() {
            device.restarted();
        }
        let mut drive = device.read(time, inputs);
        if has_restarted {
            let bound_rad = self.unread.bound_rad(wheel, time);
            let range_rad = device.count_range_rad().unwrap_or(0.0);
            // An absolute encoder that says what can't be lost its count, or is another one.
            if !(bound_rad < range_rad && drive.increment_rad.abs() <= bound_rad) {
                drive.increment_rad = 0.0;
                self.unread_rad[wheel] += bound_rad;
                self.pose_lost = true;
            }
        }
        if !drive.increment_rad.is_finite() {
            self.uncounted |= bit;
            self.pose_lost = true;
        } else if self.uncounted & bit != 0 {
            self.uncounted &= !bit;
            self.unread_rad[wheel] += self.unread.bound_rad(wheel, time);
        }
        // Odometry needs all wheels: what some turned while others were away counts when those are back.
        self.unused_rad[wheel] += drive.increment_rad;
        drive.increment_rad = match exchange {
            Exchange::Complete => std::mem::take(&mut self.unused_rad[wheel]),
            _ => 0.0,
        };
        drive
    }

    /// After all wheels of a cycle.
    pub(super) fn remember(&mut self, robot: &crate::signals::CycleRecord) {
        self.unread.take(&robot.time, robot.exchange, &robot.measurements, self.uncounted);
    }

    /// What odometry has to know of in this cycle, rad.
    pub(super) fn take_unread(&mut self, exchange: Exchange) -> [f64; MAX_WHEELS] {
        match exchange {
            Exchange::Complete => std::mem::take(&mut self.unread_rad),
            _ => [0.0; MAX_WHEELS],
        }
    }
}

impl Robot {
    /// The estimator said what is no number: what it believed is forgotten, and where the platform stands is unknown.
    pub(super) fn forget_pose(&mut self) {
        let (position_m2, heading_rad2) = (GREATEST_SIGMA_M.powi(2), GREATEST_SIGMA_RAD.powi(2));
        self.record.state = PlatformState {
            covariance: [position_m2, 0.0, 0.0, position_m2, 0.0, heading_rad2],
            pose_known: false,
            ..PlatformState::default()
        };
        self.motion.forget();
        self.estimator.reset(&self.record.state);
        self.counted.pose_lost = true;
    }

    /// Whether a request needs a pose that nobody knows.
    pub(super) fn lacks_pose_for(&self, kind: &RequestKind) -> bool {
        let needs_pose = matches!(
            kind,
            RequestKind::Track
                | RequestKind::Resume
                | RequestKind::GoTo { .. }
                | RequestKind::Velocity { frame: Frame::Odom, .. }
        );
        needs_pose && !self.record.state.pose_known
    }

    /// Somebody says where the platform stands.
    pub(super) fn set_pose(&mut self, pose: Pose2, [sigma_m, sigma_rad]: [f64; 2]) -> RequestAnswer {
        if !self.stands() {
            return RequestAnswer::WrongPhase;
        }
        let is_sigma = |sigma: f64, greatest: f64| (0.0..=greatest).contains(&sigma);
        if !pose.is_finite()
            || !is_sigma(sigma_m, GREATEST_SIGMA_M)
            || !is_sigma(sigma_rad, GREATEST_SIGMA_RAD)
        {
            return RequestAnswer::Refused;
        }
        // In the turn in which the platform is: a path that was begun goes on without unwinding whole turns.
        let now_rad = self.record.state.odom_from_body.heading_rad;
        let now_rad = if now_rad.is_finite() { now_rad } else { 0.0 };
        let heading_rad = now_rad + wrap_angle_rad(pose.heading_rad - now_rad);
        let odom_from_body = Pose2 { heading_rad, ..pose };
        let [position_m2, heading_rad2] = [sigma_m * sigma_m, sigma_rad * sigma_rad];
        self.record.state = PlatformState {
            odom_from_body,
            covariance: [position_m2, 0.0, 0.0, position_m2, 0.0, heading_rad2],
            ..PlatformState::default()
        };
        self.estimator.reset(&self.record.state);
        self.counted.pose_lost = false;
        self.controllers[self.active].reset();
        self.limiter.reset(odom_from_body);
        self.record.wished = Setpoint::at_rest(odom_from_body);
        RequestAnswer::Taken
    }

    /// Nothing is followed, and no wheel turns, by what all drives said in this cycle.
    pub(super) fn stands(&self) -> bool {
        let rests = matches!(self.lifecycle.phase(), Phase::Disabled | Phase::Holding | Phase::Fault);
        let stands = self.record.measurements.present().iter().all(DriveMeasurement::stands);
        rests && stands && self.record.exchange == Exchange::Complete
    }

    /// A person's wish, reduced where nobody knows the platform's place.
    pub(super) fn reduced(&self, twist: Twist2) -> Twist2 {
        if self.record.state.pose_known {
            return twist;
        }
        let factor = |speed: f64, most: f64| if speed > most { most / speed } else { 1.0 };
        twist.scaled(factor(twist.speed_m_s(), UNKNOWN_M_S).min(factor(twist.w_rad_s.abs(), UNKNOWN_RAD_S)))
    }
}
