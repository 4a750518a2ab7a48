//! Writes rows to a file as they come, one JSON object per line.

use contract::{Error, Kind, Result};
use std::io::Write;
use std::path::{Path, PathBuf};

/// A file of rows that is written row by row, so that a stopped bench has lost nothing.
pub(super) struct Journal(std::fs::File, PathBuf);

impl Journal {
    pub(super) fn create(dir: &Path, name: &str) -> Result<Self> {
        let path = dir.join(name);
        let made = std::fs::create_dir_all(dir).and_then(|()| std::fs::File::create(&path));
        Ok(Self(made.map_err(|e| Error::from(e).at(path.display()))?, path))
    }

    pub(super) fn add(&mut self, row: &impl serde::Serialize) -> Result<()> {
        let text = serde_json::to_string(row)
            .map_err(|e| Error::new(Kind::Bug, "a row cannot be written").because(e))?;
        writeln!(self.0, "{text}").map_err(|e| Error::from(e).at(self.1.display()))
    }
}
