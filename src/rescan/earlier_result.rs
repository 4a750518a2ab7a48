//! The result that a rescan starts from: its robots, tiles and masks, and its files, which are
//! shared with the new result.

use crate::cache::{Key, OutputDir, OutputFile, VerifiedFiles, tiles_of};
use crate::job::Job;
use crate::result::plant_state::PlantState;
use crate::store::Store;
use contract::{Error, Kind, Result};
use export::{MaskReader, ResultFile, ScanLabels, read_places};
use geometry::Aabb;
use std::path::{Path, PathBuf};

/// A complete earlier result.
pub(crate) struct EarlierResult {
    pub(crate) out: PathBuf,
    pub(crate) result: ResultFile,
    pub(crate) state: PlantState,
    /// Its files; each is compared with the manifest when it is read.
    pub(crate) files: VerifiedFiles,
    /// Lock that keeps other runs from rewriting it.
    _lock: std::fs::File,
}

impl EarlierResult {
    /// Opens a result.
    ///
    /// # Errors
    /// There is no result, or its store is missing.
    pub(crate) fn open(out: &Path) -> Result<Self> {
        // This distinguishes a folder without a manifest, which is no result, from a result without
        // its store.
        drop(VerifiedFiles::open(out)?);
        let lock = Job::hold_shared(out)?;
        // The manifest is read again under the lock, since another run may have ended meanwhile.
        let files = VerifiedFiles::open(out)?;
        let (result, state) = (files.result()?, PlantState::read(&files)?);
        let base = Self { out: out.to_path_buf(), result, state, files, _lock: lock };
        for key in &base.state.tiles {
            let folder = base.tiles_folder().join(key.name());
            if !folder.is_dir() {
                return Err(Error::bad_input(
                    "the store with the tiles of the earlier result is missing",
                )
                .at(folder.display())
                .hint("run the whole plant again to make the store"));
            }
        }
        Ok(base)
    }

    fn tiles_folder(&self) -> PathBuf {
        self.out.join("store").join("tiles")
    }

    /// Shares its tiles and loaded models with a new result.
    pub(crate) fn share_store(&self, output: &OutputDir) -> Result<()> {
        for key in &self.state.tiles {
            let (from, to) =
                (self.tiles_folder().join(key.name()), output.tiles().join(key.name()));
            // Existing files are replaced: an earlier attempt may have found them damaged.
            share_folder(&from, &to)?;
        }
        share_folder(&self.out.join("store").join("models"), &output.models())
    }

    /// The store of its scans, opened in the folder of a new result.
    pub(crate) fn store(&self, output: &OutputDir, resident_bytes: usize) -> Result<Store> {
        let open = |(input, key): (usize, &Key)| {
            let place = output.tiles().join(key.name());
            let mut store = Store::open(&place, self.state.first_scan(input), resident_bytes)?;
            // Tiles are compared with the catalogue when they are read, and the catalogue with the
            // digest that the run has recorded.
            if store.contents().first() != self.state.contents.get(input) {
                let what = "the tiles in the store are not those of the earlier result";
                let folder = self.tiles_folder().join(key.name());
                let error = Error::bad_input(what).at(folder.display());
                return Err(error.hint("run the whole plant again"));
            }
            let frame = self.state.frames.get(input).and_then(Option::as_ref);
            frame.into_iter().for_each(|motion| store.carry(motion));
            Ok(store)
        };
        let stores: Result<Vec<Store>> = self.state.tiles.iter().enumerate().map(open).collect();
        Ok(Store::join(stores?))
    }

    /// Shares its files with the new result, except those for which `is_new` is true; returns their
    /// entries of the manifest.
    pub(crate) fn share_files(
        &self,
        next: &Path,
        is_new: impl Fn(&str) -> bool,
    ) -> Result<Vec<OutputFile>> {
        let stay: Vec<OutputFile> =
            self.listed().iter().filter(|file| !is_new(&file.path)).cloned().collect();
        for file in &stay {
            // Files that are not read are not compared: their digests are passed on, and `verify`
            // finds changes.
            share(&self.files.path(&file.path)?, &next.join(&file.path))?;
        }
        Ok(stay)
    }

    /// Whether the result has a file of this name.
    pub(crate) fn has(&self, path: &str) -> bool {
        self.files.has(path)
    }

    /// Entries of all of its files.
    pub(crate) fn listed(&self) -> &[OutputFile] {
        &self.files.manifest().files
    }

    /// Names of its spatial tiles that some boxes touch (world frame, metres), relative to its
    /// folder.
    pub(crate) fn tiles(&self, touched: &[&Aabb]) -> Vec<String> {
        let edge = self.state.records.tile_edge();
        edge.map_or_else(Vec::new, |edge| tiles_of(self.listed(), edge, touched))
    }

    /// Compares the files of one mask with the manifest, each once.
    pub(crate) fn compare_mask(&self, mask: usize) -> Result<()> {
        let files = &self.result.labels.scans[mask];
        [&files.kind, &files.robot, &files.link]
            .iter()
            .try_for_each(|name| self.files.compared(name).map(drop))
    }

    /// Readers of its masks; each mask is compared before it is read.
    pub(crate) fn masks(&self) -> Vec<MaskReader> {
        let reader = |s: &ScanLabels| MaskReader::new(&self.out, [&s.kind, &s.robot, &s.link]);
        self.result.labels.scans.iter().map(reader).collect()
    }

    /// Superseded places of each mask, ascending.
    pub(crate) fn superseded(&self) -> Result<Vec<Vec<u64>>> {
        let read = |s: &ScanLabels| {
            let file = s.superseded.as_ref();
            file.map_or(Ok(Vec::new()), |name| read_places(&self.files.compared(name)?, s.n_points))
        };
        self.result.labels.scans.iter().map(read).collect()
    }
}

/// Shares every file of a folder as hard links where the system supports them.
fn share_folder(from: &Path, to: &Path) -> Result<()> {
    let failed = |e: std::io::Error| Error::from(e).at(from.display());
    for entry in std::fs::read_dir(from).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if let (true, Some(name)) = (path.is_file(), path.file_name()) {
            share(&path, &to.join(name))?;
        }
    }
    Ok(())
}

/// Shares a file as a hard link, which takes no space: nobody writes to it under either name. On
/// another disk it is copied.
fn share(from: &Path, to: &Path) -> Result<()> {
    let made = to.parent().map_or(Ok(()), std::fs::create_dir_all);
    let _ = std::fs::remove_file(to);
    let shared = made.and_then(|()| {
        std::fs::hard_link(from, to).or_else(|_| std::fs::copy(from, to).map(|_| ()))
    });
    shared.map_err(|e| {
        Error::new(Kind::Io, "a file of the earlier result cannot be shared")
            .because(e)
            .at(from.display())
            .hint("`stillpoint verify` tells whether the earlier result is complete")
    })
}
