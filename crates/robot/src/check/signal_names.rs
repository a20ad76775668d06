//! Names and units of signals beside the drives.

use super::Check;
use crate::config::ProblemKind;
use crate::signals::CycleRecord;

/// A part of a signal's name: both parts fit into a channel's name.
const LONGEST_NAME: usize = 24;
/// The longest unit, characters.
const LONGEST_UNIT: usize = 16;

/// Whether a name has small letters, digits and underscores alone.
fn is_plain_name(name: &str) -> bool {
    let is_plain = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_';
    !name.is_empty() && name.bytes().all(is_plain)
}

impl Check {
    /// The name of who has signals: recordings have a topic of this name.
    pub(super) fn topic_name(&mut self, name: Option<&str>, setting: &str) -> Option<String> {
        let name = self.signal_name(name, setting)?;
        if CycleRecord::topics().contains(&name) {
            let problem = self.report(ProblemKind::Duplicate, setting, "recordings call something else so");
            problem.value = Some(format!("\"{name}\""));
            problem.limit = Some("another name".into());
            return None;
        }
        Some(name)
    }

    /// The name of a signal, or of who has it.
    pub(super) fn signal_name(&mut self, name: Option<&str>, setting: &str) -> Option<String> {
        let name = self.need(name, setting, "its signals are called by it")?;
        if is_plain_name(name) && name.len() <= LONGEST_NAME {
            return Some(name.to_owned());
        }
        let problem = self.report(ProblemKind::OutOfRange, setting, "not a name that recordings can have");
        problem.value = Some(format!("\"{name}\""));
        problem.limit = Some(format!("1 to {LONGEST_NAME} small letters, digits and underscores"));
        None
    }

    /// The unit of a signal.
    pub(super) fn unit(&mut self, unit: Option<&str>, setting: &str) -> Option<String> {
        let unit = unit.unwrap_or_default();
        if unit.chars().count() <= LONGEST_UNIT && !unit.chars().any(char::is_control) {
            return Some(unit.to_owned());
        }
        let problem = self.report(
            ProblemKind::OutOfRange,
            setting,
            "a unit is a short text without control characters",
        );
        problem.value = Some(format!("\"{unit}\""));
        problem.limit = Some(format!("at most {LONGEST_UNIT} characters, such as \"V\" or \"°C\""));
        None
    }
}
