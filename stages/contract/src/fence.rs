//! Runs code that may panic and returns its value or the message of the panic.
//!
//! Decoders of other projects panic on some damaged files, and a step of this program may have a
//! fault. Neither may end the program silently or write to standard error by itself: the caller
//! of [`fenced`] reports what happened, in the format that the user asked for.

use std::any::Any;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Number of [`fenced`] calls that are running now, on all threads.
static STANDING: AtomicUsize = AtomicUsize::new(0);
/// Messages and source lines of panics that were not yet picked up, the oldest first.
static NOTED: Mutex<Vec<(String, String)>> = Mutex::new(Vec::new());
/// Largest number of panics kept at a time: one for each thread, and some to spare.
const MAX_NOTED: usize = 64;

/// Runs code that may panic. Data that the code was changing when it panicked must not be used
/// again; that is why no `UnwindSafe` is required.
///
/// # Errors
/// The message of the panic on one line, with its source line where [`note`] was called.
pub fn fenced<T>(run: impl FnOnce() -> T) -> std::result::Result<T, String> {
    let mut run = Some(run);
    let mut out = None;
    caught(&mut || out = run.take().map(|run| run()))?;
    out.ok_or_else(|| "the step did not run".to_owned())
}

/// The part of [`fenced`] that does not depend on its type, compiled once.
fn caught(run: &mut dyn FnMut()) -> std::result::Result<(), String> {
    STANDING.fetch_add(1, Ordering::Relaxed);
    let done = catch_unwind(AssertUnwindSafe(run));
    STANDING.fetch_sub(1, Ordering::Relaxed);
    done.map_err(|panic| {
        let what = words(panic.as_ref());
        // Dropping a panic's payload may panic again, and nothing may escape from here.
        std::mem::forget(panic);
        match line_of(&what) {
            Some(line) => format!("{} ({line})", one_line(&what)),
            None => one_line(&what),
        }
    })
}

/// Whether a panic on this thread would now be caught by [`fenced`].
#[must_use]
pub fn is_fenced() -> bool {
    STANDING.load(Ordering::Relaxed) > 0
}

/// Notes the source line of a panic for the [`fenced`] call that catches it. A panic hook calls
/// this and then prints nothing itself.
pub fn note(panic: &PanicHookInfo<'_>) {
    let line = panic.location().map_or_else(String::new, |at| {
        // The last three parts of the path name package and file; those before differ between
        // machines.
        let parts: Vec<&str> = at.file().split(['/', '\\']).collect();
        format!("{}:{}", parts[parts.len().saturating_sub(4)..].join("/"), at.line())
    });
    let mut noted = NOTED.lock().unwrap_or_else(PoisonError::into_inner);
    if noted.len() == MAX_NOTED {
        noted.remove(0);
    }
    noted.push((words(panic.payload()), line));
}

/// Takes the source line that was noted for a panic with this message.
fn line_of(what: &str) -> Option<String> {
    let mut noted = NOTED.lock().unwrap_or_else(PoisonError::into_inner);
    let at = noted.iter().position(|(words, _)| words == what)?;
    Some(noted.remove(at).1)
}

fn words(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(ToString::to_string);
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
    text.unwrap_or_else(|| "no message".to_owned())
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_one_line_and_nothing_else_changes() {
        assert_eq!(fenced(|| 7), Ok(7));
        let broken = fenced(|| -> u8 {
            assert!(is_fenced());
            panic!("index {} is\n  out of bounds", 9)
        });
        assert_eq!(broken, Err("index 9 is out of bounds".into()));
        let other = fenced(|| -> u8 { std::panic::panic_any(3_u8) });
        assert_eq!(other, Err("no message".into()));
    }
}
