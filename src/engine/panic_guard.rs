//! A fence around a step: a panic in, an error of kind `Bug` with its message out.

use contract::{Error, Kind, Result, fence};

/// Runs `step` on item `at` of pass `name`. What the step leaves half-done after a panic is never
/// used again, since the pass ends.
pub(crate) fn guarded<T>(name: &str, at: u64, step: impl FnOnce() -> Result<T>) -> Result<T> {
    fence::fenced(step).unwrap_or_else(|what| Err(panicked(&what, name, at)))
}

fn panicked(what: &str, name: &str, at: u64) -> Error {
    Error::new(Kind::Bug, format!("a step panicked: {what}"))
        .at(format!("{name}, item {at}"))
        .hint("this is a fault of stillpoint: please report it with its input")
}
