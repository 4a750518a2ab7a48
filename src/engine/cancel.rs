//! Cancellation of a run: a shared flag that Ctrl-C sets and that every loop of the engine checks.

use contract::{Error, Kind, Result};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A flag that ends a run as [`Kind::Cancelled`]; clones share it.
#[derive(Debug, Clone, Default)]
pub struct Cancel(Arc<AtomicBool>);

/// Exit code that shells expect of an interrupted program (128 + SIGINT).
const EXIT_INTERRUPTED: i32 = 130;

impl Cancel {
    /// A flag that is not set.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the flag: the run ends at its next check.
    pub fn set(&self) {
        self.0.store(true, Ordering::SeqCst);
    }

    /// Whether the flag is set.
    #[must_use]
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Returns an error of kind [`Kind::Cancelled`] once the flag is set.
    pub fn check(&self) -> Result<()> {
        if self.is_set() { Err(Self::error()) } else { Ok(()) }
    }

    /// Ctrl-C sets the flag; a second Ctrl-C ends the program at once. Outputs are written under
    /// temporary names, so that nothing half-written has a final name even then.
    pub fn on_ctrl_c(&self) -> Result<()> {
        let flag = self.clone();
        ctrlc::set_handler(move || {
            if flag.is_set() {
                std::process::exit(EXIT_INTERRUPTED);
            }
            flag.set();
        })
        .map_err(|e| {
            Error::new(Kind::Io, "the handler for Ctrl-C could not be installed").because(e)
        })
    }

    pub(super) fn error() -> Error {
        Error::new(Kind::Cancelled, "interrupted")
    }
}
