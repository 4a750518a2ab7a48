//! Reads and writes `result.json`.

use crate::atomic;
use crate::result::{ResultFile, SCHEMA};
use contract::{Error, Kind, Result};
use std::path::Path;

impl ResultFile {
    /// Reads the `result.json` of an output folder, or the file that `path` names.
    ///
    /// # Errors
    /// If there is no such file, or if it has another version.
    pub fn read(path: &Path) -> Result<Self> {
        let file = if path.is_dir() { path.join("result.json") } else { path.to_path_buf() };
        let text = std::fs::read(&file).map_err(|e| broken(e.to_string(), &file))?;
        Self::parse(&text, &file)
    }

    /// Reads a result from bytes; `file` is their place in errors.
    ///
    /// # Errors
    /// If the bytes are no result of this version.
    pub fn parse(bytes: &[u8], file: &Path) -> Result<Self> {
        let result: Self =
            serde_json::from_slice(bytes).map_err(|e| broken(e.to_string(), file))?;
        if result.schema == SCHEMA {
            Ok(result)
        } else {
            Err(broken(format!("the schema is \"{}\", not \"{SCHEMA}\"", result.schema), file))
        }
    }

    /// Writes `result.json` to the output folder. It is the last file of a run, so that its
    /// presence shows that all others are complete.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, out: &Path) -> Result<()> {
        let text = serde_json::to_string_pretty(self)
            .map_err(|e| Error::new(Kind::Bug, "result does not serialize").because(e))?;
        atomic::write(&out.join("result.json"), (text + "\n").as_bytes())
    }
}

fn broken(what: String, file: &Path) -> Error {
    Error::bad_input(what).at(file.display()).hint("give the output folder of a run that ended")
}
