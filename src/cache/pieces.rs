//! Cached pieces that take long to compute (fits of a region, models of a library), one file each.

use super::key::Key;
use contract::Result;
use export::atomic;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Pieces by name, all computed from the contents that one key stands for.
pub(crate) struct Cache {
    folder: PathBuf,
    key: Key,
    n_kept: AtomicUsize,
    n_asked: AtomicUsize,
}

impl Cache {
    pub(crate) fn new(folder: PathBuf, key: Key) -> Self {
        Self { folder, key, n_kept: AtomicUsize::new(0), n_asked: AtomicUsize::new(0) }
    }

    /// Returns the cached piece with this name; otherwise computes it with `find` and stores it.
    pub(crate) fn get_or_compute<T: Serialize + DeserializeOwned>(
        &self,
        name: &str,
        find: impl FnOnce() -> Result<T>,
    ) -> Result<T> {
        self.n_asked.fetch_add(1, Ordering::Relaxed);
        if let Some(piece) = self.get(name) {
            self.n_kept.fetch_add(1, Ordering::Relaxed);
            return Ok(piece);
        }
        let piece = find()?;
        self.keep(name, &piece)?;
        Ok(piece)
    }

    /// The cached piece with this name; `None` where it is missing or damaged.
    pub(crate) fn get<T: DeserializeOwned>(&self, name: &str) -> Option<T> {
        std::fs::read(self.path(name)).ok().and_then(|bytes| read(&bytes))
    }

    /// Stores a piece under this name. Other processes may store the same piece at the same time.
    pub(crate) fn keep(&self, name: &str, piece: &impl Serialize) -> Result<()> {
        written(piece).map_or(Ok(()), |bytes| atomic::write_shared(&self.path(name), &bytes))
    }

    /// Whether there is a piece with this name, damaged or not.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.path(name).is_file()
    }

    fn path(&self, name: &str) -> PathBuf {
        let name = Key::of("piece", &[self.key.name(), name]);
        self.folder.join(format!("{}-{}", self.key.name(), name.name()))
    }

    /// Number of pieces that were taken from the cache, and of all that were requested.
    pub(crate) fn n_kept(&self) -> [usize; 2] {
        [&self.n_kept, &self.n_asked].map(|n| n.load(Ordering::Relaxed))
    }

    /// The key that stands for the contents.
    pub(crate) fn key(&self) -> &Key {
        &self.key
    }

    /// Prefix of the names of its files.
    pub(crate) fn name(&self) -> String {
        self.key.name().into()
    }
}

/// Length of the digest at the start of a file, bytes.
const DIGEST: usize = 32;

/// The encoded piece, preceded by its digest; `None` where it cannot be encoded.
pub(crate) fn written(piece: &impl Serialize) -> Option<Vec<u8>> {
    let body = postcard::to_stdvec(piece).ok()?;
    let mut bytes = blake3::hash(&body).as_bytes().to_vec();
    bytes.extend(body);
    Some(bytes)
}

/// Decodes a piece; `None` where its bytes do not match their digest.
pub(crate) fn read<T: DeserializeOwned>(bytes: &[u8]) -> Option<T> {
    let (digest, body) = bytes.split_at_checked(DIGEST)?;
    if digest != blake3::hash(body).as_bytes() {
        return None;
    }
    postcard::from_bytes(body).ok()
}

/// Messages about pieces that were used again: for each name the numbers `[kept, all]`, where at
/// least one was kept.
pub(crate) fn reused_in_words<const N: usize>(
    names: [&str; N],
    n_kept: [[usize; 2]; N],
) -> Vec<String> {
    let kept = names.iter().zip(n_kept).filter(|(_, [kept, _])| *kept > 0);
    kept.map(|(name, [kept, all])| format!("{name}: {kept} of {all}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::Fit;

    #[test]
    fn what_is_kept_comes_back_bit_for_bit_and_damage_is_found_anew() {
        let fit = Fit { score: 0.1 + 0.2, rms: f64::MIN_POSITIVE, ..Fit::default() };
        let dir = tempfile::tempdir().expect("a folder");
        let kept = Cache::new(dir.path().into(), Key::of("test", &["a"]));
        let found = kept.get_or_compute("here", || Ok(vec![fit.clone()])).expect("finds");
        let again = kept.get_or_compute("here", || unreachable!("it is kept")).expect("reads");
        assert_eq!((found, kept.n_kept()), (again, [1, 2]));
        let path = std::fs::read_dir(dir.path()).expect("lists").next().expect("one").expect("it");
        let mut bytes = std::fs::read(path.path()).expect("reads");
        for i in 0..bytes.len() {
            bytes[i] ^= 1;
            assert_eq!(read::<Vec<Fit>>(&bytes), None, "byte {i}");
            bytes[i] ^= 1;
        }
        std::fs::write(path.path(), &bytes[..bytes.len() - 1]).expect("writes");
        assert_eq!(
            kept.get_or_compute("here", || Ok(Vec::<Fit>::new())).expect("finds anew"),
            Vec::new()
        );
    }
}
