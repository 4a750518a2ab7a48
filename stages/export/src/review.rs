//! What an entry of a review did, as `result.json` has it.

use serde::{Deserialize, Serialize};

/// One entry of the file that a person gave with `--review`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReviewEntry {
    /// Its number in the file, from 1 on.
    pub entry: usize,
    /// The place that it speaks of, world, metres.
    pub at: [f64; 3],
    /// What it asked for and what that did, in a sentence.
    pub did: String,
    /// Whether a person should look at it again: it did nothing, contradicts another, or takes
    /// away what the scans show.
    pub needs_look: bool,
}

impl ReviewEntry {
    /// For people.
    #[must_use]
    pub fn words(&self) -> String {
        format!("review, entry {}: {}", self.entry, self.did)
    }
}
