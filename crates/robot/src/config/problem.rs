//! What is wrong with a file, and where.

use std::fmt;
use std::ops::Range;

/// A place in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Location {
    /// File that the setting names, where it isn't the robot's file itself.
    pub file: Option<String>,
    /// Bytes of the text.
    pub span: Range<usize>,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
}

/// Sorts of problems.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProblemKind {
    /// The text isn't TOML.
    Syntax,
    /// A table's header isn't TOML: what follows it belongs to nobody knows what.
    Header,
    /// No setting has this name.
    UnknownKey,
    /// The setting exists, with another unit.
    WrongUnit,
    /// The value has another type.
    WrongType,
    /// The setting must be given.
    Missing,
    /// The value is outside its limits.
    OutOfRange,
    /// No choice has this name.
    UnknownName,
    /// Two settings claim the same.
    Duplicate,
    /// Settings that contradict one another.
    Contradiction,
    /// A file that a setting names couldn't be read.
    File,
}

/// One problem: the setting, its value, the limit, the reason, and the place.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// Sort.
    pub kind: ProblemKind,
    /// The setting by its full name, as `drive[1].position`.
    pub setting: String,
    /// Its value as written.
    pub value: Option<String>,
    /// What would be allowed.
    pub limit: Option<String>,
    /// Why it is refused.
    pub reason: String,
    /// Where it stands; for what is missing: where its table stands.
    pub place: Option<Location>,
}

impl Problem {
    /// A problem of a setting, without value, limit and place.
    pub fn new(kind: ProblemKind, setting: impl Into<String>, reason: impl fmt::Display) -> Self {
        let (setting, reason) = (setting.into(), reason.to_string());
        Problem { kind, setting, value: None, limit: None, reason, place: None }
    }

    /// A value that a stage refuses.
    pub fn refused(setting: impl Into<String>, reason: impl fmt::Display) -> Self {
        Problem::new(ProblemKind::OutOfRange, setting, reason)
    }

    /// A setting that must be there, and why.
    pub fn missing(setting: impl Into<String>, why: impl fmt::Display) -> Self {
        Problem::new(ProblemKind::Missing, setting, format_args!("must be given: {why}"))
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(place) = &self.place {
            if let Some(file) = &place.file {
                write!(f, "{file}:")?;
            }
            write!(f, "{}:{}: ", place.line, place.column)?;
        }
        write!(f, "{}", self.setting)?;
        if let Some(value) = &self.value {
            write!(f, " = {value}")?;
        }
        write!(f, ": {}", self.reason)?;
        if let Some(limit) = &self.limit {
            write!(f, " (allowed: {limit})")?;
        }
        Ok(())
    }
}
