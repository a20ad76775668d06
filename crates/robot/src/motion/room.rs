//! Whether a plan leads out of the fence: where it is, and what lies ahead of it.
//!
//! Where it has less room than must be kept, because little is known of the pose, it may gain room and lose none.

use crate::guard::{Guard, RoomLeft};
use crate::stages::Reference;

/// A reference stops on its path before it comes nearer than this to the fence's margin, m: room for slowing down softly.
const LOOK_ROOM_M: f64 = 0.04;
/// Between two looks ahead on the path, s of the reference's time; and looks in a cycle.
pub(super) const LOOK_STEP_S: f64 = 0.005;
const LOOKS_A_CYCLE: usize = 8;
/// By how much less room than it had counts as the same, m.
const SAME_M: f64 = 1e-4;

/// The room that a plan had already.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RoomHad {
    /// The last one; the greatest since it is less than must be kept, m.
    had_m: f64,
}

impl RoomHad {
    pub(super) fn from(room_m: f64) -> Self {
        RoomHad { had_m: room_m }
    }

    /// How much more room than it must a plan leaves at its next place, m; NaN where that isn't known.
    pub(super) fn spare_m(&mut self, left: RoomLeft) -> f64 {
        let least_m = left.kept_m.min(self.had_m - SAME_M);
        self.had_m = if left.is_enough() { left.room_m } else { self.had_m.max(left.room_m) };
        left.room_m - least_m
    }
}

/// What is known of the path ahead.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ahead {
    /// The reference's time up to which it keeps off the fence, s.
    free_until_s: f64,
    had: RoomHad,
    /// At the last look.
    left: Option<RoomLeft>,
    /// It began with less room than must be kept.
    begins_too_near: bool,
    /// Where it leads out.
    is_blocked: bool,
}

impl Ahead {
    pub(super) fn from(time_s: f64) -> Self {
        Ahead {
            free_until_s: time_s,
            had: RoomHad::from(f64::NEG_INFINITY),
            left: None,
            begins_too_near: false,
            is_blocked: false,
        }
    }

    /// Looks along a path; whether it leads out of the fence before the time that is needed to come to a halt on it.
    pub(super) fn leads_out(&mut self, reference: &dyn Reference, guard: &Guard, needed_s: f64) -> bool {
        let end_s = reference.duration_s().unwrap_or(f64::INFINITY);
        for _ in 0..LOOKS_A_CYCLE {
            // A little further than needed: the rate may rise until the next cycle.
            if self.is_blocked || self.free_until_s > end_s.min(needed_s) + LOOK_STEP_S {
                break;
            }
            let Some(place) = reference.preview(self.free_until_s) else { break };
            self.is_blocked = !self.passes(guard.room_left(&place.odom_from_body));
            if !self.is_blocked {
                self.free_until_s += LOOK_STEP_S;
            }
        }
        self.is_blocked && needed_s >= self.free_until_s
    }

    fn passes(&mut self, left: RoomLeft) -> bool {
        let softly = RoomLeft { kept_m: left.kept_m + LOOK_ROOM_M, ..left };
        let spare_m = self.had.spare_m(softly);
        let Some(before) = self.left.replace(left) else {
            self.begins_too_near = !left.is_enough();
            return true;
        };
        // The less is known of the pose the more must be kept, along a wall too.
        let gains = left.room_m > before.room_m || left.kept_m <= before.kept_m;
        spare_m >= 0.0 && (softly.is_enough() || gains || self.begins_too_near)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn room_that_is_not_known_is_never_enough() {
        for (room_m, kept_m) in [(f64::NAN, 0.1), (f64::NAN, f64::NAN), (f64::NAN, f64::INFINITY)] {
            let mut had = RoomHad::from(0.5);
            let spare_m = had.spare_m(RoomLeft { room_m, kept_m });
            assert!(spare_m.is_nan(), "{spare_m}");
            // And nothing of it stays.
            assert!(had.spare_m(RoomLeft { room_m: 0.05, kept_m: 0.1 }) < 0.0);
            assert!(had.spare_m(RoomLeft { room_m: 0.2, kept_m: 0.1 }) > 0.0);
        }
    }

    #[test]
    fn where_there_is_too_little_room_none_is_lost() {
        let mut had = RoomHad::from(0.2);
        let mut spare_m = |room_m| had.spare_m(RoomLeft { room_m, kept_m: 0.3 });
        for (room_m, is_lost) in [
            (0.2, false),
            (0.2 - 0.5 * SAME_M, false),
            (0.25, false),
            (0.25 - 0.7 * SAME_M, false),
            // Little by little is as much.
            (0.25 - 1.4 * SAME_M, true),
            (0.31, false),
            (0.305, false),
            (0.31, false),
            (0.29, true),
        ] {
            assert_eq!(spare_m(room_m) < 0.0, is_lost, "{room_m}");
        }
    }
}
