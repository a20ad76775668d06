//! Stops of the robot and of its axes, and what must not begin after them.

use omnibase_robot::RequestKind;
use omnibase_robot::signals::{RequestAnswer, StopCategory};

use super::super::command::{Answer, Client, Refusal};
use super::{Operator, Waiting};

impl Operator {
    /// Somebody stops the robot: it stays so, whoever holds a stick.
    pub(super) fn stop_asked(&mut self, category: StopCategory, client: Client, ticket: u64) {
        self.ask_to_let_go();
        self.stop_with(category, client, ticket);
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
