//! Code that may panic in; its value, or the words of its panic, out.
//!
//! Decoders of other projects panic on some damaged files, and a step of ours may hold a fault.
//! Neither may end the program without a word, and neither may write to standard error by itself:
//! whoever put up the fence says what happened, in the format that the user asked for.

use std::any::Any;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Fences that stand at this moment, on all threads.
static STANDING: AtomicUsize = AtomicUsize::new(0);
/// Words and source line of panics that nobody has asked for yet, the oldest first.
static NOTED: Mutex<Vec<(String, String)>> = Mutex::new(Vec::new());
/// Most panics that are noted at the same time: one a thread, and some to spare.
const MAX_NOTED: usize = 64;

/// Runs code that may panic. What it leaves half-done after a panic must not be used again; hence
/// no `UnwindSafe` is asked for.
///
/// # Errors
/// The words of the panic and, where [`note`] was told, its line of source; in one line.
pub fn fenced<T>(run: impl FnOnce() -> T) -> std::result::Result<T, String> {
    let mut run = Some(run);
    let mut out = None;
    caught(&mut || out = run.take().map(|run| run()))?;
    out.ok_or_else(|| "the step did not run".to_owned())
}

/// The fence itself, compiled once.
fn caught(run: &mut dyn FnMut()) -> std::result::Result<(), String> {
    STANDING.fetch_add(1, Ordering::Relaxed);
    let done = catch_unwind(AssertUnwindSafe(run));
    STANDING.fetch_sub(1, Ordering::Relaxed);
    done.map_err(|panic| {
        let what = words(panic.as_ref());
        // Dropping a payload may panic in its turn; nothing may escape from here.
        std::mem::forget(panic);
        match line_of(&what) {
            Some(line) => format!("{} ({line})", one_line(&what)),
            None => one_line(&what),
        }
    })
}

/// Whether a panic at this moment would be caught by a fence.
#[must_use]
pub fn is_fenced() -> bool {
    STANDING.load(Ordering::Relaxed) > 0
}

/// Notes where a panic came from, for the fence that catches it: for a panic hook, which is then to
/// say nothing itself.
pub fn note(panic: &PanicHookInfo<'_>) {
    let line = panic.location().map_or_else(String::new, |at| {
        // The last three parts of a path name package and file; what comes before differs from
        // machine to machine.
        let parts: Vec<&str> = at.file().split(['/', '\\']).collect();
        format!("{}:{}", parts[parts.len().saturating_sub(4)..].join("/"), at.line())
    });
    let mut noted = NOTED.lock().unwrap_or_else(PoisonError::into_inner);
    if noted.len() == MAX_NOTED {
        noted.remove(0);
    }
    noted.push((words(panic.payload()), line));
}

/// The line that a panic of these words came from; forgotten from then on.
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
