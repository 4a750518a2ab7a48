//! The BLAKE3 digest of a file from pieces that any threads have summed up, equal to the digest of
//! the file read from beginning to end. (BLAKE3 paper, section 2.1: chunks of 1 KiB are the leaves
//! of a binary tree whose left subtrees are as large as possible.)

use blake3::hazmat::{
    ChainingValue, HasherExt, Mode, left_subtree_len, merge_subtrees_non_root, merge_subtrees_root,
};
use blake3::{CHUNK_LEN, Hasher};
use contract::Weigh;
use std::ops::Range;

/// Length of a leaf of the tree, bytes.
const LEAF: u64 = CHUNK_LEN as u64;

/// A subtree of consecutive leaves: its offset and length in the file, bytes, and its chaining
/// value.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Subtree {
    start: u64,
    n_bytes: u64,
    value: ChainingValue,
}

/// The hash tree of a file of known length. Subtrees are added in the order of the file and merged
/// as they come.
#[derive(Debug)]
pub(crate) struct HashTree {
    n_bytes: u64,
    /// Subtrees that are not merged yet, in the order of the file.
    parts: Vec<Subtree>,
}

impl HashTree {
    pub(crate) fn new(n_bytes: u64) -> Self {
        Self { n_bytes, parts: Vec::new() }
    }

    /// Length of the file.
    pub(crate) fn n_bytes(&self) -> u64 {
        self.n_bytes
    }

    /// The byte range of the leaves that begin within `piece`. The last of them may reach into the
    /// next piece.
    pub(crate) fn leaves_of(piece: &Range<u64>, n_bytes: u64) -> Range<u64> {
        let leaf = |at: u64| at.next_multiple_of(LEAF).min(n_bytes);
        leaf(piece.start)..leaf(piece.end)
    }

    /// The subtrees of consecutive leaves in `bytes`, which begin at offset `start` of a file of
    /// `n_bytes` bytes.
    pub(crate) fn parts(start: u64, bytes: &[u8], n_bytes: u64) -> Vec<Subtree> {
        if n_bytes <= LEAF {
            let value = *blake3::hash(bytes).as_bytes();
            return vec![Subtree { start, n_bytes, value }; usize::from(!bytes.is_empty())];
        }
        let mut parts = Vec::new();
        let (mut at, mut left) = (start, bytes);
        while !left.is_empty() {
            let whole = if at == 0 { left_subtree_len(n_bytes) } else { 1 << at.trailing_zeros() };
            // The largest subtree that begins here and ends within these bytes; only the last leaf
            // of a file may be short.
            let fits = (left.len() as u64 / LEAF).checked_ilog2().map_or(LEAF, |log| LEAF << log);
            let (own, next) = left.split_at(whole.min(fits).min(left.len() as u64) as usize);
            let value = Hasher::new().set_input_offset(at).update(own).finalize_non_root();
            parts.push(Subtree { start: at, n_bytes: own.len() as u64, value });
            (at, left) = (at + own.len() as u64, next);
        }
        parts
    }

    /// Adds the subtrees that follow in the file.
    pub(crate) fn add(&mut self, parts: Vec<Subtree>) {
        for part in parts {
            self.parts.push(part);
            while let [.., left, right] = &*self.parts {
                let n_bytes = left.n_bytes + right.n_bytes;
                let is_tree = left.n_bytes == right.n_bytes && left.start % n_bytes == 0;
                // The root has its own finalisation and is merged in `finish`.
                if !is_tree || n_bytes == self.n_bytes {
                    break;
                }
                self.join(n_bytes);
            }
        }
    }

    /// Merges the last two subtrees.
    fn join(&mut self, n_bytes: u64) {
        if let (Some(right), Some(left)) = (self.parts.pop(), self.parts.pop()) {
            let value = merge_subtrees_non_root(&left.value, &right.value, Mode::Hash);
            self.parts.push(Subtree { start: left.start, n_bytes, value });
        }
    }

    /// The digest of the whole file; `None` where subtrees are missing.
    pub(crate) fn finish(mut self) -> Option<blake3::Hash> {
        if self.parts.iter().map(|p| p.n_bytes).sum::<u64>() != self.n_bytes {
            return None;
        }
        while let [_, .., left, right] = &*self.parts {
            self.join(left.n_bytes + right.n_bytes);
        }
        match &*self.parts {
            [] => Some(blake3::hash(&[])),
            [only] => Some(blake3::Hash::from_bytes(only.value)),
            [left, right, ..] => Some(merge_subtrees_root(&left.value, &right.value, Mode::Hash)),
        }
    }
}

impl Weigh for Subtree {
    fn weight_bytes(&self) -> usize {
        size_of::<Self>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn any_cut_comes_to_the_digest_of_the_whole(
            bytes in prop::collection::vec(any::<u8>(), 0..40_000),
            cuts in prop::collection::vec(0_usize..40_000, 0..12),
        ) {
            let n = bytes.len();
            let mut cuts: Vec<usize> = cuts.into_iter().map(|at| at.min(n)).chain([0, n]).collect();
            cuts.sort_unstable();
            let mut tree = HashTree::new(n as u64);
            for pair in cuts.windows(2) {
                let own = HashTree::leaves_of(&(pair[0] as u64..pair[1] as u64), n as u64);
                let of = &bytes[own.start as usize..own.end as usize];
                tree.add(HashTree::parts(own.start, of, n as u64));
            }
            prop_assert_eq!(tree.finish(), Some(blake3::hash(&bytes)));
        }
    }

    #[test]
    fn pieces_of_any_length_come_to_the_digest_of_the_whole() {
        let bytes: Vec<u8> = (0..300_000_u32).map(|i| (i % 251) as u8).collect();
        for n in [0, 1, 1023, 1024, 1025, 2048, 2049, 4096, 5000, 65_536, 131_072, 262_144, 300_000]
        {
            for step in [1, 700, 1024, 1300, 20_000, 65_536, 131_080, 300_000] {
                if n / step > 5000 {
                    continue;
                }
                let mut tree = HashTree::new(n as u64);
                for start in (0..n).step_by(step) {
                    let piece = start as u64..(start + step).min(n) as u64;
                    let own = HashTree::leaves_of(&piece, n as u64);
                    let of = &bytes[own.start as usize..own.end as usize];
                    tree.add(HashTree::parts(own.start, of, n as u64));
                }
                assert!(tree.parts.len() < 20, "parts join");
                assert_eq!(tree.finish(), Some(blake3::hash(&bytes[..n])), "{n} by {step}");
            }
        }
        let mut tree = HashTree::new(3000);
        tree.add(HashTree::parts(0, &bytes[..2048], 3000));
        assert_eq!(tree.finish(), None);
    }
}
