//! The effect of an entry of a review, in `result.json`.

use serde::{Deserialize, Serialize};

/// One entry of a `--review` file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReviewEntry {
    /// Number of the entry in the file, from 1.
    pub entry: usize,
    /// Place that it refers to, world, metres.
    pub at: [f64; 3],
    /// What it asked for and what effect that had, in a sentence.
    pub did: String,
    /// Whether a person should check it again: it had no effect, contradicts another entry, or
    /// rejects what the scans show.
    pub needs_look: bool,
}

impl ReviewEntry {
    /// The entry in words.
    #[must_use]
    pub fn words(&self) -> String {
        format!("review, entry {}: {}", self.entry, self.did)
    }
}
