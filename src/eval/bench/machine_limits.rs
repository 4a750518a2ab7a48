//! Measures the limits of the machine, copying a file and copying memory, at the same time as a run
//! that is compared with them.

use contract::{Error, Result};
use serde::Serialize;
use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;
use std::time::Instant;

/// Size of the blocks of a copy, bytes, as `cp` uses.
const PIECE: usize = 1 << 20;
/// Size of the buffers of the memory test, bytes: more than any cache.
const BUFFER: usize = 128 << 20;
/// Number of copies in memory; the median counts.
const N_COPIES: usize = 7;

/// Time of a synced copy of an uncached file.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct Copied {
    /// Number of copied bytes: the whole file, or as much as the disk has room for.
    pub(super) n_bytes: u64,
    pub(super) seconds: f64,
}

impl Copied {
    /// The time for a whole file of this length, seconds.
    pub(super) fn seconds_for(&self, n_bytes: u64) -> f64 {
        self.seconds * n_bytes as f64 / self.n_bytes.max(1) as f64
    }
}

/// Copies a file beside itself, at most `most` bytes of it, waits for the disk, and removes the
/// copy.
pub(super) fn copy(path: &Path, most: u64) -> Result<Copied> {
    let copy = path.with_extension("copy");
    let failed = |e: std::io::Error| Error::from(e).at(path.display());
    forget(path)?;
    let started = Instant::now();
    let copied = (|| {
        let mut from = File::open(path)?.take(most);
        let mut to = File::create(&copy)?;
        let mut piece = vec![0; PIECE];
        let mut n_bytes = 0;
        loop {
            let n = from.read(&mut piece)?;
            if n == 0 {
                break;
            }
            to.write_all(&piece[..n])?;
            n_bytes += n as u64;
        }
        to.sync_all()?;
        Ok(n_bytes)
    })();
    let seconds = started.elapsed().as_secs_f64();
    let _ = std::fs::remove_file(&copy);
    Ok(Copied { n_bytes: copied.map_err(failed)?, seconds })
}

/// Drops a file from the page cache, so that it is read from disk.
pub(super) fn forget(path: &Path) -> Result<()> {
    let failed = |e: std::io::Error| Error::from(e).at(path.display());
    let file = File::open(path).map_err(failed)?;
    // Pages that are not written to disk yet cannot be dropped.
    file.sync_all().map_err(failed)?;
    #[cfg(target_os = "linux")]
    rustix::fs::fadvise(&file, 0, None, rustix::fs::Advice::DontNeed)
        .map_err(|e| failed(e.into()))?;
    Ok(())
}

/// Bytes per second that one thread copies in memory; read and written bytes both count.
pub(super) fn memory() -> f64 {
    let from = vec![1_u8; BUFFER];
    let mut to = vec![0_u8; BUFFER];
    let mut rates: Vec<f64> = (0..N_COPIES)
        .map(|_| {
            let started = Instant::now();
            to.copy_from_slice(&from);
            std::hint::black_box(&mut to);
            2.0 * BUFFER as f64 / started.elapsed().as_secs_f64()
        })
        .collect();
    rates.sort_by(f64::total_cmp);
    rates[N_COPIES / 2]
}
