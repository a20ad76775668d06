//! What happened in a run, in words.

use std::fmt::{self, Write};
use std::ops::Deref;

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

/// Bytes that the words of one event may take.
const MOST_BYTES: usize = 230;

/// The words of an event in a room of their own, so that telling allocates nothing; what is longer is cut.
#[derive(Clone, Copy)]
pub struct Words {
    bytes: [u8; MOST_BYTES],
    length: u8,
}

impl Words {
    /// What `arguments` say.
    pub fn new(arguments: fmt::Arguments<'_>) -> Self {
        let mut words = Words { bytes: [0; MOST_BYTES], length: 0 };
        // Cut, not failed: an event that is too long still says who it is about.
        let _ = words.write_fmt(arguments);
        words
    }
}

impl Write for Words {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let start = usize::from(self.length);
        let end = text.floor_char_boundary(MOST_BYTES - start);
        self.bytes[start..start + end].copy_from_slice(&text.as_bytes()[..end]);
        self.length = (start + end) as u8;
        if end == text.len() { Ok(()) } else { Err(fmt::Error) }
    }
}

impl From<&str> for Words {
    fn from(text: &str) -> Self {
        Words::new(format_args!("{text}"))
    }
}

impl Deref for Words {
    type Target = str;

    fn deref(&self) -> &str {
        std::str::from_utf8(&self.bytes[..usize::from(self.length)]).unwrap_or_default()
    }
}

impl fmt::Display for Words {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self)
    }
}

impl fmt::Debug for Words {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&**self, f)
    }
}

impl PartialEq for Words {
    fn eq(&self, other: &Words) -> bool {
        **self == **other
    }
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
            Exchange::Without { .. } => "a SubDevice is away",
            Exchange::Restarted { .. } => "drives that started anew take part again",
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_that_are_too_long_are_cut_between_letters() {
        let words = Words::new(format_args!("{}{}", "x".repeat(MOST_BYTES - 1), "ä and more"));
        assert_eq!(words.len(), MOST_BYTES - 1);
        assert_eq!(&*Words::from("short"), "short");
    }
}
