//! Access to the files of a result, each compared with the result's manifest before its content is
//! used.
//!
//! Only files that are read are compared, each once. The manifest contains its own digest. Somebody
//! who can write to the folder can make a new manifest: the check detects damage and edits, not a
//! forgery of the whole result.

use super::file_digests::Algorithm;
use super::manifest::{LIST, Manifest, OutputFile, RESULT};
use crate::io::own_paths::without_links;
use contract::{Error, Result};
use export::{ResultFile, StatedTile};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// A result whose files are compared when they are requested.
pub(crate) struct VerifiedFiles {
    out: PathBuf,
    manifest: Manifest,
    digest: String,
    /// Index of each file name in the manifest.
    places: HashMap<String, usize>,
    /// Whether the file at each index was compared and is unchanged.
    compared: Vec<Mutex<bool>>,
}

impl VerifiedFiles {
    /// Reads the manifest of a result.
    ///
    /// # Errors
    /// There is no manifest, or it was changed.
    pub(crate) fn open(out: &Path) -> Result<Self> {
        let (manifest, digest) = Manifest::read_with_digest(out)?;
        Ok(Self::listed_by(out, manifest, digest))
    }

    /// A result that is complete, but not published yet, so that its manifest has no digest.
    pub(crate) fn unpublished(next: &Path, manifest: Manifest) -> Self {
        Self::listed_by(next, manifest, String::new())
    }

    fn listed_by(out: &Path, manifest: Manifest, digest: String) -> Self {
        let names = manifest.files.iter().map(|file| file.path.clone());
        let places = names.enumerate().map(|(at, name)| (name, at)).collect();
        let compared = manifest.files.iter().map(|_| Mutex::new(false)).collect();
        Self { out: out.to_path_buf(), manifest, digest, places, compared }
    }

    pub(crate) fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Digest of the manifest, which covers every byte of the result.
    pub(crate) fn digest(&self) -> &str {
        &self.digest
    }

    /// Whether the manifest names this file.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.places.contains_key(name)
    }

    /// The path of a file that exists, is no symbolic link and has the length that the manifest
    /// states; its content is not compared.
    ///
    /// # Errors
    /// A file that the manifest does not name, or that fails one of these checks.
    pub(crate) fn path(&self, name: &str) -> Result<PathBuf> {
        self.listed(name).map(|(path, ..)| path)
    }

    /// The path of a file whose content is as written; it is read unless it was compared before.
    ///
    /// # Errors
    /// A file that the manifest does not name, or that was changed.
    pub(crate) fn compared(&self, name: &str) -> Result<PathBuf> {
        let (path, file, is_compared) = self.listed(name)?;
        // Other threads that need the same file wait here, and then find it compared.
        let mut is_compared = is_compared.lock().expect("nobody panics while he holds it");
        if !*is_compared {
            let algorithm = algorithm(&path, file)?;
            if algorithm.read(&path)? != file.digest {
                return Err(changed(&path));
            }
            *is_compared = true;
        }
        Ok(path)
    }

    /// The content of a file, compared after it was read.
    ///
    /// # Errors
    /// As [`VerifiedFiles::compared`].
    pub(crate) fn bytes(&self, name: &str) -> Result<Vec<u8>> {
        let (path, file, _) = self.listed(name)?;
        let algorithm = algorithm(&path, file)?;
        let bytes = std::fs::read(&path);
        let bytes = bytes.map_err(|e| Error::of_read("file cannot be read", &path, e))?;
        if algorithm.of_bytes(&bytes) == file.digest { Ok(bytes) } else { Err(changed(&path)) }
    }

    /// The path of a tile, and the checksum to compare it with while it is read; no checksum where
    /// it was compared here.
    ///
    /// # Errors
    /// A file that the manifest does not name, or that was changed.
    pub(crate) fn stated(&self, name: &str) -> Result<(PathBuf, Option<StatedTile>)> {
        let (path, file, _) = self.listed(name)?;
        let digits = file.digest.strip_prefix(Algorithm::Crc32c.name());
        match digits.and_then(|digits| u32::from_str_radix(digits, 16).ok()) {
            Some(crc32c) => Ok((path, Some(StatedTile { n_bytes: file.n_bytes, crc32c }))),
            None => Ok((self.compared(name)?, None)),
        }
    }

    /// The content of `result.json`.
    ///
    /// # Errors
    /// The file was changed, or was written by another version.
    pub(crate) fn result(&self) -> Result<ResultFile> {
        ResultFile::parse(&self.bytes(RESULT)?, &self.out.join(RESULT))
    }

    fn listed(&self, name: &str) -> Result<(PathBuf, &OutputFile, &Mutex<bool>)> {
        let at = self.places.get(name).copied().ok_or_else(|| {
            Error::bad_input(format!("the list of the result's files does not name \"{name}\""))
                .at(self.out.join(LIST).display())
                .hint("run the same job again")
        })?;
        let file = &self.manifest.files[at];
        let path = without_links(&self.out, name)?;
        let meta = std::fs::metadata(&path);
        let meta = meta.map_err(|e| {
            Error::of_read("a file of the result cannot be read", &path, e).hint(HINT)
        })?;
        if meta.len() != file.n_bytes || !meta.is_file() {
            let what = format!(
                "the file has {} bytes, the list of the result's files states {}",
                meta.len(),
                file.n_bytes
            );
            return Err(Error::bad_input(what).at(path.display()).hint(HINT));
        }
        Ok((path, file, &self.compared[at]))
    }
}

/// The result of an output folder, compared with its manifest, or a single result file, which no
/// manifest covers.
///
/// # Errors
/// There is no result, or it was changed.
pub(crate) fn result_of(path: &Path) -> Result<ResultFile> {
    if path.is_dir() { VerifiedFiles::open(path)?.result() } else { ResultFile::read(path) }
}

/// Hint for a file that was changed.
const HINT: &str = "`stillpoint verify` names all files that have changed; run the same job again";

fn algorithm(path: &Path, file: &OutputFile) -> Result<Algorithm> {
    Algorithm::of(&file.digest).ok_or_else(|| {
        let what = "the list of the result's files has a checksum of an unknown kind for this file";
        Error::bad_input(what).at(path.display()).hint(HINT)
    })
}

fn changed(path: &Path) -> Error {
    let what = "the content of this file differs from what the run has written";
    Error::bad_input(what).at(path.display()).hint(HINT)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cache::Key;
    use crate::engine::Engine;
    use crate::job::Outcome;

    /// A folder with a manifest of two files.
    fn result() -> tempfile::TempDir {
        let dir = tempfile::tempdir().expect("a folder");
        std::fs::create_dir_all(dir.path().join("labels")).expect("is made");
        std::fs::write(dir.path().join("plant.bin"), b"plant").expect("writes");
        std::fs::write(dir.path().join("labels/0.kind.npy"), b"labels").expect("writes");
        let outcome = Outcome { summary: "all \"well\"".into(), ..Outcome::default() };
        let key = Some(Key::of("test", &[]));
        let list = Manifest::list("list", dir.path(), key, &outcome, Vec::new(), &Engine::new(1));
        list.expect("lists").write(dir.path()).expect("writes");
        dir
    }

    #[test]
    fn what_was_changed_is_named_and_the_rest_is_read() {
        let dir = result();
        let vouched = VerifiedFiles::open(dir.path()).expect("opens");
        assert_eq!(vouched.bytes("plant.bin").expect("reads"), b"plant");
        let mask = vouched.compared("labels/0.kind.npy").expect("is whole");
        std::fs::write(&mask, b"lobels").expect("writes");
        let again = VerifiedFiles::open(dir.path()).expect("opens");
        for error in [
            again.compared("labels/0.kind.npy").expect_err("changed"),
            again.bytes("labels/0.kind.npy").expect_err("changed"),
        ] {
            assert_eq!(error.kind(), contract::Kind::BadInput);
            assert!(error.to_string().starts_with(&mask.display().to_string()), "{error}");
        }
        // A wrong length is found without reading; a missing file is bad input, too.
        assert!(again.path("labels/0.kind.npy").is_ok());
        std::fs::write(&mask, b"label").expect("writes");
        assert!(
            again.path("labels/0.kind.npy").expect_err("short").to_string().contains("5 bytes")
        );
        std::fs::remove_file(&mask).expect("goes");
        let gone = again.path("labels/0.kind.npy").expect_err("gone");
        assert_eq!(gone.kind(), contract::Kind::BadInput, "{gone}");
        assert!(again.path("labels/1.kind.npy").is_err() && again.bytes("plant.bin").is_ok());
    }

    #[test]
    fn every_byte_of_the_list_counts() {
        let dir = result();
        let path = dir.path().join(LIST);
        let bytes = std::fs::read(&path).expect("reads");
        for at in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[at] ^= 1;
            std::fs::write(&path, changed).expect("writes");
            let error =
                VerifiedFiles::open(dir.path()).err().unwrap_or_else(|| panic!("byte {at}"));
            assert!(error.to_string().contains(LIST), "{error}");
        }
        for n in 0..bytes.len() {
            std::fs::write(&path, &bytes[..n]).expect("writes");
            assert!(VerifiedFiles::open(dir.path()).is_err(), "{n} bytes");
        }
        std::fs::write(&path, [&bytes[..], b"\n"].concat()).expect("writes");
        assert!(VerifiedFiles::open(dir.path()).is_err(), "a line more");
    }
}
