//! Fits of a region in, a file of them out, and back: what a run that was cut short had found already.

use super::Key;
use crate::atomic;
use contract::{Fit, Region, Result};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Fits by region, of a plant and settings with one key.
pub(crate) struct KeptFits {
    folder: PathBuf,
    key: Key,
    n_kept: AtomicUsize,
    n_asked: AtomicUsize,
}

impl KeptFits {
    pub(crate) fn new(folder: PathBuf, key: Key) -> Self {
        Self { folder, key, n_kept: AtomicUsize::new(0), n_asked: AtomicUsize::new(0) }
    }

    /// The fits of a region: those that are kept, else those that `find` finds, which are then kept.
    pub(crate) fn or_find(
        &self,
        region: &Region,
        find: impl FnOnce() -> Result<Vec<Fit>>,
    ) -> Result<Vec<Fit>> {
        self.n_asked.fetch_add(1, Ordering::Relaxed);
        let name = Key::of("region", &[self.key.name(), &format!("{region:?}")]);
        let path = self.folder.join(format!("{}-{}", self.key.name(), name.name()));
        if let Some(fits) = std::fs::read(&path).ok().and_then(|bytes| read(&bytes)) {
            self.n_kept.fetch_add(1, Ordering::Relaxed);
            return Ok(fits);
        }
        let fits = find()?;
        if let Some(bytes) = written(&fits) {
            atomic::write(&path, &bytes)?;
        }
        Ok(fits)
    }

    /// Regions whose fits were kept, of all that were asked for.
    pub(crate) fn n_kept(&self) -> [usize; 2] {
        [&self.n_kept, &self.n_asked].map(|n| n.load(Ordering::Relaxed))
    }

    /// What the names of its files begin with.
    pub(crate) fn name(&self) -> String {
        self.key.name().into()
    }
}

/// Length of the digest before the fits, bytes.
const DIGEST: usize = 32;

fn written(fits: &Vec<Fit>) -> Option<Vec<u8>> {
    let body = postcard::to_stdvec(fits).ok()?;
    let mut bytes = blake3::hash(&body).as_bytes().to_vec();
    bytes.extend(body);
    Some(bytes)
}

/// The fits, if every byte is as it was written.
fn read(bytes: &[u8]) -> Option<Vec<Fit>> {
    let (digest, body) = bytes.split_at_checked(DIGEST)?;
    if digest != blake3::hash(body).as_bytes() {
        return None;
    }
    postcard::from_bytes(body).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_comes_back_bit_for_bit_and_damage_is_found_anew() {
        let fit = Fit { score: 0.1 + 0.2, rms: f64::MIN_POSITIVE, ..Fit::default() };
        let dir = tempfile::tempdir().expect("a folder");
        let kept = KeptFits::new(dir.path().into(), Key::of("test", &["a"]));
        let region = Region {
            origin: geometry::Point::origin(),
            bounds: geometry::Aabb { min: [0.0; 3], max: [1.0; 3] },
        };
        let found = kept.or_find(&region, || Ok(vec![fit.clone()])).expect("finds");
        let again = kept.or_find(&region, || unreachable!("it is kept")).expect("reads");
        assert_eq!((found, kept.n_kept()), (again, [1, 2]));
        let path = std::fs::read_dir(dir.path()).expect("lists").next().expect("one").expect("it");
        let mut bytes = std::fs::read(path.path()).expect("reads");
        for i in 0..bytes.len() {
            bytes[i] ^= 1;
            assert_eq!(read(&bytes), None, "byte {i}");
            bytes[i] ^= 1;
        }
        std::fs::write(path.path(), &bytes[..bytes.len() - 1]).expect("writes");
        assert_eq!(kept.or_find(&region, || Ok(Vec::new())).expect("finds anew"), Vec::new());
    }
}
