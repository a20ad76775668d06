//! Ways that were planned for what was in the way then: whoever looks after one alone begins it, and nobody goes on with it.

use omnibase_robot::RequestKind;
use omnibase_robot::signals::CycleRecord;

use super::{Operator, Waiting};

impl Operator {
    /// Whether what is followed, or was left, and what is begun next is such a way.
    pub fn is_looked_after(&self, last: &CycleRecord) -> [bool; 2] {
        let is_so = |number: u64| number != 0 && self.looked_after.iter().any(|of| u64::from(*of) == number);
        [last.reference, last.reference_next].map(is_so)
    }

    /// Whether what waits would begin such a way, or go on with it, and comes from somebody else.
    pub(super) fn is_anothers_to_begin(&self, waiting: &Waiting, last: &CycleRecord) -> bool {
        let [is_present, is_next] = self.is_looked_after(last);
        !waiting.is_on_behalf
            && match waiting.kind {
                RequestKind::Track => is_next,
                RequestKind::Resume => is_present,
                _ => false,
            }
    }

    /// What somebody is loaded on behalf of is such a way; of those before those count that are in use.
    pub(super) fn look_after(&mut self, waiting: &Waiting, last: &CycleRecord) {
        let RequestKind::UseReference { number } = waiting.kind else { return };
        if waiting.is_on_behalf {
            let is_used = |of: &u32| [last.reference, last.reference_next].contains(&u64::from(*of));
            let mut used = self.looked_after.into_iter().filter(is_used);
            self.looked_after = [number, used.next().unwrap_or(0), used.next().unwrap_or(0)];
        }
    }
}
