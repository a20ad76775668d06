//! What was lost is back: nothing moves that needs a person.

use omnibase_cia402::ErrorCode;
use omnibase_robot::config::ComebackEnd;
use omnibase_robot::signals::Phase;

use super::losses::OWN_FAULT;
use super::{Case, Comeback, Loss, STANDING_RAD_S, State, Stops, WATCHDOG_NS};

/// What a drive whose process data went away says: the SGDV's A.A11.
const LOST_DATA: ErrorCode = ErrorCode(0x0A11);
/// Cycles for which it is away at least.
const AWAY: u32 = 20;
/// A robot that nothing was asked of stays so for so long at least, s.
const STAYS_S: f64 = 0.2;
/// A comeback shows itself so long after the drives have rested, s.
const BEGINS_S: f64 = 0.5;
/// Below this speed a wheel rests, rad/s: well below what counts as motion.
const RESTING_RAD_S: f64 = 0.5 * STANDING_RAD_S;
/// The longest that a wheel creeps on by its last command once its drive is heard again, s.
const CREEPS_S: f64 = WATCHDOG_NS as f64 * 1e-9;
/// The least warning, s.
const WARNED_S: f64 = 3.0;

impl Stops {
    /// What was lost on the bus comes back; whether anything moves then, or gets torque.
    pub(super) fn watch_comeback(&mut self, case: &Case) -> Comeback {
        let is_concerned =
            self.lost.is_some() || self.silent.is_some() || self.failed.is_some() || self.lost_carrier;
        if self.is_dead || !is_concerned {
            return Comeback::NotConcerned;
        }
        // Drives say what is wrong with them, sooner or later.
        if let Some(wheel) = self.failed {
            self.operator.drive_said(wheel, OWN_FAULT);
        }
        if let Some((wheel, Loss::DriveData, _)) = self.lost {
            self.operator.drive_said(wheel, LOST_DATA);
        }
        // Shorter than what is tolerated a loss is none.
        self.run(AWAY);
        // One without process data may creep by its last command until its watchdog expires: that is no new motion.
        let mut rested = self.fastest_rad_s() < RESTING_RAD_S;
        self.bring_back();
        let plan = self.trial.plan.safety.comeback;
        let begins_s = plan.map_or(STAYS_S, |plan| plan.steady_ns as f64 * 1e-9 + BEGINS_S);
        let warns_s = match plan.map(|plan| plan.end) {
            Some(ComebackEnd::MoveAgain { warning_ns }) => warning_ns as f64 * 1e-9,
            Some(ComebackEnd::Hold) | None => 0.0,
        };
        let was_without_torque = is_without_torque(self.trial.robot.phase());
        let (mut warned_s, mut end) = (0.0, Comeback::Stayed);
        for cycle in 1..=((begins_s + warns_s + BEGINS_S) / self.cycle_s) as u32 {
            self.cycle();
            let seconds = f64::from(cycle) * self.cycle_s;
            let phase = self.trial.robot.phase();
            let now_ns = self.trial.time().now_ns;
            let warns = self.operator.moves_again_in_s(now_ns).is_some();
            warned_s += if warns { self.cycle_s } else { 0.0 };
            rested |= self.fastest_rad_s() < RESTING_RAD_S || seconds > CREEPS_S;
            if phase == Phase::Tracking || rested && self.fastest_rad_s() >= STANDING_RAD_S {
                let is_warned = warned_s >= WARNED_S - 2.0 * self.cycle_s;
                return if is_warned && self.may_move(case) {
                    Comeback::MovedAsWarned
                } else {
                    Comeback::WithoutPerson
                };
            }
            if was_without_torque && !is_without_torque(phase) {
                end = Comeback::Held;
                if !self.may_hold(case) {
                    return Comeback::WithoutPerson;
                }
            }
            if seconds > begins_s && !warns {
                break;
            }
        }
        end
    }

    /// Whether a comeback to holding is allowed: after the loss of one drive amid a page's motion, and nothing else.
    fn may_hold(&self, case: &Case) -> bool {
        let is_motion = matches!(case.state, State::PageReference | State::Way | State::Paused);
        self.trial.plan.safety.comeback.is_some()
            && case.lost_drive().is_some()
            && is_motion
            && self.page_lives
    }

    /// Whether it may move on: where the file says so, and the pose is known, too.
    fn may_move(&self, case: &Case) -> bool {
        let plan = self.trial.plan.safety.comeback;
        self.may_hold(case)
            && plan.is_some_and(|plan| matches!(plan.end, ComebackEnd::MoveAgain { .. }))
            && case.lost_drive() == Some(Loss::DriveData)
    }
}

fn is_without_torque(phase: Phase) -> bool {
    matches!(phase, Phase::Disabled | Phase::Fault)
}
