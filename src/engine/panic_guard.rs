//! Runs a step so that a panic in it becomes an error of kind `Bug` with the panic's message.

use contract::{Error, Kind, Result, fence};

/// Runs `step` on item `at` of pass `name`. State that a panicking step leaves inconsistent is
/// never used again, since the pass ends.
pub(crate) fn guarded<T>(name: &str, at: u64, step: impl FnOnce() -> Result<T>) -> Result<T> {
    fence::fenced(step).unwrap_or_else(|what| Err(panicked(&what, name, at)))
}

fn panicked(what: &str, name: &str, at: u64) -> Error {
    Error::new(Kind::Bug, format!("a step panicked: {what}"))
        .at(format!("{name}, item {at}"))
        .hint("this is a fault of stillpoint: please report it with its input")
}
