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
        Self { xyz, place_low: place as u32, place_high: (place >> 32) as u16, pixel }
    }

    /// Place in the mask.
    #[inline]
    pub(super) fn place(&self) -> u64 {
        u64::from(self.place_high) << 32 | u64::from(self.place_low)
    }
}

/// Where each record of a tile goes when they are sorted by pixel: a counting sort, which keeps the order that they
/// have already (that of places).
pub(super) struct PixelOrder {
    next: Vec<u32>,
}

impl Default for PixelOrder {
    fn default() -> Self {
        Self { next: vec![0; 1 << 16] }
    }
}

impl PixelOrder {
    /// Counts the records of one tile.
    pub(super) fn begin(&mut self, records: &[Record]) {
        self.next.fill(0);
        for r in records {
            self.next[usize::from(r.pixel)] += 1;
        }
        let mut sum = 0;
        for n in &mut self.next {
            sum += std::mem::replace(n, sum);
        }
    }

    /// The place of the next record; to be asked once for each, in their order.
    #[inline]
    pub(super) fn next(&mut self, record: &Record) -> usize {
        let at = &mut self.next[usize::from(record.pixel)];
        *at += 1;
        *at as usize - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counting_sort_equals_a_sort_by_key() {
        let records: Vec<Record> = (0..5000_u64)
            .map(|i| {
                let x = i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 20;
                Record::new([x as f32, 0.0, 1.0], i << 21, (x % 700) as u16)
            })
            .collect();
        let mut expected = records.clone();
        expected.sort_by_key(|r| (r.pixel, r.place()));
        let mut order = PixelOrder::default();
        for _ in 0..2 {
            let mut sorted = vec![Record::zeroed(); records.len()];
            order.begin(&records);
            for r in &records {
                sorted[order.next(r)] = *r;
            }
            assert!(sorted == expected);
        }
    }
}
