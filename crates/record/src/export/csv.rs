//! Values separated by commas (RFC 4180); names and numbers need no quotes.

use crate::run::RecordedRun;
use std::io::{self, Write};

pub(super) fn write(run: &RecordedRun, mut output: impl Write) -> io::Result<()> {
    write!(output, "time_s")?;
    for name in run.schema.names() {
        write!(output, ",{name}")?;
    }
    let rows = run.values.chunks_exact(run.schema.width().max(1));
    for (time_ns, row) in run.times_ns.iter().zip(rows) {
        write!(output, "\r\n{}.{:09}", time_ns / 1_000_000_000, time_ns % 1_000_000_000)?;
        for value in row {
            // Rust prints the shortest digits that read back to the same bits.
            write!(output, ",{value:e}")?;
        }
    }
    output.write_all(b"\r\n")?;
    output.flush()
}
