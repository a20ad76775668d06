//! A run as a text file of columns with a header line, as Kst and numpy read it.

use super::RunSchema;
use super::words::number;
use std::io::{self, BufRead, Write};

/// Writes one line a cycle; the first line names the columns, `time_s` first.
pub struct ColumnWriter<W: Write> {
    output: W,
    /// Which words of a row are counts.
    counts: Vec<bool>,
    line: String,
    /// Bytes written.
    length: u64,
}

/// The longest text of a value, as `-1.2345678901234567e-308`, and the space before it.
const LONGEST_VALUE: u64 = 25;
/// The longest text of a time.
const LONGEST_TIME: u64 = 24;

/// Why a row can't be written.
#[derive(Debug, thiserror::Error)]
pub enum ColumnError {
    /// A row has another number of values than the schema has signals.
    #[error("a row of {found} values, the schema has {expected} signals")]
    RowWidth {
        /// Signals of the schema.
        expected: usize,
        /// Values given.
        found: usize,
    },
    /// Writing failed.
    #[error(transparent)]
    Io(#[from] io::Error),
}

impl<W: Write> ColumnWriter<W> {
    /// Writes the header line: `time_s` and `topic.signal` for each signal, slashes as dots.
    pub fn create(mut output: W, schema: &RunSchema) -> io::Result<Self> {
        let mut line = String::from("time_s");
        for name in schema.names() {
            line.push(' ');
            line.push_str(&name);
        }
        line.push('\n');
        output.write_all(line.as_bytes())?;
        let length = line.len() as u64;
        Ok(ColumnWriter { output, counts: schema.counts(), line, length })
    }

    /// Bytes of the file, at most, where a row is written before.
    pub fn length_with_row(&self) -> u64 {
        self.length + LONGEST_TIME + LONGEST_VALUE * self.counts.len() as u64
    }

    /// Writes one cycle; every number is read back to the same bits (NaN as `nan`), and counts as the nearest one.
    pub fn write_row(&mut self, time_ns: u64, row: &[u64]) -> Result<(), ColumnError> {
        use std::fmt::Write;
        if row.len() != self.counts.len() {
            return Err(ColumnError::RowWidth { expected: self.counts.len(), found: row.len() });
        }
        self.line.clear();
        let _ = write!(self.line, "{}.{:09}", time_ns / 1_000_000_000, time_ns % 1_000_000_000);
        for (word, is_count) in row.iter().zip(&self.counts) {
            // Rust prints the shortest digits that read back to the same bits.
            let _ = write!(self.line, " {:e}", number(*word, *is_count));
        }
        self.line.push('\n');
        self.length += self.line.len() as u64;
        Ok(self.output.write_all(self.line.as_bytes())?)
    }

    /// Flushes and gives the output back.
    pub fn finish(mut self) -> io::Result<W> {
        self.output.flush()?;
        Ok(self.output)
    }
}

/// Complete rows of a column file, each as long as its header.
pub(super) fn complete_rows(mut input: impl BufRead) -> io::Result<u64> {
    let (mut line, mut width, mut rows) = (Vec::new(), None, 0);
    loop {
        line.clear();
        if input.read_until(b'\n', &mut line)? == 0 || line.last() != Some(&b'\n') {
            return Ok(rows);
        }
        let words = line.split(|byte| *byte == b' ').count();
        match width {
            None => width = Some(words),
            Some(width) if width == words => rows += 1,
            Some(_) => return Ok(rows),
        }
    }
}
