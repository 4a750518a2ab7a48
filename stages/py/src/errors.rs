//! Errors of the program as exceptions of Python, and a fence for panics between the two.

use contract::{Error, Kind, fence};
use pyo3::prelude::*;
use std::error::Error as _;

/// The exception for an error: a class of `stillpoint._errors` with message, place, cause and way
/// out.
pub(crate) fn raised(py: Python<'_>, error: &Error) -> PyErr {
    let name = match error.kind() {
        Kind::Usage => "UsageError",
        Kind::BadInput => "BadInputError",
        Kind::Unsupported => "UnsupportedError",
        Kind::OverBudget => "LimitError",
        Kind::Cancelled => "Interrupted",
        Kind::Io => "AccessError",
        _ => "BugError",
    };
    let cause = error.source().map(ToString::to_string);
    let parts = (error.to_string(), error.place(), cause, error.way_out());
    let made = py
        .import("stillpoint._errors")
        .and_then(|module| module.getattr(name))
        .and_then(|class| class.call1(parts));
    made.map_or_else(|failed| failed, PyErr::from_value)
}

/// Runs what stands between Python and the program, so that a panic in it is an exception that
/// `except Exception` catches.
pub(crate) fn guarded<T>(py: Python<'_>, run: impl FnOnce() -> PyResult<T>) -> PyResult<T> {
    fence::fenced(run).unwrap_or_else(|what| {
        let error = Error::new(Kind::Bug, format!("the Python package ended by a panic: {what}"));
        Err(raised(py, &error.hint("this is a fault of stillpoint: please report it")))
    })
}
