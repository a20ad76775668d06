//! The way to a pose, or onto a reference, from whatever state of motion: in the shortest time, with limited jerk.

use omnibase_platform::{Pose2, Twist2};
use omnibase_trajectory::{NoMotion, PointToPoint};

use super::begin::JOIN_RATE;
use super::room::RoomHad;
use crate::config::{Limits, motion_limits};
use crate::guard::Guard;
use crate::signals::{ReferenceStatus, Setpoint};

/// A way keeps this far from the limits, so that catching up has room.
const ROOM: f64 = 1.05;
/// Places of a way that are looked at.
const LOOKS: u32 = 32;

/// What comes behind a way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Then {
    /// It rests there.
    #[default]
    Rests,
    /// The reference goes on from where it stands.
    GoesOn,
    /// The reference goes on from its own time, ns, at this rate, without a stop.
    Joins { at_ns: f64, rate: f64 },
}

/// What a way may take.
#[derive(Clone, Copy, Debug)]
pub(super) struct Allowed {
    pub(super) limits: Limits,
    /// Greatest speeds that are set, m/s and rad/s.
    pub(super) speeds: [f64; 2],
    /// Part of the limits' accelerations.
    pub(super) share: f64,
}

impl Allowed {
    /// The rate at which a reference is joined at a place.
    pub(super) fn rate_at(&self, place: &Setpoint) -> f64 {
        let Allowed { limits, speeds: [speed_m_s, turn_rad_s], share } = *self;
        let (v, a) = (&place.twist_in_odom, &place.acceleration_in_odom);
        let speed = (v.speed_m_s() / limits.speed_m_s.min(speed_m_s))
            .max(v.w_rad_s.abs() / limits.turn_speed_rad_s.min(turn_rad_s));
        let gain =
            (a.speed_m_s() / limits.acceleration_m_s2).max(a.w_rad_s.abs() / limits.turn_acceleration_rad_s2);
        (JOIN_RATE / speed.max((gain / share).sqrt())).min(1.0)
    }
}

#[derive(Debug, Default)]
pub(super) struct PlannedMotion {
    motion: PointToPoint,
    /// Where it ends.
    pub(super) to: Pose2,
    /// Its own time, ns.
    pub(super) time_ns: f64,
    pub(super) then: Then,
    /// What it was planned with.
    speeds: [f64; 2],
    share: f64,
    /// How long it was when it was planned, m.
    left_m: f64,
}

/// Limits at which every motion takes `factor` times as long.
fn slowed(limits: &omnibase_trajectory::Limits, factor: f64) -> omnibase_trajectory::Limits {
    omnibase_trajectory::Limits {
        speed_m_s: limits.speed_m_s / factor,
        acceleration_m_s2: limits.acceleration_m_s2 / factor.powi(2),
        jerk_m_s3: limits.jerk_m_s3 / factor.powi(3),
        rate_rad_s: limits.rate_rad_s / factor,
        angular_acceleration_rad_s2: limits.angular_acceleration_rad_s2 / factor.powi(2),
        angular_jerk_rad_s3: limits.angular_jerk_rad_s3 / factor.powi(3),
    }
}

/// From one pose to another, m: turns count with an arm of 1 m.
fn apart_m(one: &Pose2, other: &Pose2) -> f64 {
    one.distance_m(*other) + (one.heading_rad - other.heading_rad).abs()
}

fn planned(setpoint: &Setpoint) -> omnibase_trajectory::Setpoint {
    omnibase_trajectory::Setpoint {
        odom_from_base: setpoint.odom_from_body,
        twist_in_odom: setpoint.twist_in_odom,
        acceleration_in_odom: setpoint.acceleration_in_odom,
        ..Default::default()
    }
}

impl PlannedMotion {
    /// Plans from a state of motion to one. A way that can't be planned stays as it was.
    pub(super) fn plan(&mut self, [from, to]: [&Setpoint; 2], allowed: &Allowed) -> Result<(), NoMotion> {
        let most = slowed(&motion_limits(&allowed.limits), ROOM);
        let [speed_m_s, turn_rad_s] = allowed.speeds;
        let limits = omnibase_trajectory::Limits {
            speed_m_s: most.speed_m_s.min(speed_m_s),
            rate_rad_s: most.rate_rad_s.min(turn_rad_s),
            acceleration_m_s2: most.acceleration_m_s2 * allowed.share,
            angular_acceleration_rad_s2: most.angular_acceleration_rad_s2 * allowed.share,
            ..most
        };
        self.motion.plan(&planned(from), &planned(to), &limits)?;
        (self.to, self.time_ns, self.then) = (to.odom_from_body, 0.0, Then::Rests);
        (self.speeds, self.share) = (allowed.speeds, allowed.share);
        self.left_m = apart_m(&from.odom_from_body, &self.to);
        Ok(())
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.motion.duration_s()
    }

    pub(super) fn left_s(&self) -> f64 {
        self.duration_s() - self.time_ns * 1e-9
    }

    pub(super) fn is_over(&self) -> bool {
        self.left_s() <= 0.0
    }

    /// The speed at half of its time.
    pub(super) fn middle(&self) -> Twist2 {
        self.motion.sample(0.5 * self.duration_s()).twist_in_odom
    }

    /// The part of its accelerations that a floor carries which carries this part of the limits'.
    pub(super) fn carried(&self, share: f64) -> f64 {
        if share >= self.share { 1.0 } else { share / self.share }
    }

    /// Whether more speed is set than it was planned with.
    pub(super) fn may_be_faster(&self, speeds: [f64; 2]) -> bool {
        speeds.iter().zip(self.speeds).any(|(now, then)| *now > then)
    }

    /// By how much nearer to its end than where it was planned a pose is, m.
    pub(super) fn gained_m(&self, here: &Pose2) -> f64 {
        self.left_m - apart_m(here, &self.to)
    }

    /// Whether it leads out of the fence, from a place with so much room to it, m.
    pub(super) fn leads_out(&self, guard: &Guard, room_m: f64) -> bool {
        if !guard.has_fence() {
            return false;
        }
        let mut had = RoomHad::from(room_m);
        let part_s = self.duration_s() / f64::from(LOOKS);
        let mut spare_m = |look: u32| {
            let place = self.motion.sample(part_s * f64::from(look)).odom_from_base;
            had.spare_m(guard.room_left(&place))
        };
        // What isn't known leads out.
        !(1..=LOOKS).all(|look| spare_m(look) >= 0.0)
    }

    /// Whether an obstacle stands in it.
    pub(super) fn is_blocked(&self, guard: &Guard) -> bool {
        let part_s = self.duration_s() / f64::from(LOOKS);
        let mut places = (1..=LOOKS).map(|look| self.motion.sample(part_s * f64::from(look)));
        places.any(|place| guard.is_blocked(&place.odom_from_base))
    }

    /// The place at its own time.
    pub(super) fn sample(&self) -> Setpoint {
        let now = self.motion.sample(self.time_ns * 1e-9);
        let is_finished = self.is_over() && self.then == Then::Rests;
        Setpoint {
            odom_from_body: now.odom_from_base,
            twist_in_odom: now.twist_in_odom,
            acceleration_in_odom: now.acceleration_in_odom,
            status: if is_finished { ReferenceStatus::Finished } else { ReferenceStatus::Moving },
        }
    }
}
