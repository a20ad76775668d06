//! A run, or some of its signals, as a table for other programs: CSV, Parquet, and MATLAB's format.

mod csv;
mod mat;
mod parquet;

use crate::run::RecordedRun;
use std::io::{self, Write};
use std::path::Path;

/// Formats of tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableFormat {
    /// Values separated by commas, with a header line.
    Csv,
    /// Apache Parquet, all columns of doubles.
    Parquet,
    /// MATLAB's level 5, one variable for each column.
    Mat,
}

impl TableFormat {
    /// The one that a file's name ends with.
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "csv" => Some(TableFormat::Csv),
            "parquet" => Some(TableFormat::Parquet),
            "mat" => Some(TableFormat::Mat),
            _ => None,
        }
    }
}

/// Why a run can't be written as a table.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// Writing failed.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The CSV library refuses.
    #[error("CSV: {0}")]
    Csv(#[from] ::csv::Error),
    /// The library for MATLAB's format refuses.
    #[error("MAT: {0}")]
    Mat(#[from] mat5::Error),
    /// The Parquet library refuses.
    #[error("Parquet: {0}")]
    Parquet(#[from] ::parquet::errors::ParquetError),
    /// A variable would be longer than the format allows.
    #[error(
        "`{name}` of {rows} rows is longer than a variable of this format may be: expected at most {most} rows"
    )]
    TooLong {
        /// The variable.
        name: String,
        /// Its rows.
        rows: usize,
        /// The most there may be.
        most: usize,
    },
    /// A name that MATLAB doesn't know as one, or that another signal has too.
    #[error(
        "`{0}` can't be the name of a variable: expected others than those before it, of 63 characters at most"
    )]
    Name(String),
}

/// Writes the table of a run: its times in s as `time_s`, then every signal that was kept of it.
pub fn write(run: &RecordedRun, format: TableFormat, output: impl Write + Send) -> Result<(), ExportError> {
    match format {
        TableFormat::Csv => csv::write(run, output),
        TableFormat::Parquet => parquet::write(run, output),
        TableFormat::Mat => mat::write(run, output),
    }
}

/// The times of a run in s, each the double nearest to it.
fn times_s(run: &RecordedRun) -> impl Iterator<Item = f64> + '_ {
    run.times_ns.iter().map(|time_ns| *time_ns as f64 / 1e9)
}

/// One column of a run's values.
fn column(run: &RecordedRun, column: usize) -> impl Iterator<Item = f64> + '_ {
    run.values.chunks_exact(run.schema.width().max(1)).map(move |row| row[column])
}
