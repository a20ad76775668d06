//! What was recorded of a run.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::PathBuf;

use omnibase_record::run::{Keep, RecordedRun};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::array;
use crate::failure::Failure;
use crate::simulated::columns;

/// A run read back from its MCAP file.
#[pyclass(frozen, module = "omnibase")]
pub struct Recording(RecordedRun);

impl Recording {
    /// These columns of all rows, row by row.
    fn chosen(&self, columns: &[usize]) -> Vec<f64> {
        let rows = self.0.values.chunks_exact(self.0.schema.width().max(1));
        rows.flat_map(|row| columns.iter().map(|&column| row[column])).collect()
    }
}

#[pymethods]
impl Recording {
    #[new]
    fn new(py: Python<'_>, file: PathBuf) -> PyResult<Self> {
        let run = py.detach(|| {
            let wrong =
                |error: &dyn std::fmt::Display| Failure::of(format_args!("{}: {error}", file.display()));
            let input = File::open(&file).map_err(|error| wrong(&error))?;
            RecordedRun::read_from(input, Keep::Signals(|_, _, _| true)).map_err(|error| wrong(&error))
        });
        Ok(Recording(run?))
    }

    fn __len__(&self) -> usize {
        self.0.times_ns.len()
    }

    #[getter]
    fn signals(&self) -> Vec<String> {
        self.0.schema.names().collect()
    }

    fn __getitem__<'py>(&self, py: Python<'py>, signal: &str) -> PyResult<Bound<'py, PyAny>> {
        let column = columns(&self.0.schema, &[signal.to_owned()])?;
        if column.len() != 1 {
            let words = format!("`{signal}`: expected one signal, found {}", column.len());
            return Err(Failure::Broken(words).into());
        }
        let values = py.detach(|| self.chosen(&column));
        array(py, &values, &[values.len()])
    }

    /// These signals, a row a cycle.
    fn values<'py>(&self, py: Python<'py>, signals: Vec<String>) -> PyResult<Bound<'py, PyAny>> {
        let columns = columns(&self.0.schema, &signals)?;
        let values = py.detach(|| self.chosen(&columns));
        array(py, &values, &[self.0.times_ns.len(), columns.len()])
    }

    /// A table of pandas by the time in s, with these signals, or all of them.
    #[pyo3(signature = (signals=None))]
    fn to_pandas<'py>(&self, py: Python<'py>, signals: Option<Vec<String>>) -> PyResult<Bound<'py, PyAny>> {
        let signals = signals.unwrap_or_else(|| vec!["*".to_owned()]);
        let names: Vec<String> = self.0.schema.names().collect();
        let chosen = columns(&self.0.schema, &signals)?.into_iter().map(|column| names[column].clone());
        let pandas = py.import("pandas")?;
        let arguments = PyDict::new(py);
        arguments.set_item("columns", chosen.collect::<Vec<_>>())?;
        let index = PyDict::new(py);
        index.set_item("name", "time_s")?;
        arguments.set_item("index", pandas.getattr("Index")?.call((self.times_s(py)?,), Some(&index))?)?;
        pandas.getattr("DataFrame")?.call((self.values(py, signals)?,), Some(&arguments))
    }

    /// When each row was.
    #[getter]
    fn times_s<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let times: Vec<f64> = self.0.times_ns.iter().map(|ns| *ns as f64 * 1e-9).collect();
        array(py, &times, &[times.len()])
    }

    /// What happened: when, and what in words.
    #[getter]
    fn events(&self) -> Vec<(f64, String)> {
        self.0.events.iter().map(|event| (event.time_ns as f64 * 1e-9, event.text.clone())).collect()
    }

    /// What the run is described by: the robot's file and more.
    #[getter]
    fn description(&self) -> BTreeMap<String, String> {
        self.0.description.clone()
    }

    /// Where the file breaks off, in words; all before is there.
    #[getter]
    fn truncated(&self) -> Option<String> {
        self.0.truncated.clone()
    }
}
