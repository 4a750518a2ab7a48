//! Writes one COPC file of all points of a result's tiles, with its steps shown as stages of the
//! run.

use crate::engine::progress::{Progress, Stage};
use crate::engine::{Amount, Cancel, Engine, guarded};
use contract::Result;
use export::CopcSteps;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Writes the COPC file `to` from these tiles; returns false where there are none. The folder
/// `scratch` is removed at the end, also after an error.
///
/// # Errors
/// Files that cannot be read or written, or a cancelled run.
pub(crate) fn write(tiles: &[PathBuf], to: &Path, scratch: &Path, engine: &Engine) -> Result<bool> {
    let steps = Arc::new(Steps {
        progress: engine.progress.clone(),
        cancel: engine.cancel.clone(),
        stage: Mutex::new(None),
        done: AtomicU64::new(0),
    });
    engine.cancel.check()?;
    let write = || guarded("copc", 0, || export::write_copc(tiles, to, scratch, &steps));
    let written = engine.pool()?.install(write);
    // Remaining files only cost space; the next run removes them.
    let _ = std::fs::remove_dir_all(scratch);
    written
}

/// Shows the steps of the conversion as stages of the run.
struct Steps {
    progress: Progress,
    cancel: Cancel,
    stage: Mutex<Option<Stage>>,
    done: AtomicU64,
}

impl Steps {
    fn with<T>(&self, work: impl FnOnce(&mut Option<Stage>) -> T) -> T {
        work(&mut self.stage.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl CopcSteps for Steps {
    fn begins(&self, step: &'static str, total: u64) {
        let name = format!("copc {}", step.to_lowercase());
        self.done.store(0, Ordering::Relaxed);
        self.with(|stage| *stage = Some(self.progress.stage(&name, Amount::items(total))));
    }

    fn is_at(&self, done: u64) {
        let before = self.done.fetch_max(done, Ordering::Relaxed);
        self.with(|stage| stage.iter().for_each(|s| s.add(done.saturating_sub(before), 0, 0)));
    }

    fn ends(&self) -> Result<()> {
        self.with(|stage| stage.take().iter().for_each(Stage::finish));
        self.cancel.check()
    }
}
