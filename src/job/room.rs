//! The output folder of a run: where results go, and where the store lies meanwhile.

use contract::{Error, Kind, Result};
use std::path::{Path, PathBuf};

/// The output folder. `result.json` is the last file of a run: while it is missing, the rest is not whole.
#[derive(Debug, Clone)]
pub struct Room {
    out: PathBuf,
    store: PathBuf,
}

impl Room {
    /// Makes the folder and takes away the result of an earlier run, which would vouch for files that are about to
    /// change.
    ///
    /// # Errors
    /// A path that is a file, or that the system refuses.
    pub(super) fn prepare(out: &Path) -> Result<Self> {
        let at = |e: std::io::Error| Error::from(e).at(out.display());
        if out.exists() && !out.is_dir() {
            let what = "the output path is a file, not a folder";
            return Err(Error::new(Kind::Usage, what).at(out.display()).hint("give another --out"));
        }
        let store = out.join("store");
        std::fs::create_dir_all(&store).map_err(at)?;
        match std::fs::remove_file(out.join("result.json")) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(at(e)),
            _ => {}
        }
        Ok(Self { out: out.to_path_buf(), store })
    }

    /// Where results go.
    #[must_use]
    pub fn out(&self) -> &Path {
        &self.out
    }

    /// Where the tiles lie.
    #[must_use]
    pub fn store(&self) -> &Path {
        &self.store
    }
}
