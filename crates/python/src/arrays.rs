//! Numbers from and to numpy, by their bytes: the package index has numpy for every Python, no crate is needed for it.

use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyBytes};

use crate::failure::Failure;

/// Numbers as an array of this shape, which Python may write to.
pub fn array<'py>(py: Python<'py>, values: &[f64], shape: &[usize]) -> PyResult<Bound<'py, PyAny>> {
    let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_ne_bytes()).collect();
    let flat = py.import("numpy")?.call_method1("frombuffer", (PyByteArray::new(py, &bytes), "float64"))?;
    flat.call_method1("reshape", (shape.to_vec(),))
}

/// The numbers of anything that numpy takes for an array of so many rows of so many numbers.
pub fn rows<const N: usize>(values: &Bound<'_, PyAny>, name: &str, count: usize) -> PyResult<Vec<[f64; N]>> {
    let array = values.py().import("numpy")?.call_method1("ascontiguousarray", (values, "float64"))?;
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    if shape != [count, N] {
        let words = format!("{name}: expected an array of shape ({count}, {N}), found {shape:?}");
        return Err(Failure::Broken(words).into());
    }
    let bytes = array.call_method0("tobytes")?.cast_into::<PyBytes>()?;
    let value = |bytes: &[u8]| bytes.try_into().map_or(f64::NAN, f64::from_ne_bytes);
    let row = |bytes: &[u8]| std::array::from_fn(|at| value(&bytes[8 * at..8 * (at + 1)]));
    Ok(bytes.as_bytes().chunks_exact(8 * N).map(row).collect())
}
