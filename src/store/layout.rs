//! Offsets of the arrays of a level and of the levels of a tile within the tile's bytes.

use super::record::N_LEVELS;
use std::ops::Range;

/// Alignment of tiles and their arrays, bytes: a cache line, and more than any cast needs.
pub(super) const ALIGN: u64 = 64;

/// Offsets of the three arrays of a level with `n` points, and of its end, bytes.
pub(super) fn layout(n: u64) -> [u64; 4] {
    let place = (12 * n).next_multiple_of(ALIGN);
    let pixel = (place + 4 * n).next_multiple_of(ALIGN);
    [0, place, pixel, (pixel + 2 * n).next_multiple_of(ALIGN)]
}

/// Byte ranges of all levels within a tile.
pub(super) fn blocks(n_of: &[u32; N_LEVELS]) -> [Range<usize>; N_LEVELS] {
    let mut end = 0;
    n_of.map(|n| {
        let start = end;
        end += layout(u64::from(n))[3] as usize;
        start..end
    })
}
