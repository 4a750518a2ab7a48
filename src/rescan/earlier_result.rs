//! The result that a rescan goes on from: its folder in; what it found, and its files shared with
//! the new result, out.

use crate::cache::{Key, OutputDir, OutputFile, VerifiedFiles, tiles_of};
use crate::job::Job;
use crate::result::plant_state::PlantState;
use crate::store::Store;
use contract::{Error, Kind, Result};
use export::{MaskReader, ResultFile, ScanLabels, read_places};
use geometry::Aabb;
use std::path::{Path, PathBuf};

/// An earlier result that is whole.
pub(crate) struct EarlierResult {
    pub(crate) out: PathBuf,
    pub(crate) result: ResultFile,
    pub(crate) state: PlantState,
    /// Its files: what is read of them is compared with its list.
    pub(crate) files: VerifiedFiles,
    /// Nobody rewrites it meanwhile.
    _lock: std::fs::File,
}

impl EarlierResult {
    /// Reads what a result says of itself.
    ///
    /// # Errors
    /// No result, or one without its store.
    pub(crate) fn open(out: &Path) -> Result<Self> {
        // A folder without a list is no result; one without its store is a result that cannot be
        // gone on from.
        drop(VerifiedFiles::open(out)?);
        let lock = Job::hold_shared(out)?;
        // Once more, since another run may have ended there meanwhile.
        let files = VerifiedFiles::open(out)?;
        let (result, state) = (files.result()?, PlantState::read(&files)?);
        let base = Self { out: out.to_path_buf(), result, state, files, _lock: lock };
        for key in &base.state.tiles {
            let folder = base.tiles_folder().join(key.name());
            if !folder.is_dir() {
                return Err(Error::bad_input("the tiles of the earlier result are not there")
                    .at(folder.display())
                    .hint("run the whole plant again: its store was taken away"));
            }
        }
        Ok(base)
    }

    fn tiles_folder(&self) -> PathBuf {
        self.out.join("store").join("tiles")
    }

    /// Makes its tiles and loaded models those of a new result, too.
    pub(crate) fn share_store(&self, output: &OutputDir) -> Result<()> {
        for key in &self.state.tiles {
            let (from, to) =
                (self.tiles_folder().join(key.name()), output.tiles().join(key.name()));
            // Also where they are there already: they may be what an earlier attempt met damaged.
            share_folder(&from, &to)?;
        }
        share_folder(&self.out.join("store").join("models"), &output.models())
    }

    /// The store of its scans, as it lies with a new result.
    pub(crate) fn store(&self, output: &OutputDir, resident_bytes: usize) -> Result<Store> {
        let open = |(input, key): (usize, &Key)| {
            let place = output.tiles().join(key.name());
            let mut store = Store::open(&place, self.state.first_scan(input), resident_bytes)?;
            // Its tiles are compared with its catalogue while they are read, and the catalogue here
            // with what the run kept.
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

    /// Gives the new result the files of this one but those that `is_new` says are made anew;
    /// returns them as they are listed.
    pub(crate) fn share_files(
        &self,
        next: &Path,
        is_new: impl Fn(&str) -> bool,
    ) -> Result<Vec<OutputFile>> {
        let stay: Vec<OutputFile> =
            self.listed().iter().filter(|file| !is_new(&file.path)).cloned().collect();
        for file in &stay {
            // What is not read is not compared: its digest is handed on, and `verify` finds what
            // was changed of it.
            share(&self.files.path(&file.path)?, &next.join(&file.path))?;
        }
        Ok(stay)
    }

    /// Whether the result has a file of this name.
    pub(crate) fn has(&self, path: &str) -> bool {
        self.files.has(path)
    }

    /// All of its files.
    pub(crate) fn listed(&self) -> &[OutputFile] {
        &self.files.manifest().files
    }

    /// Names of its spatial tiles that some boxes touch, relative to its folder.
    pub(crate) fn tiles(&self, touched: &[&Aabb]) -> Vec<String> {
        let edge = self.state.records.tile_edge();
        edge.map_or_else(Vec::new, |edge| tiles_of(self.listed(), edge, touched))
    }

    /// Compares the files of one of its masks with its list, each once.
    pub(crate) fn compare_mask(&self, mask: usize) -> Result<()> {
        let files = &self.result.labels.scans[mask];
        [&files.kind, &files.robot, &files.link]
            .iter()
            .try_for_each(|name| self.files.compared(name).map(drop))
    }

    /// Reads labels of each of its masks, once that was compared.
    pub(crate) fn masks(&self) -> Vec<MaskReader> {
        let reader = |s: &ScanLabels| MaskReader::new(&self.out, [&s.kind, &s.robot, &s.link]);
        self.result.labels.scans.iter().map(reader).collect()
    }

    /// Places of each mask that were superseded before, ascending.
    pub(crate) fn superseded(&self) -> Result<Vec<Vec<u64>>> {
        let read = |s: &ScanLabels| {
            let file = s.superseded.as_ref();
            file.map_or(Ok(Vec::new()), |name| read_places(&self.files.compared(name)?, s.n_points))
        };
        self.result.labels.scans.iter().map(read).collect()
    }
}

/// Every file of a folder under a second name; links where the system has them.
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

/// A file under a second name: nobody writes to it under either, so it takes no room twice. A copy
/// where the two lie on different disks.
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
            .hint("`stillpoint verify` tells whether the earlier result is whole")
    })
}
