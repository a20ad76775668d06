//! Is this machine fit for hard real time? What was found, why it matters, and what mends it.
//!
//! [`examine`] reads `/proc` and `/sys` (below a root of the caller's choice, so that a made-up tree can be examined)
//! and takes what the network interface says of itself as data. [`Mend::apply`] changes one thing and gives back how
//! to undo it. Nothing here prints.

mod kernel;
mod machine;
mod mend;
mod network;
mod pauses;
mod processors;
mod rights;
#[cfg(test)]
mod tests;

pub use machine::Machine;
pub use mend::{Change, Mend, MendError, NicSetting};
pub use network::Nic;
pub use pauses::pauses;

/// How good a finding is for a cycle of a millisecond and less.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// As it should be.
    Good,
    /// The machine doesn't say.
    Unknown,
    /// Cycles will now and then be late.
    Degraded,
    /// Cycles will be late as a rule, or nothing runs at all.
    Bad,
}

impl Verdict {
    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Good => "good",
            Verdict::Unknown => "unknown",
            Verdict::Degraded => "degraded",
            Verdict::Bad => "bad",
        }
    }
}

/// One thing that was looked at.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// What was looked at; the same name in every run.
    pub check: &'static str,
    /// How good it is.
    pub verdict: Verdict,
    /// What was found.
    pub found: String,
    /// Why it matters.
    pub why: &'static str,
    /// What mends it, where it isn't good and something does.
    pub remedy: Option<Remedy>,
}

/// What mends a finding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Remedy {
    /// The command, or the kernel option, as a person types it.
    pub command: String,
    /// Whether a program may do it unasked for details.
    pub how: How,
}

/// Who may mend it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum How {
    /// A person: it needs a reboot, a decision, or another machine; the reason.
    ByHand(&'static str),
    /// These changes, each of which can be undone; they last until the next boot.
    Now(Vec<Mend>),
    /// Nothing outlasts the program that asks for it: a run does it by itself.
    WhileRunning,
}

impl Finding {
    fn good(check: &'static str, why: &'static str, found: impl Into<String>) -> Self {
        Finding { check, verdict: Verdict::Good, found: found.into(), why, remedy: None }
    }

    fn unknown(check: &'static str, why: &'static str, found: impl Into<String>) -> Self {
        Finding { verdict: Verdict::Unknown, ..Finding::good(check, why, found) }
    }

    fn degraded(check: &'static str, why: &'static str, found: impl Into<String>) -> Self {
        Finding { verdict: Verdict::Degraded, ..Finding::good(check, why, found) }
    }

    fn bad(check: &'static str, why: &'static str, found: impl Into<String>) -> Self {
        Finding { verdict: Verdict::Bad, ..Finding::good(check, why, found) }
    }

    fn mended(self, command: impl Into<String>, how: How) -> Self {
        Finding { remedy: Some(Remedy { command: command.into(), how }), ..self }
    }
}

/// What is wrong with the segment at the interface, in words that say what to do.
pub fn segment_trouble(words: String) -> Finding {
    let why = "what is wrong with a cable or a device costs frames, and frames are cycles";
    let by_hand = How::ByHand("it is a cable, a supply or a device");
    Finding::degraded("segment", why, words).mended("what it says", by_hand)
}

/// What of the segment at the interface can't be set up, and why.
pub fn not_set_up(words: String) -> Finding {
    let by_hand = How::ByHand("it is a device, its supply or its firmware");
    Finding::bad("segment", "what isn't set up takes part in no cycle", words).mended("what it says", by_hand)
}

/// That nothing of the segment at the interface could be seen, and why.
pub fn no_segment(words: String) -> Finding {
    let by_hand = How::ByHand("it is a cable, a supply, or another program on the interface");
    Finding::bad("segment", "without a segment there is nothing to move", words)
        .mended("what it says", by_hand)
}

/// What isn't supported of the segment at the interface, and lacks nowhere.
pub fn segment_note(words: String) -> Finding {
    Finding::good("segment", "what isn't supported here is for its maker's tools", words)
}

/// Which cycle the segment's frames fit into.
pub fn segment_cycle(words: String) -> Finding {
    let why = "a cycle within which its frames can't be back loses each of them";
    Finding::good("shortest cycle", why, words)
}

/// Looks at everything: the kernel, the processors, the rights of this program, and `nic` where one is given.
pub fn examine(machine: &Machine, nic: Option<&Nic>) -> Vec<Finding> {
    let mut findings = kernel::examine(machine);
    findings.extend(processors::examine(machine));
    findings.extend(rights::examine(machine));
    if let Some(nic) = nic {
        findings.extend(network::examine(machine, nic));
    }
    findings
}

/// The worst of all; `Good` without findings. What the machine doesn't say counts less than what is known to be wrong.
pub fn worst(findings: &[Finding]) -> Verdict {
    findings.iter().map(|finding| finding.verdict).max().unwrap_or(Verdict::Good)
}
