//! A result in; its files out, each compared with what the list of the result says of it before
//! anything of it is believed.
//!
//! Only what is read is compared, and that once. The list itself holds its own digest. Who can
//! write to the folder can of course make a list anew: this tells damage and edits, not a forgery
//! of the whole.

use super::file_digests::Algorithm;
use super::manifest::{LIST, Manifest, OutputFile, RESULT};
use crate::io::own_paths::without_links;
use contract::{Error, Result};
use export::{ResultFile, StatedTile};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// A result whose files are compared when they are asked for.
pub(crate) struct VerifiedFiles {
    out: PathBuf,
    manifest: Manifest,
    digest: String,
    /// By name: the place in the list.
    places: HashMap<String, usize>,
    /// By place in the list: whether the file was compared and is what was written.
    compared: Vec<Mutex<bool>>,
}

impl VerifiedFiles {
    /// Reads the list of a result.
    ///
    /// # Errors
    /// There is none, or it is not what was written.
    pub(crate) fn open(out: &Path) -> Result<Self> {
        let (manifest, digest) = Manifest::read_with_digest(out)?;
        let names = manifest.files.iter().map(|file| file.path.clone());
        let places = names.enumerate().map(|(at, name)| (name, at)).collect();
        let compared = manifest.files.iter().map(|_| Mutex::new(false)).collect();
        Ok(Self { out: out.to_path_buf(), manifest, digest, places, compared })
    }

    pub(crate) fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Digest of the list: it names every byte of the result.
    pub(crate) fn digest(&self) -> &str {
        &self.digest
    }

    /// Whether the list names such a file.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.places.contains_key(name)
    }

    /// The path of a file that is there, no link, and as long as the list says; its bytes are not
    /// compared.
    ///
    /// # Errors
    /// A file that the list does not name, or that is not so.
    pub(crate) fn path(&self, name: &str) -> Result<PathBuf> {
        self.listed(name).map(|(path, ..)| path)
    }

    /// The path of a file whose bytes are what was written; they are read where nobody compared
    /// them yet.
    ///
    /// # Errors
    /// A file that the list does not name, or that is not what was written.
    pub(crate) fn compared(&self, name: &str) -> Result<PathBuf> {
        let (path, file, is_compared) = self.listed(name)?;
        // Others who want the same file wait here, and find it compared.
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

    /// The bytes of a file, compared after they were read.
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

    /// The path of a tile, and the sum that it is to be compared with while it is read; no sum
    /// where it was compared here.
    ///
    /// # Errors
    /// A file that the list does not name, or that is not what was written.
    pub(crate) fn stated(&self, name: &str) -> Result<(PathBuf, Option<StatedTile>)> {
        let (path, file, _) = self.listed(name)?;
        let digits = file.digest.strip_prefix(Algorithm::Crc32c.name());
        match digits.and_then(|digits| u32::from_str_radix(digits, 16).ok()) {
            Some(crc32c) => Ok((path, Some(StatedTile { n_bytes: file.n_bytes, crc32c }))),
            None => Ok((self.compared(name)?, None)),
        }
    }

    /// The result itself.
    ///
    /// # Errors
    /// It is not what was written, or is of another version.
    pub(crate) fn result(&self) -> Result<ResultFile> {
        ResultFile::parse(&self.bytes(RESULT)?, &self.out.join(RESULT))
    }

    fn listed(&self, name: &str) -> Result<(PathBuf, &OutputFile, &Mutex<bool>)> {
        let at = self.places.get(name).copied().ok_or_else(|| {
            Error::bad_input(format!("the list of the result's files has no \"{name}\""))
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
            let what = format!("it is {} bytes long, not {}", meta.len(), file.n_bytes);
            return Err(Error::bad_input(what).at(path.display()).hint(HINT));
        }
        Ok((path, file, &self.compared[at]))
    }
}

/// The result of an output folder, compared with its list; or of a file of that kind by itself,
/// which no list vouches for.
///
/// # Errors
/// There is none, or it is not what was written.
pub(crate) fn result_of(path: &Path) -> Result<ResultFile> {
    if path.is_dir() { VerifiedFiles::open(path)?.result() } else { ResultFile::read(path) }
}

/// The way out of a file that is not what was written.
const HINT: &str = "`stillpoint verify` names all files that are wrong; run the same job again";

fn algorithm(path: &Path, file: &OutputFile) -> Result<Algorithm> {
    Algorithm::of(&file.digest).ok_or_else(|| {
        let what = "its checksum in the list is of no kind that is known";
        Error::bad_input(what).at(path.display()).hint(HINT)
    })
}

fn changed(path: &Path) -> Error {
    let what = "its bytes are not those that were written";
    Error::bad_input(what).at(path.display()).hint(HINT)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cache::Key;
    use crate::engine::Engine;
    use crate::job::Outcome;

    /// A folder with a list of two files.
    fn result() -> tempfile::TempDir {
        let dir = tempfile::tempdir().expect("a folder");
        std::fs::create_dir_all(dir.path().join("labels")).expect("is made");
        std::fs::write(dir.path().join("plant.bin"), b"plant").expect("writes");
        std::fs::write(dir.path().join("labels/0.kind.npy"), b"labels").expect("writes");
        let outcome = Outcome { summary: "all \"well\"".into(), ..Outcome::default() };
        let key = Some(Key::of("test", &[]));
        Manifest::write(dir.path(), key, &outcome, Vec::new(), &Engine::new(1)).expect("lists");
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
        // Its length tells without reading; one that is missing is bad input, too.
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
