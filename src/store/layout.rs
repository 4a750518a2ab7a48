//! Numbers of points in; where the arrays of a tile and of its levels lie in its bytes, out.

use super::record::N_LEVELS;
use std::ops::Range;

/// Tiles and their arrays begin at multiples of this, bytes: a cache line, and more than any cast
/// needs.
pub(super) const ALIGN: u64 = 64;

/// Offsets of the three arrays and of the end, for `n` points of a level.
pub(super) fn layout(n: u64) -> [u64; 4] {
    let place = (12 * n).next_multiple_of(ALIGN);
    let pixel = (place + 4 * n).next_multiple_of(ALIGN);
    [0, place, pixel, (pixel + 2 * n).next_multiple_of(ALIGN)]
}

/// Where each level lies in the bytes of a tile.
pub(super) fn blocks(n_of: &[u32; N_LEVELS]) -> [Range<usize>; N_LEVELS] {
    let mut end = 0;
    n_of.map(|n| {
        let start = end;
        end += layout(u64::from(n))[3] as usize;
        start..end
    })
}
