//! The output folder of a run: where results are published, where they are written until all of
//! them are complete, and where the store is kept.

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

/// Name of a folder in the store whose content is not kept.
const SCRATCH: &str = "cell";

impl Job {
    /// Locks an output folder against all other runs until the returned file is dropped.
    ///
    /// # Errors
    /// Another run uses the folder.
    pub fn hold(out: &Path) -> Result<std::fs::File> {
        hold(out)
    }

    /// Locks an output folder against runs that write to it until the returned file is dropped.
    ///
    /// # Errors
    /// A run that writes uses the folder.
    pub fn hold_shared(out: &Path) -> Result<std::fs::File> {
        hold_shared(out)
    }

    /// Checks the paths of the job and prepares the output folder.
    ///
    /// # Errors
    /// An input that is missing or lies where the job writes; an output path that is a file, or
    /// that the system refuses.
    pub fn output(&self) -> Result<OutputDir> {
        self.check_places()?;
        OutputDir::prepare(&self.out)
    }
}

/// The locked output folder of a run.
#[derive(Debug, Clone)]
pub struct OutputDir {
    out: PathBuf,
    store: PathBuf,
    next: PathBuf,
    /// The lock, held during the run; the system releases it however the run ends.
    _lock: Arc<File>,
}

impl OutputDir {
    /// Creates and locks the folder and completes an interrupted earlier run: files of a complete
    /// result are moved to their places, others are removed.
    ///
    /// # Errors
    /// A path that is a file, a folder that another run uses, or an error of the system.
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

    /// Folder where results are written; at the end they are moved to [`OutputDir::out`].
    #[must_use]
    pub fn next(&self) -> &Path {
        &self.next
    }

    /// Folder of the published result.
    #[must_use]
    pub fn out(&self) -> &Path {
        &self.out
    }

    /// Folder of the tiles of inputs, one subfolder each.
    #[must_use]
    pub fn tiles(&self) -> PathBuf {
        self.store.join("tiles")
    }

    /// Whether tiles with this key exist and open.
    pub(crate) fn has_tiles(&self, key: &Key) -> bool {
        Store::open(&self.tiles().join(key.name()), 0, 1).is_ok()
    }

    /// Folder of the fits of regions.
    #[must_use]
    pub fn fits(&self) -> PathBuf {
        self.store.join("fits")
    }

    /// Folder of the models of the library as they were loaded.
    #[must_use]
    pub fn models(&self) -> PathBuf {
        self.store.join("models")
    }

    /// Removes tiles, fits and models that the run that has just ended did not use.
    pub(crate) fn prune(&self, tiles: &[Key], fits: &[&Cache], models: &Cache) {
        self.prune_tiles(tiles, models);
        let names: Vec<String> = fits.iter().map(|kept| kept.name()).collect();
        prune(&self.fits(), &names);
    }

    /// Removes tiles and models that the run that has just ended did not use.
    pub(crate) fn prune_tiles(&self, tiles: &[Key], models: &Cache) {
        let names: Vec<String> = tiles.iter().map(|key| key.name().into()).collect();
        prune(&self.tiles(), &names);
        prune(&self.models(), &[models.name()]);
    }

    /// Folder where a rescan writes the clouds of its new points; the next run removes it if this
    /// one is interrupted.
    #[must_use]
    pub fn scratch(&self) -> PathBuf {
        self.store.join(SCRATCH)
    }

    /// Folder of tiles and other pieces that later runs may use again.
    #[must_use]
    pub fn store(&self) -> &Path {
        &self.store
    }
}

/// Locks an output folder exclusively.
fn hold(out: &Path) -> Result<File> {
    locked(&out.join("store").join("lock"))
}

/// Locks an output folder for reading.
fn hold_shared(out: &Path) -> Result<File> {
    let path = out.join("store").join("lock");
    let file = File::open(&path).map_err(|e| Error::from(e).at(path.display()))?;
    let taken = file.try_lock_shared();
    granted(file, taken, &path)
}

/// Opens the lock file.
fn locked(path: &Path) -> Result<File> {
    let refused = |e: std::io::Error| Error::from(e).at(path.display());
    let file = File::options().create(true).truncate(false).write(true).open(path);
    let file = file.map_err(refused)?;
    let taken = file.try_lock();
    granted(file, taken, path)
}

/// The locked file, or the error for a lock that another process has.
fn granted(file: File, taken: std::result::Result<(), TryLockError>, path: &Path) -> Result<File> {
    match taken {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => {
            let what = "another run uses this output folder";
            Err(Error::new(Kind::Io, what)
                .at(path.display())
                .hint("wait for it to end, or give another --out"))
        }
        // Some network shares do not support locks; there the user must start one run at a time.
        Err(TryLockError::Error(e)) if e.kind() == std::io::ErrorKind::Unsupported => Ok(file),
        Err(TryLockError::Error(e)) => Err(Error::from(e).at(path.display())),
    }
}

/// Removes incomplete files of killed runs. A file that cannot be removed only costs space.
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

/// Removes all entries of a folder of pieces whose names do not begin with one of `used`.
fn prune(folder: &Path, used: &[String]) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        if !used.iter().any(|u| name.to_str().is_some_and(|n| n.starts_with(u.as_str()))) {
            let path = entry.path();
            // A file that cannot be removed only costs space.
            let _ = if path.is_dir() {
                std::fs::remove_dir_all(&path)
            } else {
                std::fs::remove_file(&path)
            };
        }
    }
}
