//! A folder in, the robot library out, its models loaded in parallel.

use crate::engine::Engine;
use contract::Result;
use robot::{Library, Settings};
use std::path::Path;

/// Models of a library, loadable or not.
pub(crate) fn count(dir: &Path) -> Result<usize> {
    Ok(Library::open(dir)?.0.len())
}

/// Loads all models; those that cannot be loaded are explained in the library's findings.
pub(crate) fn load(dir: &Path, settings: &Settings, engine: &Engine) -> Result<Library> {
    let (folders, mut library) = Library::open(dir)?;
    let loaded = engine
        .fan_out("robots", folders, |folder| Ok(Library::load_folder(dir, &folder, settings)))?;
    for model in loaded {
        library.add(model);
    }
    library.checked(dir)
}
