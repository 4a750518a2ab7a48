//! The set of superseded places of a mask: places are added from any thread in any order, and
//! listed in ascending order.

use contract::Result;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

/// Number of places that are listed at a time.
const PART: usize = 1 << 16;

/// Places of one mask, one bit each: millions of them are listed in order without sorting, with an
/// eighth of a byte per point.
pub(crate) struct Places {
    /// Number of points of the mask.
    n_points: u64,
    words: OnceLock<Vec<AtomicU64>>,
}

impl Places {
    /// An empty set for a mask with `n_points` points.
    pub(crate) fn of(n_points: u64) -> Self {
        Self { n_points, words: OnceLock::new() }
    }

    /// A handle for adding places, fast for neighbouring ones.
    pub(crate) fn adding(&self) -> Adding<'_> {
        let n_words = self.n_points.div_ceil(64);
        let words = self.words.get_or_init(|| (0..n_words).map(|_| AtomicU64::new(0)).collect());
        Adding { words, at: 0, bits: 0 }
    }

    /// Number of places in the set.
    pub(crate) fn len(&self) -> u64 {
        self.words().map(|(_, word)| u64::from(word.count_ones())).sum()
    }

    /// Passes all places to `take`, ascending, some at a time.
    pub(crate) fn each(&self, mut take: impl FnMut(&[u64]) -> Result<()>) -> Result<()> {
        let mut part = Vec::with_capacity(PART + 64);
        for (at, mut left) in self.words() {
            while left != 0 {
                part.push(at * 64 + u64::from(left.trailing_zeros()));
                left &= left - 1;
            }
            if part.len() >= PART {
                take(&part)?;
                part.clear();
            }
        }
        take(&part)
    }

    fn words(&self) -> impl Iterator<Item = (u64, u64)> + '_ {
        (0..)
            .zip(self.words.get().into_iter().flatten())
            .map(|(i, w)| (i, w.load(Ordering::Relaxed)))
    }
}

/// Handle for adding places; bits of one word are collected and set together.
pub(crate) struct Adding<'a> {
    words: &'a [AtomicU64],
    at: usize,
    bits: u64,
}

impl Adding<'_> {
    /// Adds a place.
    #[inline]
    pub(crate) fn add(&mut self, place: u64) {
        let at = (place / 64) as usize;
        if at != self.at {
            self.flush();
            self.at = at;
        }
        self.bits |= 1 << (place % 64);
    }

    fn flush(&mut self) {
        // A place beyond the mask has no label and is not one of its points.
        if let (bits @ 1.., Some(word)) = (std::mem::take(&mut self.bits), self.words.get(self.at))
        {
            word.fetch_or(bits, Ordering::Relaxed);
        }
    }
}

impl Drop for Adding<'_> {
    fn drop(&mut self) {
        self.flush();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_come_out_in_order_and_once() {
        let places = Places::of(300_000);
        let mut wanted: Vec<u64> = (0..100_000).map(|i| i * 7919 % 300_000).collect();
        std::thread::scope(|scope| {
            for half in wanted.chunks(50_001) {
                scope.spawn(|| {
                    let mut adding = places.adding();
                    half.iter().for_each(|place| adding.add(*place));
                });
            }
        });
        places.adding().add(wanted[5]);
        wanted.sort_unstable();
        wanted.dedup();
        let mut found = Vec::new();
        places
            .each(|part| {
                found.extend_from_slice(part);
                Ok(())
            })
            .expect("takes all");
        assert_eq!(found, wanted);
        assert_eq!(places.len(), wanted.len() as u64);
        assert_eq!(Places::of(10).len(), 0);
    }
}
