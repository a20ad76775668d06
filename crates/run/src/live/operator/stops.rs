//! Stops of the robot and of its axes, and what must not begin after them.

use omnibase_robot::RequestKind;
use omnibase_robot::signals::{CycleRecord, RequestAnswer, SafetyReason, StopCategory};

use super::super::command::{Answer, Client, Commander, Refusal, begins_motion};
use super::{Operator, Waiting};

impl Operator {
    /// Somebody stops the robot: it stays so, whoever holds a stick.
    pub(super) fn stop_asked(&mut self, category: StopCategory, client: Client, ticket: u64) {
        self.ask_to_let_go();
        self.programs_wait = true;
        self.stop_with(category, client, ticket);
    }

    /// A client ends the motion that it began.
    pub(super) fn end_motion(&mut self, client: Client, ticket: u64) {
        self.drop_waiting(|waiting| waiting.client == client && begins_motion(&waiting.kind));
        if self.has_begun_motion(client) {
            self.stop_with(StopCategory::RampAndHold, client, ticket);
        } else {
            self.answer(ticket, Answer::Done);
        }
    }

    /// Whether the motion that is under way, or was asked for in the last cycle, is a client's.
    pub(super) fn has_begun_motion(&self, client: Client) -> bool {
        let asked_now = self.asked.is_some_and(|(by, _, kind)| by == client && begins_motion(&kind));
        self.commander == Commander::Reference(client) || asked_now
    }

    /// The robot stopped by itself: because a command was too old, or for what a person must look at.
    pub(super) fn see_stop(&mut self, last: &CycleRecord) {
        let before = std::mem::replace(&mut self.stop_reason, last.stop_reason);
        let is_asked_anew = self.asked.is_some() && last.answer == RequestAnswer::Taken;
        let is_of_age = matches!(
            last.stop_reason,
            SafetyReason::None | SafetyReason::Requested | SafetyReason::CommandAge
        );
        self.programs_wait |= !is_of_age && (is_asked_anew || before != last.stop_reason);
    }

    /// Somebody stops an axis: what was asked of it before must not begin after it.
    pub(super) fn stop_axis(&mut self, device: u32, client: Client, ticket: u64) {
        self.drop_waiting(
            |waiting| matches!(waiting.kind, RequestKind::Axis { device: of, .. } if of == device),
        );
        match self.authors.stop(device, client, ticket) {
            Ok(Some(before)) => self.answer(before, Answer::Done),
            Ok(None) => {}
            Err(()) => self.answer(ticket, Answer::Robot(RequestAnswer::Refused)),
        }
    }

    /// The most severe stop counts.
    pub(super) fn stop_with(&mut self, category: StopCategory, client: Client, ticket: u64) {
        let asked = (category, client, ticket);
        let (kept, other) = match self.stop {
            Some(present) if present.0.severity() >= category.severity() => (present, Some(asked)),
            other => (asked, other),
        };
        self.stop = Some(kept);
        // Whoever asked for the gentler one gets the stronger.
        if let Some((_, _, ticket)) = other {
            self.answer(ticket, Answer::Done);
        }
    }

    pub(super) fn drop_waiting(&mut self, is_dropped: impl Fn(&Waiting) -> bool) {
        for _ in 0..self.waiting.len() {
            let Some(waiting) = self.waiting.pop_front() else { return };
            if is_dropped(&waiting) {
                self.refuse(waiting, Refusal::Stopped);
            } else {
                self.waiting.push_back(waiting);
            }
        }
    }
}
