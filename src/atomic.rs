//! Bytes in, a file under its final name out, but only once it is whole and on disk.

use contract::{Error, Kind, Result};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// A file that is written under a temporary name in the same folder, and gets its name by [`AtomicFile::commit`].
/// Dropped before that, it vanishes.
pub struct AtomicFile {
    file: std::io::BufWriter<NamedTempFile>,
    path: PathBuf,
}

/// Bytes gathered before they are written.
const BUFFER_BYTES: usize = 1 << 20;

impl AtomicFile {
    /// Begins to write what will be `path`; its folder must exist.
    pub fn create(path: &Path) -> Result<Self> {
        let dir = folder(path);
        let file = tempfile::Builder::new()
            .prefix(".stillpoint-")
            .suffix(".part")
            .tempfile_in(dir)
            .map_err(|e| failed(path, "the file cannot be made", e))?;
        Ok(Self {
            file: std::io::BufWriter::with_capacity(BUFFER_BYTES, file),
            path: path.to_owned(),
        })
    }

    /// The file once more, for reading what was written so far.
    pub(crate) fn again(&mut self) -> std::io::Result<File> {
        self.file.flush()?;
        self.file.get_ref().reopen()
    }

    /// Writes what is left, waits for the disk, gives the file its name.
    pub fn commit(self) -> Result<()> {
        let path = self.path;
        let error = |e| failed(&path, "the file cannot be finished", e);
        let file = self.file.into_inner().map_err(|e| error(e.into_error()))?;
        readable(file.as_file()).map_err(error)?;
        file.as_file().sync_all().map_err(error)?;
        file.persist(&path).map_err(|e| error(e.error))?;
        sync_folder(folder(&path)).map_err(error)
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

/// Writes all of a small file.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(bytes).map_err(|e| failed(path, "the file cannot be written", e))?;
    file.commit()
}

fn folder(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Temporary files are private; an output is for everybody who may read the folder.
#[cfg(unix)]
fn readable(file: &File) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(std::fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn readable(_: &File) -> std::io::Result<()> {
    Ok(())
}

/// A new name is on disk once its folder is.
#[cfg(unix)]
fn sync_folder(dir: &Path) -> std::io::Result<()> {
    File::open(dir)?.sync_all()
}

#[cfg(not(unix))]
fn sync_folder(_: &Path) -> std::io::Result<()> {
    Ok(())
}

fn failed(path: &Path, what: &str, cause: std::io::Error) -> Error {
    Error::new(Kind::Io, what).because(cause).at(path.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_committed_file_has_its_name() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("result.json");
        let mut file = AtomicFile::create(&path).expect("begins");
        file.write_all(b"half").expect("writes");
        assert!(!path.exists());
        drop(file);
        assert_eq!(std::fs::read_dir(dir.path()).expect("a folder").count(), 0);
        write(&path, b"one").expect("writes");
        write(&path, b"two").expect("replaces");
        assert_eq!(std::fs::read(&path).expect("a file"), b"two");
        assert_eq!(std::fs::read_dir(dir.path()).expect("a folder").count(), 1);
        assert_eq!(write(&dir.path().join("no/such"), b"").expect_err("fails").kind(), Kind::Io);
    }
}
