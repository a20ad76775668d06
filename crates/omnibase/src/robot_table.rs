//! Tables of a robot's file as programs write them: each line with its reason, what nobody can know marked.

use crate::value::DataType;
use std::fmt::{Display, Write};

/// What stands before a line that a person must fill in.
pub const TO_FILL: &str = "FILL IN";
/// Column of the reasons, characters.
const REASONS: usize = 44;
/// Lines longer than this have their reason above.
const LONG: usize = 64;

/// A table that grows line by line.
#[derive(Clone, Debug, Default)]
pub struct RobotTable {
    text: String,
}

impl RobotTable {
    /// A comment over several lines.
    pub fn comment(&mut self, text: &str) {
        for line in text.lines() {
            let _ = writeln!(self.text, "# {}", one_line(line));
        }
    }

    /// The table's head, as `[[device]]`.
    pub fn head(&mut self, head: &str) {
        if !self.text.is_empty() {
            self.text.push('\n');
        }
        let _ = writeln!(self.text, "{head}");
    }

    /// A line and why it stands there: behind it, above it where it is long.
    pub fn line(&mut self, line: &str, reason: &str) {
        if reason.is_empty() {
            let _ = writeln!(self.text, "{line}");
            return;
        }
        if line.chars().count() > LONG {
            let indent: String = line.chars().take_while(|one| *one == ' ').collect();
            let _ = writeln!(self.text, "{indent}# {}\n{line}", one_line(reason));
            return;
        }
        let space = " ".repeat(REASONS.saturating_sub(line.chars().count()).max(1));
        let _ = writeln!(self.text, "{line}{space}# {}", one_line(reason));
    }

    /// A line that nobody but a person can fill in.
    pub fn left_to_fill(&mut self, line: &str, reason: &str) {
        self.line(&format!("# {line}"), &format!("{TO_FILL}: {reason}"));
    }

    /// Everything.
    pub fn text(&self) -> &str {
        &self.text
    }
}

/// The type of a signal of so many bits; `None` where no signal has them.
pub fn signal_type(bits: u8, data_type: DataType) -> Option<&'static str> {
    let is_signed = matches!(data_type, DataType::Signed(_));
    match (bits, is_signed, data_type) {
        (1, ..) => Some("bool"),
        (32, _, DataType::Real32) => Some("f32"),
        (0..=8, true, _) => Some("i8"),
        (0..=8, false, _) => Some("u8"),
        (9..=16, true, _) => Some("i16"),
        (9..=16, false, _) => Some("u16"),
        (17..=32, true, _) => Some("i32"),
        (17..=32, false, _) => Some("u32"),
        _ => None,
    }
}

/// What a signal in an array of bytes looks like.
pub fn in_array(name: &str, object: &str, bits: impl Display) -> String {
    format!(
        "{{ name = \"{name}\", object = \"{object}\", byte = 0, type = \"u8\" }}, one of {bits} bits: take the bytes that you need"
    )
}

/// Text of others on one line of a comment.
fn one_line(text: &str) -> String {
    text.chars().map(|one| if one.is_control() { ' ' } else { one }).collect()
}

/// A name as signals and SubDevices have: small letters, digits, underscores, at most 24, none of `taken`.
pub fn plain_name(text: &str, otherwise: &str, taken: &mut Vec<String>) -> String {
    let mut name = String::new();
    for letter in text.chars().flat_map(char::to_lowercase) {
        if letter.is_ascii_alphanumeric() {
            name.push(letter);
        } else if !name.is_empty() && !name.ends_with('_') {
            name.push('_');
        }
    }
    let starts_well = name.starts_with(|first: char| first.is_ascii_lowercase());
    if !starts_well {
        name = if name.is_empty() { otherwise.to_owned() } else { format!("{otherwise}_{name}") };
    }
    name.truncate(24);
    let name = name.trim_end_matches('_').to_owned();
    let mut unique = name.clone();
    let mut number = 2;
    while taken.contains(&unique) {
        let end = format!("_{number}");
        unique = format!("{}{end}", &name[..name.len().min(24 - end.len())]);
        number += 1;
    }
    taken.push(unique.clone());
    unique
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_plain_and_each_is_one() {
        let mut taken = vec!["age".to_owned()];
        let mut name = |text: &str| plain_name(text, "signal", &mut taken);
        assert_eq!(name("Ch 0: Data output valid"), "ch_0_data_output_valid");
        assert_eq!(name("Ch 0: Data output valid!"), "ch_0_data_output_valid_2");
        assert_eq!(name("IO-LINK slave output of the first channel"), "io_link_slave_output_of");
        assert_eq!(name("IO-LINK slave output of the last channel"), "io_link_slave_output_o_2");
        assert_eq!(
            (name("3 bits"), name("\u{e9}\u{e8}"), name("Age")),
            ("signal_3_bits".into(), "signal".into(), "age_2".into())
        );
    }

    #[test]
    fn a_reason_of_others_stays_in_its_comment() {
        let mut table = RobotTable::default();
        table.line("a = 1", "first\nenabled = true");
        assert_eq!(table.text().lines().count(), 1);
        assert!(table.text().parse::<toml::Table>().unwrap().len() == 1);
    }
}
