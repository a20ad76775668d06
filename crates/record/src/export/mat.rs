//! MATLAB's level 5 ("MAT-File Format", MathWorks): a header, then one matrix of doubles for each variable.

use super::{ExportError, column, times_s};
use crate::run::RecordedRun;
use std::collections::BTreeSet;
use std::io::{self, Write};

/// Data types of elements.
const INT8: u32 = 1;
const INT32: u32 = 5;
const UINT32: u32 = 6;
const DOUBLE: u32 = 9;
const MATRIX: u32 = 14;
/// The class of a matrix of doubles.
const CLASS_DOUBLE: u32 = 6;
/// The longest name of a variable.
const LONGEST_NAME: usize = 63;
/// A variable has to be shorter than 2 GiB.
const MOST_ROWS: usize = (i32::MAX as usize - 1024) / 8;

pub(super) fn write(run: &RecordedRun, mut output: impl Write) -> Result<(), ExportError> {
    let mut header = [b' '; 128];
    let text = b"MATLAB 5.0 MAT-file, written by omnibase";
    header[..text.len()].copy_from_slice(text);
    // No place of subsystem data; version 1; the order of the bytes.
    header[116..124].fill(0);
    header[124..].copy_from_slice(&[0x00, 0x01, b'I', b'M']);
    output.write_all(&header)?;
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
    variable(&mut output, "time_s", rows, times_s(run))?;
    for (number, name) in names.iter().enumerate() {
        variable(&mut output, name, rows, column(run, number))?;
    }
    Ok(output.flush()?)
}

/// Writes a column of doubles under a name.
fn variable(
    output: &mut impl Write,
    name: &str,
    rows: usize,
    values: impl Iterator<Item = f64>,
) -> io::Result<()> {
    // Fits: names and rows are bounded above.
    let (rows, name_bytes) = (rows as u32, name.len() as u32);
    let padded = name_bytes.next_multiple_of(8);
    let matrix = (8 + 8) + (8 + 8) + (8 + padded) + (8 + 8 * rows);
    let mut words = |words: &[u32]| words.iter().try_for_each(|word| output.write_all(&word.to_le_bytes()));
    words(&[MATRIX, matrix])?;
    words(&[UINT32, 8, CLASS_DOUBLE, 0])?;
    words(&[INT32, 8, rows, 1])?;
    words(&[INT8, name_bytes])?;
    output.write_all(name.as_bytes())?;
    output.write_all(&[0; 8][..(padded - name_bytes) as usize])?;
    for word in [DOUBLE, 8 * rows] {
        output.write_all(&word.to_le_bytes())?;
    }
    values.into_iter().try_for_each(|value| output.write_all(&value.to_le_bytes()))
}
