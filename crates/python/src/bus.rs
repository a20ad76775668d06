//! What is at a bus, its objects, and an exchange with it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use omnibase::bus::{self, Exchange, Segment, SubDevice};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes};
use serde_json::Value;

use crate::failure::Failure;

/// Between two looks whether somebody pressed Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);

/// JSON as Python's own objects.
fn python<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (value.to_string(),))
}

/// Does something that waits for a bus while Python goes on.
fn waiting<T: Send>(py: Python<'_>, work: impl FnOnce() -> Result<T, String> + Send) -> PyResult<T> {
    Ok(py.detach(work).map_err(Failure::Broken)?)
}

#[pyfunction]
#[pyo3(signature = (target, *, dictionary=false, force=false))]
pub fn scan<'py>(
    py: Python<'py>,
    target: &str,
    dictionary: bool,
    force: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let found = waiting(py, || bus::scan(Segment { target, force }, dictionary))?;
    python(py, &found["subdevices"])
}

/// An object's value; bytes where its type is none of a number or text.
fn value<'py>(py: Python<'py>, object: &Value) -> PyResult<Bound<'py, PyAny>> {
    if object["type"] == "hex" {
        let hex = object["data"].as_str().unwrap_or_default();
        return py.get_type::<PyBytes>().call_method1("fromhex", (hex,));
    }
    python(py, &object["value"])
}

#[pyfunction]
#[pyo3(signature = (target, position, object, *, r#type=None, force=false))]
pub fn sdo_read<'py>(
    py: Python<'py>,
    target: &str,
    position: u16,
    object: &str,
    r#type: Option<&str>,
    force: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let of = SubDevice { segment: Segment { target, force }, position, data_type: r#type };
    value(py, &waiting(py, || bus::sdo_read(of, object))?)
}

#[pyfunction]
#[pyo3(signature = (target, position, object, value, *, r#type=None, force=false))]
pub fn sdo_write(
    py: Python<'_>,
    target: &str,
    position: u16,
    object: &str,
    value: &Bound<'_, PyAny>,
    r#type: Option<&str>,
    force: bool,
) -> PyResult<()> {
    let (text, data_type): (String, _) = if let Ok(bytes) = value.cast::<PyBytes>() {
        (bytes.call_method0("hex")?.extract()?, Some("hex"))
    } else if let Ok(truth) = value.cast::<PyBool>() {
        (u8::from(truth.is_true()).to_string(), r#type)
    } else {
        (value.str()?.to_string(), r#type)
    };
    let of = SubDevice { segment: Segment { target, force }, position, data_type };
    waiting(py, || bus::sdo_write(of, object, &text)).map(drop)
}

#[pyfunction]
#[pyo3(signature = (target, *, cycles=10_000, cycle_us=1000.0, dc=false, force=false))]
pub fn exchange<'py>(
    py: Python<'py>,
    target: &str,
    cycles: u64,
    cycle_us: f64,
    dc: bool,
    force: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let (stop, wanted) = (AtomicBool::new(false), Exchange { cycle_us, cycles, dc });
    let exchanged = std::thread::scope(|scope| {
        let thread = scope.spawn(|| bus::exchange(Segment { target, force }, wanted, &stop));
        let mut pressed = Ok(());
        while !thread.is_finished() {
            py.detach(|| std::thread::sleep(LOOK));
            if let Err(interrupt) = py.check_signals() {
                // The segment goes back to INIT first.
                stop.store(true, Ordering::Relaxed);
                pressed = Err(interrupt);
            }
        }
        let ended = py.detach(|| thread.join());
        pressed?;
        let ended = ended.map_err(|_| Failure::of("the thread of the exchange died"))?;
        Ok::<_, PyErr>(ended.map_err(Failure::Broken)?)
    })?;
    python(py, &exchanged)
}
