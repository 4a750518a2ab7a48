//! A folder in, the robot library out, its models loaded in parallel.

use crate::engine::{AllThreads, Engine};
use crate::reuse::Cache;
use contract::Result;
use robot::{Library, Settings};
use std::path::Path;

/// Models of a library, loadable or not.
pub(crate) fn count(dir: &Path) -> Result<usize> {
    Ok(Library::open(dir)?.0.len())
}

/// Bytes of the files of all models; what cannot be read counts nothing. Links are not followed.
pub(crate) fn bytes(dir: &Path) -> u64 {
    let (mut sum, mut folders) = (0, Library::open(dir).map(|opened| opened.0).unwrap_or_default());
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
            match entry.metadata() {
                Ok(meta) if meta.is_dir() => folders.push(entry.path()),
                Ok(meta) if meta.is_file() => sum += meta.len(),
                _ => {}
            }
        }
    }
    sum
}

/// Loads all models, those that are `kept` from there; those that cannot be loaded are explained in
/// the library's findings.
pub(crate) fn load(
    dir: &Path,
    settings: &Settings,
    kept: Option<&Cache>,
    engine: &Engine,
) -> Result<Library> {
    load_those(dir, |_| true, (settings, kept), engine)?.checked(dir)
}

/// The same of those whose names are wanted; maybe none.
pub(crate) fn load_those(
    dir: &Path,
    is_wanted: impl Fn(&str) -> bool,
    (settings, kept): (&Settings, Option<&Cache>),
    engine: &Engine,
) -> Result<Library> {
    let (mut folders, mut library) = Library::open(dir)?;
    folders.retain(|folder| is_wanted(&folder.file_name().unwrap_or_default().to_string_lossy()));
    let loaded = engine.fan_out("robots", folders, |folder| {
        let load = || {
            let bare = Settings { clouds: false, ..*settings };
            let (mut model, findings) = Library::load_folder(dir, &folder, &bare);
            // A library has few models, and one of them is the largest: its links are sampled side
            // by side.
            if let (Some(model), true) = (&mut model, settings.clouds) {
                model.sample(settings, &AllThreads);
            }
            Ok((model, findings))
        };
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        kept.map_or_else(load, |kept| kept.get_or_compute(&name, load))
    })?;
    for (model, findings) in loaded {
        library.add(model, findings);
    }
    Ok(library)
}
