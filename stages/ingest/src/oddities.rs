//! Counts odd points that are dropped or clamped while a scan is read.

use contract::quote;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Counts of the odd points of one scan during a read with all attributes. The counts are sums, so
/// they do not depend on the number of threads.
#[derive(Debug, Default)]
pub(crate) struct Oddities {
    no_returns: AtomicU64,
    cut: AtomicU64,
}

impl Oddities {
    /// Sets the counts to zero.
    pub(crate) fn clear(&self) {
        self.no_returns.store(0, Relaxed);
        self.cut.store(0, Relaxed);
    }

    /// Counts points that lie at the scanner itself.
    pub(crate) fn add_no_returns(&self, n: u64) {
        self.no_returns.fetch_add(n, Relaxed);
    }

    /// Counts intensities outside their limits.
    pub(crate) fn add_cut(&self, n: u64) {
        self.cut.fetch_add(n, Relaxed);
    }

    /// Messages about the scan of this name; empty where nothing was odd.
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

/// The note on a scan in whose sample points lie at the scanner itself.
pub(crate) fn no_returns_note(n: usize, n_looked: usize) -> String {
    format!(
        "{n} of {n_looked} points looked at lie at the scanner itself: they are beams without return, and are dropped"
    )
}
