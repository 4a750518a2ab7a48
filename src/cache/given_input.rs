//! An input of a result that is read again: the same file as the one that the run has read.

use super::file_digests::{Algorithm, FileDigests, Stamp};
use contract::{Error, Result};
use export::InputEntry;
use std::path::{Path, PathBuf};

/// An input whose content is the one that the result states.
pub(crate) struct GivenInput {
    path: PathBuf,
    stamp: Stamp,
}

impl GivenInput {
    /// Compares the file at `path` with the entry of the result in `out`. It is read as a whole,
    /// unless the store knows that it is unchanged.
    ///
    /// # Errors
    /// If the file is missing or is another one.
    pub(crate) fn open(path: &Path, entry: &InputEntry, out: &Path) -> Result<Self> {
        let hint = "put the file back as it was when the run read it, start from the folder in \
                    which the run was started, or give the folder of the scans as --inputs DIR";
        let meta = std::fs::metadata(path).map_err(|e| {
            let what = "a scan file of this result cannot be read";
            Error::of_read(what, path, e).hint(hint)
        })?;
        let other = |what: String| Error::bad_input(what).at(path.display()).hint(hint);
        if !meta.is_file() || meta.len() != entry.n_bytes {
            let (now, then) = (meta.len(), entry.n_bytes);
            let what = "this is not the file that the run has read";
            return Err(other(format!("{what}: it has {now} bytes, that one had \"{then}\"")));
        }
        let stamp = Stamp::of(path)?;
        if let Some(algorithm) = Algorithm::of(&entry.digest) {
            let now = FileDigests::open(&out.join("store")).digest(path, algorithm)?;
            if now != entry.digest {
                return Err(other(
                    "this is not the file that the run has read: its content differs".into(),
                ));
            }
        }
        Ok(Self { path: path.to_path_buf(), stamp })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Refuses a file that was changed since it was opened.
    ///
    /// # Errors
    /// If it was changed.
    pub(crate) fn check(&self) -> Result<()> {
        self.stamp.check(&self.path)
    }
}
