//! Values separated by commas (RFC 4180), with a header line.

use super::ExportError;
use crate::run::RecordedRun;
use ::csv::{Terminator, WriterBuilder};
use std::io::Write;

pub(super) fn write(run: &RecordedRun, output: impl Write) -> Result<(), ExportError> {
    let mut writer = WriterBuilder::new().terminator(Terminator::CRLF).from_writer(output);
    let names = ["time_s".to_owned()].into_iter().chain(run.schema.names());
    writer.write_record(names)?;
    let rows = run.values.chunks_exact(run.schema.width().max(1));
    for (time_ns, row) in run.times_ns.iter().zip(rows) {
        writer.write_field(format!("{}.{:09}", time_ns / 1_000_000_000, time_ns % 1_000_000_000))?;
        for value in row {
            // Rust prints the shortest digits that read back to the same bits.
            writer.write_field(format!("{value:e}"))?;
        }
        writer.write_record(None::<&[u8]>)?;
    }
    Ok(writer.flush()?)
}
