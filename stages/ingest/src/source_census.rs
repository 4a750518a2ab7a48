//! The source ids of a LAS or LAZ file, by which its points are told apart.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The source ids of a file, from all records or a sample of them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct SourceCensus {
    /// First place, last place and number of records of each source id.
    pub(crate) ids: BTreeMap<u16, (u64, u64, u64)>,
    /// Number of records that were read.
    n_looked: u64,
    /// Whether every record was read.
    pub(crate) complete: bool,
}

impl SourceCensus {
    /// Adds the ids of consecutive records, of which the first has this place.
    pub(crate) fn add(&mut self, first: u64, ids: impl Iterator<Item = u16>) {
        let ids: Vec<u16> = ids.collect();
        let mut place = first;
        // Points of one scan usually follow one another.
        for same in ids.chunk_by(|a, b| a == b) {
            let n = same.len() as u64;
            let id = self.ids.entry(same[0]).or_insert((place, place, 0));
            *id = (id.0.min(place), id.1.max(place + n - 1), id.2 + n);
            place += n;
        }
        self.n_looked += place - first;
    }

    /// Estimated number of records of the whole file, of which `n` were seen in the sample.
    pub(crate) fn likely(&self, n: u64, n_records: u64) -> u64 {
        let all = n_records as f64;
        (n as f64 / self.n_looked.max(1) as f64 * all) as u64
    }
}
