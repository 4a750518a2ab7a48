//! Fates of the earlier points of a cell by voxel: where all points of a voxel stay or all are
//! superseded, its records need not be looked up again one by one.

use change::SessionOccupancy;
use freespace::Visibility;
use geometry::Aabb;
use std::sync::atomic::{AtomicU8, Ordering};

/// Most voxels of the table, one byte each: 30 x 30 x 9 m. In larger cells every point is looked up
/// again.
const MAX_VOXELS: usize = 1 << 26;
/// Bits of a voxel: one of its points stays; new scans measured the surface of one again; new beams
/// passed through one.
const STAYS: u8 = 1;
const ONTO: u8 = 2;
const THROUGH: u8 = 4;

/// Fates of earlier points by voxel ([`SessionOccupancy::cell`]).
pub(crate) struct Fates {
    first: [i32; 3],
    size: [usize; 3],
    /// Bits of each voxel, x fastest.
    voxels: Vec<AtomicU8>,
}

impl Fates {
    /// A table for a cell, without known fates.
    pub(crate) fn of(cell: &Aabb) -> Self {
        let (first, last) = (SessionOccupancy::cell(cell.min), SessionOccupancy::cell(cell.max));
        let n = |i: usize| i64::from(last[i]) - i64::from(first[i]) + 1;
        let size = [0, 1, 2].map(|i| usize::try_from(n(i)).unwrap_or(0));
        let n = size.iter().try_fold(1_usize, |n, s| n.checked_mul(*s));
        let n = n.filter(|n| *n <= MAX_VOXELS).unwrap_or(0);
        Self { first, size, voxels: (0..n).map(|_| AtomicU8::new(0)).collect() }
    }

    /// Adds the visibility of an earlier point in the new scans.
    #[inline]
    pub(crate) fn add(&self, voxel: [i32; 3], sight: Visibility) {
        let fate = match sight {
            Visibility::Onto => ONTO,
            Visibility::Through => THROUGH,
            Visibility::Close | Visibility::Hidden | Visibility::Unseen => STAYS,
        };
        if let Some(own) = self.at(voxel)
            && own.load(Ordering::Relaxed) & fate == 0
        {
            own.fetch_or(fate, Ordering::Relaxed);
        }
    }

    /// Whether all points of a voxel stay (`true`) or none does (`false`); `None` where it depends
    /// on the point. `is_gone` tells whether the body in the voxel is gone.
    pub(crate) fn stays(&self, voxel: [i32; 3], is_gone: impl Fn() -> bool) -> Option<bool> {
        let fate = self.at(voxel)?.load(Ordering::Relaxed);
        let through = match fate & THROUGH {
            0 => 0,
            _ if is_gone() => ONTO,
            _ => STAYS,
        };
        match fate & !THROUGH | through {
            STAYS => Some(true),
            ONTO => Some(false),
            _ => None,
        }
    }

    #[inline]
    fn at(&self, voxel: [i32; 3]) -> Option<&AtomicU8> {
        let [x, y, z] = [0, 1, 2].map(|i| voxel[i].wrapping_sub(self.first[i]) as u32 as usize);
        let [w, h, d] = self.size;
        let is_in = x < w && y < h && z < d;
        is_in.then(|| self.voxels.get((z * h + y) * w + x)).flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_voxels_of_one_fate_have_one() {
        let cell = Aabb { min: [-1.0, 2.0, 0.0], max: [3.0, 4.0, 2.5] };
        let fates = Fates::of(&cell);
        let voxel = |k: i32| SessionOccupancy::cell([-0.97 + 0.05 * f64::from(k), 3.1, 2.49]);
        for (k, sights) in [
            (0, vec![Visibility::Onto, Visibility::Onto]),
            (1, vec![Visibility::Hidden, Visibility::Unseen, Visibility::Close]),
            (2, vec![Visibility::Onto, Visibility::Hidden]),
            (3, vec![Visibility::Through]),
            (4, vec![Visibility::Through, Visibility::Onto]),
        ] {
            sights.into_iter().for_each(|sight| fates.add(voxel(k), sight));
        }
        let said = |is_gone: bool| [0, 1, 2, 3, 4, 5].map(|k| fates.stays(voxel(k), || is_gone));
        let both = [Some(false), Some(true), None];
        assert_eq!(said(true), [both, [Some(false), Some(false), None]].concat()[..]);
        assert_eq!(said(false), [both, [Some(true), None, None]].concat()[..]);
        assert_eq!(fates.stays(SessionOccupancy::cell([9.0, 3.0, 1.0]), || true), None);
        assert_eq!(fates.stays(SessionOccupancy::cell([-1.1, 3.0, 1.0]), || true), None);
    }
}
