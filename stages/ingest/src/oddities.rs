//! Points as they are read in; how many of them are odd, and were dropped or cut, out.

use contract::quote;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// What was odd in one scan, counted while it was read with everything that the file says of it.
/// Sums only: the same for any number of threads.
#[derive(Debug, Default)]
pub(crate) struct Oddities {
    no_returns: AtomicU64,
    cut: AtomicU64,
}

impl Oddities {
    /// Begins anew.
    pub(crate) fn clear(&self) {
        self.no_returns.store(0, Relaxed);
        self.cut.store(0, Relaxed);
    }

    /// Adds points that lie at the scanner itself.
    pub(crate) fn add_no_returns(&self, n: u64) {
        self.no_returns.fetch_add(n, Relaxed);
    }

    /// Adds intensities outside their limits.
    pub(crate) fn add_cut(&self, n: u64) {
        self.cut.fetch_add(n, Relaxed);
    }

    /// In words, of a scan of this name; nothing where nothing was odd.
    pub(crate) fn said(&self, name: &str) -> Vec<String> {
        let [no_returns, cut] = [&self.no_returns, &self.cut].map(|n| n.load(Relaxed));
        let (mut out, name) = (Vec::new(), quote::shown(name));
        if no_returns > 0 {
            out.push(format!(
                "scan '{name}': {no_returns} points lie at the scanner itself: beams without return, which were dropped; \
                 they are uncertain in the mask"
            ));
        }
        if cut > 0 {
            out.push(format!(
                "scan '{name}': {cut} intensities lie outside their limits and were cut"
            ));
        }
        out
    }
}

/// What is said of a scan where a look at it found points at the scanner itself.
pub(crate) fn no_returns_note(n: usize, n_looked: usize) -> String {
    format!(
        "{n} of {n_looked} points looked at lie at the scanner itself: they are beams without return, and are dropped"
    )
}
