//! The path of a `result.json` in, what it says out; and back.

use crate::atomic;
use crate::result::{ResultFile, SCHEMA};
use contract::{Error, Kind, Result};
use std::path::Path;

impl ResultFile {
    /// Reads the `result.json` of an output folder, or of a file of that kind.
    ///
    /// # Errors
    /// There is none, or it is of another version.
    pub fn read(path: &Path) -> Result<Self> {
        let file = if path.is_dir() { path.join("result.json") } else { path.to_path_buf() };
        let text = std::fs::read(&file).map_err(|e| broken(e.to_string(), &file))?;
        Self::parse(&text, &file)
    }

    /// The same of bytes that were read already.
    ///
    /// # Errors
    /// Bytes that are no result of this version; the place is `file`.
    pub fn parse(bytes: &[u8], file: &Path) -> Result<Self> {
        let result: Self =
            serde_json::from_slice(bytes).map_err(|e| broken(e.to_string(), file))?;
        if result.schema == SCHEMA {
            Ok(result)
        } else {
            Err(broken(format!("the schema is \"{}\", not \"{SCHEMA}\"", result.schema), file))
        }
    }

    /// Writes `result.json` under the output folder: the last file of a run, so that its presence
    /// says that all the others are whole.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, out: &Path) -> Result<()> {
        let text = serde_json::to_string_pretty(self)
            .map_err(|e| Error::new(Kind::Bug, "result does not serialize").because(e))?;
        atomic::write(&out.join("result.json"), (text + "\n").as_bytes())
    }
}

fn broken(what: String, file: &Path) -> Error {
    Error::bad_input(what).at(file.display()).hint("give the output folder of a run that ended")
}
