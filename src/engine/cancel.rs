//! Cancellation: somebody presses Ctrl-C, every loop of the engine learns of it.

use contract::{Error, Kind, Result};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A flag that ends a run as [`Kind::Cancelled`]; clones share it.
#[derive(Debug, Clone, Default)]
pub struct Cancel(Arc<AtomicBool>);

/// What a shell expects of a program that was interrupted.
const EXIT_INTERRUPTED: i32 = 130;

impl Cancel {
    /// Not yet set.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Ends the run soon.
    pub fn set(&self) {
        self.0.store(true, Ordering::SeqCst);
    }

    /// Whether the run is to end.
    #[must_use]
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// An error once the run is to end.
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
        .map_err(|e| Error::new(Kind::Io, "Ctrl-C cannot be listened to").because(e))
    }

    pub(super) fn error() -> Error {
        Error::new(Kind::Cancelled, "interrupted")
    }
}
