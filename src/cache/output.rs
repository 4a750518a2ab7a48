//! The output folder of a run: where results go, where they lie until all are whole, and where the
//! store is kept.

use super::key::Key;
use super::manifest::Manifest;
use super::pieces::Cache;
use crate::job::{Job, places};
use crate::store::Store;
use contract::{Error, Kind, Result};
use export::atomic;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Name of the folder of the store that nothing is kept in.
const SCRATCH: &str = "cell";

impl Job {
    /// Keeps others out of an output folder for as long as what is returned lives.
    ///
    /// # Errors
    /// Another run is at work in it.
    pub fn hold(out: &Path) -> Result<std::fs::File> {
        hold(out)
    }

    /// Keeps those who would write to an output folder out of it for as long as what is returned
    /// lives.
    ///
    /// # Errors
    /// A run is at work in it.
    pub fn hold_shared(out: &Path) -> Result<std::fs::File> {
        hold_shared(out)
    }

    /// Prepares the output folder.
    ///
    /// # Errors
    /// Something to read that is not there or lies where the job writes; a path that is a file, or
    /// that the system refuses.
    pub fn output(&self) -> Result<OutputDir> {
        self.check_places()?;
        OutputDir::prepare(&self.out)
    }
}

/// The output folder, which nobody else writes to meanwhile.
#[derive(Debug, Clone)]
pub struct OutputDir {
    out: PathBuf,
    store: PathBuf,
    next: PathBuf,
    /// Held while the run lives; the system lets go of it, however the run ends.
    _lock: Arc<File>,
}

impl OutputDir {
    /// Makes the folder, keeps others out of it, and finishes what an earlier run was cut short in:
    /// results that were whole take their places, others are taken away.
    ///
    /// # Errors
    /// A path that is a file, a folder in which another run is at work, or what the system refuses.
    fn prepare(out: &Path) -> Result<Self> {
        let at = |e: std::io::Error| Error::from(e).at(out.display());
        if out.exists() && !out.is_dir() {
            let what = "the output path is a file, not a folder";
            return Err(Error::bad_input(what).at(out.display()).hint("give another --out"));
        }
        places::refuse_links(out)?;
        let store = out.join("store");
        std::fs::create_dir_all(&store).map_err(at)?;
        let lock = locked(&store.join("lock"))?;
        let next = store.join("next");
        if Manifest::waits(&next) {
            Manifest::publish(&next, out)?;
        }
        match std::fs::remove_dir_all(&next) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(at(e)),
            _ => std::fs::create_dir_all(&next).map_err(at)?,
        }
        for pieces in ["fits", "models"] {
            std::fs::create_dir_all(store.join(pieces)).map_err(at)?;
        }
        sweep(&store);
        let _ = std::fs::remove_dir_all(store.join(SCRATCH));
        Ok(Self { out: out.to_path_buf(), store, next, _lock: Arc::new(lock) })
    }

    /// Where results are written; at the end they move to [`OutputDir::out`].
    #[must_use]
    pub fn next(&self) -> &Path {
        &self.next
    }

    /// Where results end up.
    #[must_use]
    pub fn out(&self) -> &Path {
        &self.out
    }

    /// Where the tiles of inputs lie, a folder each.
    #[must_use]
    pub fn tiles(&self) -> PathBuf {
        self.store.join("tiles")
    }

    /// Whether the tiles of this name are there and whole.
    pub(crate) fn has_tiles(&self, key: &Key) -> bool {
        Store::open(&self.tiles().join(key.name()), 0, 1).is_ok()
    }

    /// Where fits of regions lie.
    #[must_use]
    pub fn fits(&self) -> PathBuf {
        self.store.join("fits")
    }

    /// Where models of the library lie as they were loaded.
    #[must_use]
    pub fn models(&self) -> PathBuf {
        self.store.join("models")
    }

    /// Takes away tiles, fits and models that the run which has just ended did not use.
    pub(crate) fn prune(&self, tiles: &[Key], fits: &[&Cache], models: &Cache) {
        self.prune_tiles(tiles, models);
        let names: Vec<String> = fits.iter().map(|kept| kept.name()).collect();
        prune(&self.fits(), &names);
    }

    /// The same without fits.
    pub(crate) fn prune_tiles(&self, tiles: &[Key], models: &Cache) {
        let names: Vec<String> = tiles.iter().map(|key| key.name().into()).collect();
        prune(&self.tiles(), &names);
        prune(&self.models(), &[models.name()]);
    }

    /// Where a rescan makes the clouds of its new points; taken away by the next run where one is
    /// cut short.
    #[must_use]
    pub fn scratch(&self) -> PathBuf {
        self.store.join(SCRATCH)
    }

    /// Where tiles, and what else may be used again, lie.
    #[must_use]
    pub fn store(&self) -> &Path {
        &self.store
    }
}

/// Keeps others out of an output folder.
fn hold(out: &Path) -> Result<File> {
    locked(&out.join("store").join("lock"))
}

/// Keeps those who would write to an output folder out of it, and lets others read.
fn hold_shared(out: &Path) -> Result<File> {
    let path = out.join("store").join("lock");
    let file = File::open(&path).map_err(|e| Error::from(e).at(path.display()))?;
    let taken = file.try_lock_shared();
    granted(file, taken, &path)
}

/// A file that only one process holds.
fn locked(path: &Path) -> Result<File> {
    let refused = |e: std::io::Error| Error::from(e).at(path.display());
    let file = File::options().create(true).truncate(false).write(true).open(path);
    let file = file.map_err(refused)?;
    let taken = file.try_lock();
    granted(file, taken, path)
}

/// What became of the attempt to lock a file.
fn granted(file: File, taken: std::result::Result<(), TryLockError>, path: &Path) -> Result<File> {
    match taken {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => {
            let what = "another run is at work in this output folder";
            Err(Error::new(Kind::Io, what)
                .at(path.display())
                .hint("wait for it to end, or give another --out"))
        }
        // Some shares know no locks; there the user must take care.
        Err(TryLockError::Error(e)) if e.kind() == std::io::ErrorKind::Unsupported => Ok(file),
        Err(TryLockError::Error(e)) => Err(Error::from(e).at(path.display())),
    }
}

/// Takes away what killed runs left half-written. Only space is lost where it stays.
fn sweep(store: &Path) {
    let folders = std::fs::read_dir(store).into_iter().flatten().flatten().map(|e| e.path());
    let folders = folders.filter(|path| path.is_dir()).chain([store.to_path_buf()]);
    for folder in folders {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            if entry.path().extension().is_some_and(|ending| ending == atomic::PART) {
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }
}

/// Removes what lies in a folder of pieces and is none of `used`.
fn prune(folder: &Path, used: &[String]) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        if !used.iter().any(|u| name.to_str().is_some_and(|n| n.starts_with(u.as_str()))) {
            let path = entry.path();
            // Only space is lost where it stays.
            let _ = if path.is_dir() {
                std::fs::remove_dir_all(&path)
            } else {
                std::fs::remove_file(&path)
            };
        }
    }
}
