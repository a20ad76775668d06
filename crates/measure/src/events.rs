//! What happened in a run, in words.

use omnibase_robot::signals::{CycleRecord, Exchange, LimitedBy, Phase, SafetyReason};
use serde::Serialize;

/// Something that happened.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Event {
    /// Time of the run, s.
    pub time_s: f64,
    /// What happened.
    pub text: String,
}

/// Notices changes between one cycle and the next.
#[derive(Clone, Debug)]
pub struct Watch {
    phase: Phase,
    reason: SafetyReason,
    exchange: Exchange,
    /// What was told last of what holds the motion back, when that was, and when anything last did, ns.
    held_by: LimitedBy,
    told_ns: u64,
    held_ns: u64,
    pose_known: bool,
    /// When a drive's own limit last held it back, ns.
    limited_ns: Option<u64>,
}

/// So long nothing must have held the motion back before that is told, and so long passes between two that hold it, ns:
/// one who slides along a fence is not to be told so at each of its touches.
const FREE_NS: u64 = 1_000_000_000;

impl Default for Watch {
    fn default() -> Self {
        Watch {
            phase: Phase::Disabled,
            reason: SafetyReason::None,
            exchange: Exchange::Complete,
            held_by: LimitedBy::Nothing,
            told_ns: 0,
            held_ns: 0,
            pose_known: true,
            limited_ns: None,
        }
    }
}

impl Watch {
    /// What changed with this cycle, in words that cost no allocation; `phase` is that after it.
    pub fn look(&mut self, record: &CycleRecord, phase: Phase) -> [Option<&'static str>; 6] {
        // Every run ends by a stop; whoever asks for one earlier says so.
        let is_own = matches!(record.stop_reason, SafetyReason::None | SafetyReason::Requested);
        let reason = (record.stop_reason != self.reason && !is_own).then(|| record.stop_reason.text());
        let phase_change = (phase != self.phase).then(|| phase_words(phase));
        let came = |exchange| matches!(exchange, Exchange::Complete);
        let exchange = (came(record.exchange) != came(self.exchange)).then_some(match record.exchange {
            Exchange::Complete => "exchanges are complete again",
            Exchange::Lost => "an exchange was lost",
            Exchange::ShortCount { .. } => "a SubDevice took no part in an exchange",
            Exchange::Without { .. } => "a SubDevice is away",
            Exchange::Restarted { .. } => "drives that started anew take part again",
        });
        let held = self.held(record.guard.limited_by, record.time.now_ns);
        let pose_known = record.state.pose_known;
        let pose = (pose_known != self.pose_known).then_some(match pose_known {
            true => "the pose is known again",
            false => "the pose is unknown: a person sets it, or a sensor tells it, before a path is followed",
        });
        (self.phase, self.reason, self.exchange) = (phase, record.stop_reason, record.exchange);
        self.pose_known = pose_known;
        [exchange, pose, held, self.limited(record), reason, phase_change]
    }

    /// A drive began to be held back by a limit of its own, after a second without.
    fn limited(&mut self, record: &CycleRecord) -> Option<&'static str> {
        if !record.measurements.is_held_back() {
            return None;
        }
        let now_ns = record.time.now_ns;
        let before_ns = self.limited_ns.replace(now_ns);
        let is_new = before_ns.is_none_or(|before_ns| now_ns.saturating_sub(before_ns) > FREE_NS);
        is_new.then_some(
            "a limit of a drive's own holds it back (bit 11 of its status word): nothing is learnt meanwhile",
        )
    }

    /// What began to hold the motion back, or no longer does.
    fn held(&mut self, by: LimitedBy, now_ns: u64) -> Option<&'static str> {
        let since_ns = match (self.held_by, by) {
            (_, LimitedBy::Nothing) => self.held_ns,
            (LimitedBy::Nothing, _) => 0,
            _ => self.told_ns,
        };
        if by != LimitedBy::Nothing {
            self.held_ns = now_ns;
        }
        if by == self.held_by || (since_ns > 0 && now_ns.saturating_sub(since_ns) < FREE_NS) {
            return None;
        }
        (self.held_by, self.told_ns) = (by, now_ns);
        Some(match by {
            LimitedBy::Nothing => "neither fence nor obstacle holds the motion back any longer",
            LimitedBy::Fence => "the fence holds the motion back",
            LimitedBy::Obstacle => "an obstacle holds the motion back",
        })
    }
}

/// Codes of reasons to stop; one or the other isn't used any more.
const REASONS: std::ops::Range<u64> = 1..64;

/// Whether what happened, in these words, stops the robot: viewers show it as a warning.
pub fn is_stop(text: &str) -> bool {
    let phases = [Phase::Stopping, Phase::QuickStopping, Phase::Fault].map(phase_words);
    let reasons = REASONS.filter_map(SafetyReason::from_code).map(SafetyReason::text);
    phases.into_iter().chain(reasons).any(|words| words == text)
}

/// A phase in words.
pub fn phase_words(phase: Phase) -> &'static str {
    match phase {
        Phase::Disabled => "drives disabled",
        Phase::Enabling => "enabling the drives",
        Phase::Holding => "holding",
        Phase::Tracking => "tracking the reference",
        Phase::Stopping => "ramping down",
        Phase::QuickStopping => "quick stop",
        Phase::Fault => "stopped by a fault",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use omnibase_robot::signals::DriveProgress;

    /// What is told in a cycle of 1 ms.
    fn told(watch: &mut Watch, at_ms: u64, change: impl Fn(&mut CycleRecord)) -> Vec<&'static str> {
        let mut record =
            CycleRecord { phase: Phase::Tracking, exchange: Exchange::Complete, ..Default::default() };
        record.time.now_ns = at_ms * 1_000_000;
        change(&mut record);
        watch.look(&record, record.phase).into_iter().flatten().collect()
    }

    #[test]
    fn what_holds_a_motion_back_is_told_once_and_when_it_ends() {
        let mut watch = Watch::default();
        assert_eq!(told(&mut watch, 0, |_| {}), ["tracking the reference"]);
        let by = |by| move |record: &mut CycleRecord| record.guard.limited_by = by;
        assert_eq!(told(&mut watch, 10, by(LimitedBy::Fence)), ["the fence holds the motion back"]);
        // Sliding along it: now it holds, now it doesn't.
        let touches = [LimitedBy::Fence, LimitedBy::Nothing, LimitedBy::Obstacle];
        for at_ms in 11..1010 {
            assert!(told(&mut watch, at_ms, by(touches[at_ms as usize % 3])).is_empty(), "{at_ms}");
        }
        assert_eq!(told(&mut watch, 1010, by(LimitedBy::Obstacle)), ["an obstacle holds the motion back"]);
        assert!(told(&mut watch, 2009, |_| {}).is_empty());
        let free = ["neither fence nor obstacle holds the motion back any longer"];
        assert_eq!(told(&mut watch, 2010, |_| {}), free);
        assert!(told(&mut watch, 2011, |_| {}).is_empty());
        assert_eq!(told(&mut watch, 2012, by(LimitedBy::Fence)), ["the fence holds the motion back"]);
    }

    #[test]
    fn a_plan_that_led_out_of_the_fence_is_told_with_its_reason() {
        let mut watch = Watch::default();
        told(&mut watch, 0, |_| {});
        let stopping = |record: &mut CycleRecord| {
            record.guard.limited_by = LimitedBy::Fence;
            (record.stop_reason, record.phase) = (SafetyReason::Fence, Phase::Stopping);
        };
        let expected = ["the fence holds the motion back", "the way led out of the fence", "ramping down"];
        assert_eq!(told(&mut watch, 1, stopping), expected);
        assert!(told(&mut watch, 2, stopping).is_empty());
    }

    #[test]
    fn every_stop_is_one_by_its_words_and_nothing_else_is() {
        let reasons = REASONS.filter_map(SafetyReason::from_code).map(SafetyReason::text);
        assert!(reasons.chain(["ramping down", "quick stop", "stopped by a fault"]).all(is_stop));
        assert_eq!(SafetyReason::Fence.text(), "the way led out of the fence");
        assert!(is_stop("the way led out of the fence"));
        let others = ["none", "holding", "drives disabled", "the pose is known again", ""];
        assert!(!others.into_iter().any(is_stop));
    }

    #[test]
    fn a_drives_own_limit_is_told_once_until_it_was_gone_for_a_second() {
        let mut watch = Watch::default();
        told(&mut watch, 0, |_| {});
        let limited = |record: &mut CycleRecord| {
            record.measurements.wheels = 3;
            record.measurements.drives[1].progress = DriveProgress::Running;
            record.measurements.drives[1].status.0 = 0x0A37;
        };
        assert_eq!(told(&mut watch, 10, limited).len(), 1);
        assert_eq!(told(&mut watch, 20, limited), Vec::<&str>::new());
        assert_eq!(told(&mut watch, 1000, |_| {}), Vec::<&str>::new());
        assert_eq!(told(&mut watch, 1015, limited), Vec::<&str>::new());
        assert_eq!(told(&mut watch, 2100, limited).len(), 1);
    }
}
