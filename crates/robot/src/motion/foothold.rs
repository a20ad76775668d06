//! At which part of its rate a reference may go so that its own accelerations keep to what the floor carries.
//!
//! At the rate r all accelerations of a path are r² of its own. What lies ahead counts as well: a rate falls slowly.

use omnibase_platform::Twist2;

use crate::config::{Limits, motion_limits};
use crate::signals::Setpoint;
use crate::stages::{PlannedFor, Reference};

/// Between two looks on the path, s of the reference's time, and how many are kept.
const STEP_S: f64 = 0.05;
const LOOKS: u64 = 40;
/// Part of the acceleration and jerk limits that slowing a reference down may take; the rest is the path's own.
const SHARE_OF_LIMITS: f64 = 0.5;
/// What is known of a mass to a twentieth is as it was planned with, and so is a payload that is no more of it: torques are planned with
/// nine tenths.
const SAME_MASS: f64 = 1.05;
/// A plan that warm motors hold back keeps this part of its rate: a sixteenth of its heat.
const LEAST_WARM_RATE: f64 = 0.5;
/// Part of what the floor carries that the path's own acceleration may take; the rest slows it down and catches up.
pub(super) const SHARE_OF_PATH: f64 = 0.9;
/// Frictions that differ by less are one, over themselves.
const ROUNDING: f64 = 1e-9;
/// A plan that is slower stands, m/s and rad/s.
const LEAST_SPEED: f64 = 1e-6;
/// No reference goes slower than that.
pub(super) const LEAST_RATE: f64 = 0.05;

/// How near a setpoint is to what wheels and floor bear.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Asked {
    /// No more than motions are planned with.
    AsPlanned,
    /// More, and every wheel grips still.
    More,
    /// A wheel may slip, or can't give its torque.
    TooMuch,
}

/// What the floor carries.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Carried {
    /// The part of the limits' accelerations at which every wheel grips; 1 where nothing is held back.
    pub(crate) share: f64,
    /// The friction that plans may count on; `None` where nothing is known of the floor.
    pub(crate) friction: Option<f64>,
    /// What a slope may take of it.
    pub(crate) slope: f64,
    /// What the platform surely weighs, kg.
    pub(crate) mass_kg: f64,
    /// What the last setpoint asked of the wheels.
    pub(crate) asked: Asked,
    /// The root of the mean square of the warmest motor's torque over what it bears for ever, so far.
    pub(crate) warmth: f64,
    /// A wheel slips, or torques are held back so that none does: the platform doesn't keep up with its wish yet.
    pub(crate) is_behind: bool,
}

impl Carried {
    pub(super) const ALL: Carried = Carried {
        share: 1.0,
        friction: None,
        slope: 0.0,
        mass_kg: 0.0,
        asked: Asked::AsPlanned,
        warmth: 0.0,
        is_behind: false,
    };

    /// Whether floor and mass are as a plan counts on, and what was asked last grips.
    pub(super) fn carries(&self, plan: &PlannedFor) -> bool {
        self.friction.is_some_and(|carried| carried >= plan.friction * (1.0 - ROUNDING))
            && self.mass_kg <= SAME_MASS * plan.mass_kg
            && self.asked < Asked::TooMuch
    }

    /// The rate at which a slope leaves of this floor what a plan takes: its accelerations go with the rate's square.
    pub(super) fn slope_rate(&self, plan: &PlannedFor) -> f64 {
        let left = (self.friction.unwrap_or(0.0) - self.slope) / plan.friction;
        if self.slope == 0.0 { 1.0 } else { left.max(0.0).sqrt().clamp(LEAST_RATE, 1.0) }
    }

    /// The rate at which motors that are warm already bear a plan that counts on cold ones: its heat goes with the rate's fourth power.
    pub(super) fn warm_rate(&self, plan: &PlannedFor) -> f64 {
        let left = (1.0 - self.warmth.powi(2)).max(0.0);
        if plan.heat.powi(2) <= left {
            1.0
        } else {
            (left / plan.heat.powi(2)).powf(0.25).max(LEAST_WARM_RATE)
        }
    }

    /// The fastest change of a rate, 1/s, at which a plan's place speeds up no more than the floor carries, and not at all while the
    /// platform is behind; `None` where the floor carries everything, or the plan doesn't speed up. The plan's speed and
    /// acceleration are those at its full rate: at the rate r it is v·r fast and speeds up by a·r² + v·r'.
    pub(super) fn rate_change(
        &self,
        rate: f64,
        [speed, acceleration]: [Twist2; 2],
        limits: &Limits,
    ) -> Option<f64> {
        if self.share >= 1.0 && !self.is_behind {
            return None;
        }
        let share = if self.is_behind { 0.0 } else { SHARE_OF_PATH * self.share };
        let most = |speed: f64, along: f64, most: f64| {
            (speed > LEAST_SPEED && along > 0.0).then(|| (share * most - rate * rate * along) / speed)
        };
        let speed_m_s = speed.speed_m_s();
        let (vx, vy) = (speed.vx_m_s, speed.vy_m_s);
        let along_m_s2 = (vx * acceleration.vx_m_s + vy * acceleration.vy_m_s) / speed_m_s.max(LEAST_SPEED);
        let straight = most(speed_m_s, along_m_s2, limits.acceleration_m_s2);
        let gains_rad_s2 = acceleration.w_rad_s * speed.w_rad_s.signum();
        let turning = most(speed.w_rad_s.abs(), gains_rad_s2, limits.turn_acceleration_rad_s2);
        match (straight, turning) {
            (Some(straight), Some(turning)) => Some(straight.min(turning)),
            (one, other) => one.or(other),
        }
    }
}

/// What lies ahead.
#[derive(Clone, Copy, Debug)]
pub(super) struct Foothold {
    /// The accelerations at full rate, over the limits.
    needs: [f64; LOOKS as usize],
    /// Number of the first look that isn't done; `None` before any.
    next: Option<u64>,
}

impl Foothold {
    pub(super) const NEW: Foothold = Foothold { needs: [0.0; LOOKS as usize], next: None };

    /// The greatest rate from a time of the reference on; `share` of the limits' accelerations is carried.
    pub(super) fn rate(
        &mut self,
        reference: &dyn Reference,
        time_s: f64,
        limits: &Limits,
        share: f64,
    ) -> f64 {
        if share >= 1.0 {
            // Nothing needs to be known of the path.
            *self = Foothold::NEW;
            return 1.0;
        }
        let first = (time_s / STEP_S) as u64;
        let end = first.saturating_add(LOOKS);
        for look in self.next.unwrap_or(first).max(first)..end {
            let ahead = reference.preview(look as f64 * STEP_S);
            self.needs[(look % LOOKS) as usize] = ahead.map_or(0.0, |at| need(&at, limits));
        }
        self.next = Some(end);
        let worst = self.needs.iter().copied().fold(0.0, f64::max);
        rate(worst, share)
    }
}

/// The rate at which a path's greatest acceleration, over the limits, is carried.
pub(super) fn rate(need: f64, share: f64) -> f64 {
    if share >= 1.0 || need <= 0.0 {
        1.0
    } else {
        (SHARE_OF_PATH * share / need).sqrt().clamp(LEAST_RATE, 1.0)
    }
}

fn need(at: &Setpoint, limits: &Limits) -> f64 {
    let acceleration = &at.acceleration_in_odom;
    (acceleration.speed_m_s() / limits.acceleration_m_s2)
        .max(acceleration.w_rad_s.abs() / limits.turn_acceleration_rad_s2)
}

/// How fast the rate of a reference may change, 1/s and 1/s², where the floor carries so much of the limits' accelerations.
pub(super) fn rate_limits(limits: &Limits, share: f64) -> [f64; 2] {
    let per_s = |most: f64, speed: f64| SHARE_OF_LIMITS * most / speed;
    [
        share
            * per_s(limits.acceleration_m_s2, limits.speed_m_s)
                .min(per_s(limits.turn_acceleration_rad_s2, limits.turn_speed_rad_s)),
        per_s(limits.jerk_m_s3, limits.speed_m_s)
            .min(per_s(limits.turn_jerk_rad_s3, limits.turn_speed_rad_s)),
    ]
}

pub(super) fn limits_of_rate(
    limits: &Limits,
    [rate_1_s, rate_1_s2]: [f64; 2],
) -> omnibase_trajectory::Limits {
    omnibase_trajectory::Limits {
        speed_m_s: 1.0,
        acceleration_m_s2: rate_1_s,
        jerk_m_s3: rate_1_s2,
        ..motion_limits(limits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits {
        speed_m_s: 1.0,
        acceleration_m_s2: 2.0,
        jerk_m_s3: 40.0,
        turn_speed_rad_s: 1.5,
        turn_acceleration_rad_s2: 3.0,
        turn_jerk_rad_s3: 80.0,
        wheel_speed_rad_s: 15.0,
        wheel_torque_nm: 21.0,
    };

    #[test]
    fn a_plan_is_slower_by_what_a_slope_takes_of_the_friction_that_it_was_planned_with() {
        let plan = PlannedFor { friction: 0.4, mass_kg: 70.0, heat: 0.0 };
        let rate = |slope: f64| Carried { friction: Some(0.4), slope, ..Carried::ALL }.slope_rate(&plan);
        assert_eq!(rate(0.0), 1.0);
        // Its accelerations go with the square.
        assert!((0.4 * rate(0.1).powi(2) + 0.1 - 0.4).abs() < 1e-12, "{}", rate(0.1));
        for none_is_left in [0.4, 0.7, f64::NAN] {
            assert_eq!(rate(none_is_left), LEAST_RATE);
        }
        // A floor that is better than planned with leaves the plan as it is.
        let better = Carried { friction: Some(0.6), slope: 0.1, ..Carried::ALL };
        assert_eq!(better.slope_rate(&plan), 1.0);
    }

    #[test]
    fn a_plan_speeds_up_no_more_than_the_floor_carries_and_not_at_all_for_a_platform_that_is_behind() {
        let plan = |vx, ax, w, gain| [Twist2::new(vx, 0.0, w), Twist2::new(ax, 0.0, gain)];
        let change = |share, is_behind, plan: [Twist2; 2]| {
            Carried { share, is_behind, ..Carried::ALL }.rate_change(0.8, plan, &LIMITS)
        };
        // At the rate 0.8 the place gains 0.64·1.5 + 0.5·r' m/s²; carried are 0.9·0.2·2.
        let speeds_up = plan(0.5, 1.5, 0.0, 0.0);
        let most = change(0.2, false, speeds_up).expect("it speeds up");
        assert!((0.64 * 1.5 + 0.5 * most - 0.36).abs() < 1e-12, "{most}");
        let most = change(1.0, true, speeds_up).expect("it is behind");
        assert!((0.64 * 1.5 + 0.5 * most).abs() < 1e-12, "{most}");
        // A turn counts likewise, to the right as to the left; and the slower of both.
        for sign in [1.0, -1.0] {
            let turns = plan(0.5, 0.1, 0.4 * sign, 2.0 * sign);
            let most = change(0.2, false, turns).expect("it turns faster");
            assert!((0.64 * 2.0 + 0.4 * most - 0.54).abs() < 1e-12, "{most}");
        }
        // A floor that carries all holds nothing back; to brake more slowly would take more way.
        assert_eq!(change(1.0, false, speeds_up), None);
        assert_eq!(change(0.2, true, plan(0.5, -1.5, 0.0, 0.0)), None);
        assert_eq!(change(0.2, true, plan(0.0, 1.5, 0.0, 0.0)), None);
    }
}
