//! The recording of a run: every signal of every cycle, as MCAP and as a column file, and reading it back.
//!
//! The recorder knows no robot. A run is a table: [`RunSchema`] names the columns, grouped in topics; each cycle is
//! one row of exact words, numbers and counts, from which the cycle can be replayed; beside them events in words.

mod columns;
mod mcap_file;
pub(crate) mod protobuf;
mod recorded;
mod recorder;
mod selection;
mod series;
mod words;
mod writers;

pub use columns::{ColumnError, ColumnWriter};
pub(crate) use mcap_file::message_name;
pub use mcap_file::{BEGUN, McapRun, RunError};
pub use recorded::{Keep, RecordedRow, RecordedRun};
pub use recorder::{OnFull, RecorderError, RunDescriber, RunFiles, RunRecorded, RunRecorder, RunSink};
pub use selection::{Due, SELECTION, Selection, fits};
pub use series::{FILE_NUMBER, Rotation};
pub use words::Word;

/// One column: a number per cycle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Signal {
    /// Name with its unit, in letters, digits and underscores: `wheel_speed_rad_s`.
    pub name: String,
}

/// Signals that belong together and are shown together: `/platform/believed`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Path of the topic.
    pub name: String,
    /// Its signals.
    pub signals: Vec<Signal>,
}

/// The columns of a run, in the order in which a row gives their values.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunSchema {
    /// Topics; a row holds the values of the first topic's signals, then the second's, and so on.
    pub topics: Vec<Topic>,
    /// What the words are, of 8 bytes, that replay a row; nothing where they aren't told of.
    pub words: Vec<Word>,
}

impl RunSchema {
    /// Numbers in a row.
    pub fn width(&self) -> usize {
        self.topics.iter().map(|topic| topic.signals.len()).sum()
    }

    /// Of each place of a row, whether its word is a count; of the others it is the bits of a number.
    pub(crate) fn counts(&self) -> Vec<bool> {
        let mut counts = vec![false; self.width()];
        for word in &self.words {
            if let Word::Count(place) = *word
                && let Some(is_count) = counts.get_mut(place)
            {
                *is_count = true;
            }
        }
        counts
    }

    /// Appends a topic.
    pub fn push<N: Into<String>>(&mut self, topic: &str, signals: impl IntoIterator<Item = N>) {
        let signals = signals.into_iter().map(|name| Signal { name: name.into() }).collect();
        self.topics.push(Topic { name: topic.to_owned(), signals });
    }

    /// The position in a row of `signal` in `topic`.
    pub fn column(&self, topic: &str, signal: &str) -> Option<usize> {
        let mut at = 0;
        for candidate in &self.topics {
            if candidate.name == topic {
                let within = candidate.signals.iter().position(|found| found.name == signal)?;
                return Some(at + within);
            }
            at += candidate.signals.len();
        }
        None
    }
}

/// Something that happened, in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunEvent {
    /// Time of the run, ns.
    pub time_ns: u64,
    /// What happened.
    pub text: String,
}
