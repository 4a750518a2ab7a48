//! A fence around a step: a panic in, an error of kind `Bug` with its message out.

use contract::{Error, Kind, Result};
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Runs `step` on item `at` of pass `name`. What the step leaves half-done after a panic is never used again, since
/// the pass ends; hence `AssertUnwindSafe`.
pub(crate) fn guarded<T>(name: &str, at: u64, step: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(step)).unwrap_or_else(|panic| {
        let what = message(panic.as_ref());
        // Dropping a payload may panic in its turn; nothing may escape from here.
        std::mem::forget(panic);
        Err(Error::new(Kind::Bug, format!("a step panicked: {what}"))
            .at(format!("{name}, item {at}"))
            .hint("this is a fault of stillpoint: please report it with its input"))
    })
}

fn message(panic: &(dyn Any + Send)) -> String {
    panic
        .downcast_ref::<&str>()
        .map(ToString::to_string)
        .or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "no message".to_owned())
}
