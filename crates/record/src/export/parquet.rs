//! Apache Parquet: required doubles, in groups of rows.

use super::{ExportError, column, times_s};
use crate::run::RecordedRun;
use ::parquet::basic::{Repetition, Type as PhysicalType};
use ::parquet::data_type::DoubleType;
use ::parquet::file::properties::WriterProperties;
use ::parquet::file::writer::SerializedFileWriter;
use ::parquet::schema::types::Type;
use std::io::Write;
use std::sync::Arc;

/// Rows of a group.
const GROUP: usize = 1 << 20;

pub(super) fn write(run: &RecordedRun, output: impl Write + Send) -> Result<(), ExportError> {
    let field = |name: &str| {
        let field = Type::primitive_type_builder(name, PhysicalType::DOUBLE);
        Ok(Arc::new(field.with_repetition(Repetition::REQUIRED).build()?))
    };
    let names = ["time_s".to_owned()].into_iter().chain(run.schema.names());
    let fields: Result<Vec<_>, ExportError> = names.map(|name| field(&name)).collect();
    let schema = Arc::new(Type::group_type_builder("run").with_fields(fields?).build()?);
    // Numbers that hardly repeat need no dictionary.
    let properties = WriterProperties::builder().set_dictionary_enabled(false).build();
    let mut writer = SerializedFileWriter::new(output, schema, Arc::new(properties))?;
    let rows = run.times_ns.len();
    for begin in (0..rows.max(1)).step_by(GROUP) {
        let count = GROUP.min(rows - begin);
        let mut group = writer.next_row_group()?;
        let mut number = 0;
        while let Some(mut output) = group.next_column()? {
            let values: Vec<f64> = match number {
                0 => times_s(run).skip(begin).take(count).collect(),
                number => column(run, number - 1).skip(begin).take(count).collect(),
            };
            output.typed::<DoubleType>().write_batch(&values, None, None)?;
            output.close()?;
            number += 1;
        }
        group.close()?;
    }
    writer.close()?;
    Ok(())
}
