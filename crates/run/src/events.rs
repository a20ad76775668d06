//! What happened in a run, in words.

use omnibase_robot::signals::{CycleRecord, Exchange, Phase, SafetyReason};
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
}

impl Default for Watch {
    fn default() -> Self {
        Watch { phase: Phase::Disabled, reason: SafetyReason::None, exchange: Exchange::Complete }
    }
}

impl Watch {
    /// What changed with this cycle, in words that cost no allocation; `phase` is that after it.
    pub fn look(&mut self, record: &CycleRecord, phase: Phase) -> [Option<&'static str>; 3] {
        // Every run ends by a stop; whoever asks for one earlier says so.
        let is_own = matches!(record.stop_reason, SafetyReason::None | SafetyReason::Requested);
        let reason = (record.stop_reason != self.reason && !is_own).then(|| record.stop_reason.text());
        let phase_change = (phase != self.phase).then(|| phase_words(phase));
        let came = |exchange| matches!(exchange, Exchange::Complete);
        let exchange = (came(record.exchange) != came(self.exchange)).then_some(match record.exchange {
            Exchange::Complete => "exchanges are complete again",
            Exchange::Lost => "an exchange was lost",
            Exchange::ShortCount { .. } => "a SubDevice took no part in an exchange",
        });
        *self = Watch { phase, reason: record.stop_reason, exchange: record.exchange };
        [exchange, reason, phase_change]
    }
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
