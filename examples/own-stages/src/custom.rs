//! Settings of one's own stages: the `custom` table of a stage, checked while the stage is made.

use omnibase_robot::StageError;
use omnibase_robot::config::Parameters;
use std::ops::RangeInclusive;

/// One `custom` table, and where it stands, for messages.
#[derive(Clone, Copy, Debug)]
pub struct Custom<'a> {
    /// The table's full name, such as `controller.custom`.
    pub table: &'a str,
    /// What is in it.
    pub values: &'a Parameters,
}

impl Custom<'_> {
    /// A number that must be there and within its range.
    pub fn number(&self, key: &str, allowed: RangeInclusive<f64>) -> Result<f64, StageError> {
        let value = self.values.get(key).and_then(|value| value.as_f64());
        let value = value.ok_or_else(|| self.refused(key, "must be given: a number".into()))?;
        if !allowed.contains(&value) {
            let (low, high) = (allowed.start(), allowed.end());
            return Err(self.refused(key, format!("{value} is not within {low} to {high}")));
        }
        Ok(value)
    }

    /// Refuses a key that nobody reads: a slip of the pen would otherwise go unnoticed.
    pub fn only(&self, known: &[&str]) -> Result<(), StageError> {
        match self.values.keys().find(|key| !known.contains(&key.as_str())) {
            Some(key) => Err(self.refused(key, format!("unknown key; known are {}", known.join(", ")))),
            None => Ok(()),
        }
    }

    /// A refusal of one key.
    pub fn refused(&self, key: &str, reason: String) -> StageError {
        StageError::Refused { setting: format!("{}.{key}", self.table), reason }
    }
}
