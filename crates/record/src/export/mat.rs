//! MATLAB's level 5: one matrix of doubles for each variable, compressed.

use super::{ExportError, column, times_s};
use crate::run::RecordedRun;
use mat5::{DenseMatrix, MatFile, Matrix, Values};
use std::collections::BTreeSet;
use std::io::Write;

/// The longest name of a variable.
const LONGEST_NAME: usize = 63;
/// A variable has to be shorter than 2 GiB.
const MOST_ROWS: usize = (i32::MAX as usize - 1024) / 8;
/// What stands before the first variable of a file, bytes.
const HEADER: usize = 128;

pub(super) fn write(run: &RecordedRun, mut output: impl Write) -> Result<(), ExportError> {
    let names: Vec<String> = run.schema.names().map(|name| name.replace('.', "_")).collect();
    let mut known = BTreeSet::from(["time_s"]);
    for name in &names {
        if name.len() > LONGEST_NAME || !known.insert(name) {
            return Err(ExportError::Name(name.clone()));
        }
    }
    let rows = run.times_ns.len();
    if rows > MOST_ROWS {
        return Err(ExportError::TooLong { name: "time_s".to_owned(), rows, most: MOST_ROWS });
    }
    output.write_all(&file_of("time_s", times_s(run))?)?;
    // One variable at a time: what follows the header of a file of one continues any other.
    for (number, name) in names.iter().enumerate() {
        output.write_all(&file_of(name, column(run, number))?[HEADER..])?;
    }
    Ok(output.flush()?)
}

/// A whole file of one variable, a column of doubles.
fn file_of(name: &str, values: impl Iterator<Item = f64>) -> Result<Vec<u8>, ExportError> {
    let values: Vec<f64> = values.collect();
    let matrix = Matrix::Dense(DenseMatrix { rows: values.len(), cols: 1, values: Values::F64(values) });
    let mut file = MatFile::single(name, matrix);
    file.header_text = "MATLAB 5.0 MAT-file, written by omnibase".to_owned();
    Ok(file.write_bytes()?)
}
