//! Whether a plan makes headway against obstacles, and how fast a platform that gave way may catch up with it.
//!
//! Headway is plan's time that passes, or way by which the platform comes nearer to the plan's place than it ever was:
//! to and fro is none. What lacks is summed up, so that a plan that creeps, or goes on for moments only, is given up too.

use omnibase_platform::{Pose2, wrap_angle_rad};

use crate::config::GuardPlan;
use crate::limiter::SpeedBound;
use crate::signals::Setpoint;

/// Part of its rate at which a plan's time must pass at least, or else time without headway is counted.
const LEAST_RATE: f64 = 0.1;
/// Speed with which the platform must come nearer at least, likewise, m/s; about its heading with an arm of 1 m.
const LEAST_M_S: f64 = 0.02;
/// Nearer than this to a plan's place it is caught up with, m and rad.
const CAUGHT_UP: f64 = 1e-3;
/// With these a place is caught up with where the path itself rests, m/s and rad/s.
const LEAST_CATCH_UP: SpeedBound = SpeedBound { speed_m_s: 0.05, turn_speed_rad_s: 0.1 };

/// What a cycle asked of a plan, and what passed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PlanStep {
    pub(super) elapsed_s: f64,
    /// Time of the plan that passed, s; none behind its end.
    pub(super) passed_s: f64,
    /// The rate without obstacles; 0 where the plan shall not go on.
    pub(super) rate: f64,
    /// The plan's speed at that rate.
    pub(super) speed: SpeedBound,
}

/// How a plan gets on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Headway {
    give_up_s: f64,
    catch_up_factor: f64,
    without_s: f64,
    /// The least distance to the plan's place so far, had the place stayed, m.
    nearest_m: f64,
    place: Option<Pose2>,
    /// The path's greatest speed since the platform was last where it should be.
    own: SpeedBound,
}

/// From one place to another, m: turns count with an arm of 1 m.
fn apart_m(one: &Pose2, other: &Pose2) -> f64 {
    one.distance_m(*other) + wrap_angle_rad(one.heading_rad - other.heading_rad).abs()
}

/// Whether a place is caught up with.
pub(crate) fn is_there(place: &Pose2, here: &Pose2) -> bool {
    place.distance_m(*here) <= CAUGHT_UP
        && wrap_angle_rad(place.heading_rad - here.heading_rad).abs() <= CAUGHT_UP
}

impl Headway {
    pub(super) fn new(plan: &GuardPlan) -> Self {
        Headway {
            give_up_s: plan.give_up_s,
            catch_up_factor: plan.catch_up_factor,
            without_s: 0.0,
            nearest_m: 0.0,
            place: None,
            own: SpeedBound::default(),
        }
    }

    /// A plan begins.
    pub(super) fn begin(&mut self) {
        (self.without_s, self.nearest_m, self.place) = (0.0, 0.0, None);
        self.own = SpeedBound::default();
    }

    /// The plan leads elsewhere, and gets on as it did.
    pub(super) fn turn_aside(&mut self) {
        (self.nearest_m, self.place) = (0.0, None);
    }

    /// One cycle of a plan: where it should be, and where the platform was led.
    pub(super) fn note(&mut self, step: &PlanStep, [wished, setpoint]: [&Setpoint; 2]) {
        let (place, here) = (&wished.odom_from_body, &setpoint.odom_from_body);
        let lag_m = apart_m(place, here);
        let moved_m = self.place.replace(*place).map_or(lag_m, |before| apart_m(&before, place));
        let reached_m = self.nearest_m + moved_m;
        self.nearest_m = reached_m.min(lag_m);
        let is_there = is_there(place, here);
        self.own = if is_there { step.speed } else { self.own.greater(&step.speed) };
        if is_there && step.passed_s > 0.0 {
            self.without_s = 0.0;
        } else if step.rate > 0.0 {
            // Behind the end too: who is held back there, however near, would be for ever.
            let gained_s = step.passed_s / (LEAST_RATE * step.rate)
                + (reached_m - lag_m).max(0.0) / (LEAST_M_S * step.rate);
            self.without_s = (self.without_s + step.elapsed_s - gained_s).max(0.0);
        }
    }

    /// Whether it made none for too long.
    pub(super) fn is_blocked(&self) -> bool {
        self.without_s >= self.give_up_s
    }

    /// How fast the platform may be while the plan's own speed is this.
    pub(super) fn bound(&self, speed: &SpeedBound) -> SpeedBound {
        let own = self.own.greater(speed);
        let faster = SpeedBound {
            speed_m_s: self.catch_up_factor * own.speed_m_s,
            turn_speed_rad_s: self.catch_up_factor * own.turn_speed_rad_s,
        };
        faster.greater(&LEAST_CATCH_UP)
    }
}

#[cfg(test)]
mod tests;
