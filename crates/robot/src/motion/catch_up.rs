//! Who was kept from his path gets back onto it by a plan: a way to a place further on, from whatever state of motion.
//!
//! Ways are tried one a cycle, so that no cycle becomes long; what is tried begins where the platform is in that cycle. Until one is
//! found the platform follows its path as the limiter leads it. A way that obstacles bend is looked for anew.

use super::begin::{From, JOINS};
use super::way::{Allowed, Then};
use super::{Motion, Pausing, is_there};
use crate::limiter::SpeedBound;
use crate::signals::Course;

/// What was tried in vain.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct CatchUp {
    /// Number of the next place on the path.
    next: i32,
    /// Of the places that are reached late, the one that is reached least late, and by how much, s.
    least_late: Option<(i32, f64)>,
}

impl Motion {
    /// In a cycle in which nothing holds the platform back any more that was beside its path.
    pub(super) fn catch_up(&mut self, from: &From<'_>) {
        let follows = match self.course {
            Course::Reference => self.pausing == Pausing::No && self.begun,
            Course::Way => matches!(self.way.then, Then::Joins { .. }),
            Course::Velocity | Course::Onto => false,
        };
        // No plan leads back onto a path that is kept: it would cut its bends.
        if !follows || self.keeps_path() || self.is_hindered || !self.was_hindered {
            self.catch_up = CatchUp::default();
            return;
        }
        let here = from.setpoint.odom_from_body;
        if is_there(&self.wished_last, &here) {
            (self.catch_up, self.was_hindered) = (CatchUp::default(), false);
            return;
        }
        let CatchUp { next, least_late } = self.catch_up;
        let is_last = next == JOINS;
        let number = if is_last { least_late.map(|(number, _)| number) } else { Some(next) };
        // No faster than a path may be caught up with.
        let SpeedBound { speed_m_s, turn_speed_rad_s } = self.bound();
        let allowed = self.allowed(from.settings);
        let speeds = [allowed.speeds[0].min(speed_m_s), allowed.speeds[1].min(turn_speed_rad_s)];
        let allowed = Allowed { speeds, ..allowed };
        let joint = number.and_then(|number| self.joint(from, &allowed, self.time_s(), number));
        let joint = joint.filter(|_| !self.tried.is_blocked(from.guard));
        match joint {
            Some(joint) if is_last || joint.is_quick() => {
                let headway = self.headway;
                self.take_joint(from.time, &joint);
                // A way that is looked for again and again makes no headway by that.
                self.headway = headway;
                self.headway.turn_aside();
                self.catch_up = CatchUp::default();
            }
            Some(joint) if least_late.is_none_or(|(_, late_s)| joint.longer_s < late_s) => {
                self.catch_up = CatchUp { next: next + 1, least_late: Some((next, joint.longer_s)) };
            }
            _ if is_last => self.catch_up = CatchUp::default(),
            _ => self.catch_up.next += 1,
        }
    }
}
