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

    /// Like [`Job::output`], for one of many processes that fill the store of the folder.
    ///
    /// # Errors
    /// Those of [`Job::output`].
    pub(crate) fn shared_output(&self) -> Result<OutputDir> {
        self.check_places()?;
        OutputDir::share(&self.out)
    }
}

/// The locked output folder of a run.
#[derive(Debug, Clone)]
pub struct OutputDir {
    out: PathBuf,
    store: PathBuf,
    next: PathBuf,
    /// The lock, held during the run; the system releases it however the run ends. A process that
    /// makes one shard of a job holds none.
    lock: Option<Arc<File>>,
}

impl OutputDir {
    /// Creates and locks the folder and completes an interrupted earlier run: files of a complete
    /// result are moved to their places, others are removed.
    ///
    /// # Errors
    /// A path that is a file, a folder that another run uses, or an error of the system.
    fn prepare(out: &Path) -> Result<Self> {
        let at = |e: std::io::Error| Error::from(e).at(out.display());
        refuse_file(out)?;
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
        Ok(Self { out: out.to_path_buf(), store, next, lock: Some(Arc::new(lock)) })
    }

    /// Opens the folder for one of many processes that fill its store at the same time. Nothing is
    /// removed, and no lock is held: a process that was believed dead must not stand in the way.
    ///
    /// # Errors
    /// A path that is a file, a folder that a run uses by itself, or an error of the system.
    fn share(out: &Path) -> Result<Self> {
        let at = |e: std::io::Error| Error::from(e).at(out.display());
        refuse_file(out)?;
        places::refuse_links(out)?;
        let (store, next) = (out.join("store"), out.join("store").join("next"));
        for pieces in ["fits", "models", "labels", "looks", "left_out"] {
            std::fs::create_dir_all(store.join(pieces)).map_err(at)?;
        }
        let lock = store.join("lock");
        let file = File::options().create(true).truncate(false).write(true).open(&lock);
        let file = file.map_err(|e| Error::from(e).at(lock.display()))?;
        let taken = file.try_lock_shared();
        granted(file, taken, &lock).map(drop)?;
        Ok(Self { out: out.to_path_buf(), store, next, lock: None })
    }

    /// Whether other processes fill the store at the same time.
    pub(crate) fn is_shared(&self) -> bool {
        self.lock.is_none()
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

    /// Folder of the labels of inputs, one subfolder each, until they are joined.
    pub(crate) fn labels(&self) -> PathBuf {
        self.store.join("labels")
    }

    /// Folder of what samples of inputs have told, for the processes that do a job together.
    pub(crate) fn looks(&self) -> PathBuf {
        self.store.join("looks")
    }

    /// Folder of records about shards that failed and were left out.
    pub(crate) fn left_out(&self) -> PathBuf {
        self.store.join("left_out")
    }

    /// Removes tiles, fits and models that the run that has just ended did not use.
    pub(crate) fn prune(&self, tiles: &[Key], fits: &[&Cache], models: &Cache) {
        self.prune_tiles(tiles, models);
        let names: Vec<String> = fits.iter().map(|kept| kept.name()).collect();
        prune(&self.fits(), &names);
        prune(&self.labels(), &[]);
        prune(&self.looks(), &[]);
        prune(&self.left_out(), &[]);
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

fn refuse_file(out: &Path) -> Result<()> {
    if out.exists() && !out.is_dir() {
        let what = "the output path is a file, not a folder";
        return Err(Error::bad_input(what).at(out.display()).hint("give another --out"));
    }
    Ok(())
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

/// Gives a new folder of a piece its final name. Where another process was faster, its piece stays
/// if it is whole. New folders of the same piece that other processes have left behind are removed:
/// their names begin with `prefix`.
pub(crate) fn settle_folder(
    new: &Path,
    place: &Path,
    prefix: &str,
    is_whole: impl Fn(&Path) -> bool,
) -> Result<()> {
    // The second time is for a damaged folder that was in the way.
    for _ in 0..2 {
        if is_whole(place) || std::fs::rename(new, place).is_ok() {
            break;
        }
        let _ = std::fs::remove_dir_all(place);
    }
    let _ = std::fs::remove_dir_all(new);
    for entry in place.parent().map(std::fs::read_dir).into_iter().flatten().flatten().flatten() {
        if entry.file_name().to_str().is_some_and(|name| name.starts_with(prefix)) {
            let _ = std::fs::remove_dir_all(entry.path());
        }
    }
    if is_whole(place) {
        return Ok(());
    }
    let what = "a piece of the store could not take its place: another process removes it";
    Err(Error::new(Kind::Io, what).at(place.display()).hint("start it again"))
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
