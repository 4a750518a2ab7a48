//! A point on its way into a tile: what the spill file holds, 20 bytes a point.

use bytemuck::{Pod, Zeroable};

/// Coordinates, place in the mask (48 bits) and pixel within the tile.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub(super) struct Record {
    /// Scan frame, metres.
    pub(super) xyz: [f32; 3],
    place_low: u32,
    place_high: u16,
    /// Row·256 + column.
    pub(super) pixel: u16,
}

impl Record {
    /// Bytes of one.
    pub(super) const BYTES: usize = size_of::<Self>();

    /// `place` must lie below 2⁴⁸ (281 000 billion points: no mask is that long).
    #[inline]
    pub(super) fn new(xyz: [f32; 3], place: u64, pixel: u16) -> Self {
        Self {
            xyz,
            place_low: place as u32,
            place_high: (place >> 32) as u16,
            pixel,
        }
    }

    /// Place in the mask.
    #[inline]
    pub(super) fn place(&self) -> u64 {
        u64::from(self.place_high) << 32 | u64::from(self.place_low)
    }
}

/// Sorts by pixel, then by place: a counting sort over pixels, since places mostly ascend already.
pub(super) fn sorted(mut records: Vec<Record>) -> Vec<Record> {
    if !records.is_sorted_by_key(Record::place) {
        records.sort_unstable_by_key(Record::place);
    }
    if records.is_sorted_by_key(|r| r.pixel) {
        return records;
    }
    let mut next = vec![0_u32; 1 << 16];
    for r in &records {
        next[usize::from(r.pixel)] += 1;
    }
    let mut sum = 0;
    for n in &mut next {
        sum += std::mem::replace(n, sum);
    }
    let mut out = vec![Record::zeroed(); records.len()];
    for r in &records {
        let at = &mut next[usize::from(r.pixel)];
        out[*at as usize] = *r;
        *at += 1;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counting_sort_equals_a_sort_by_key() {
        let mut records: Vec<Record> = (0..5000_u64)
            .map(|i| {
                let x = i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 20;
                Record::new([x as f32, 0.0, 1.0], i << 21, (x % 700) as u16)
            })
            .collect();
        let mut expected = records.clone();
        expected.sort_by_key(|r| (r.pixel, r.place()));
        assert!(sorted(records.clone()) == expected);
        records.reverse();
        assert!(sorted(records) == expected);
    }
}
