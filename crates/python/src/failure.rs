//! What goes wrong, as exceptions in the product's own words.

use pyo3::PyErr;
use pyo3::create_exception;
use pyo3::exceptions::PyException;

create_exception!(omnibase, Error, PyException, "Something went wrong: what, where, expected, found.");
create_exception!(omnibase, Refused, Error, "The robot refused what was asked of it.");

/// What went wrong, before Python hears of it.
#[derive(Debug)]
pub enum Failure {
    /// In general.
    Broken(String),
    /// The robot refused.
    Refused(String),
    /// What the user's own control law raised.
    Raised(PyErr),
}

impl Failure {
    /// An error in its own words.
    pub fn of(error: impl std::fmt::Display) -> Self {
        Failure::Broken(error.to_string())
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Broken(words) => Error::new_err(words),
            Failure::Refused(words) => Refused::new_err(words),
            Failure::Raised(error) => error,
        }
    }
}
