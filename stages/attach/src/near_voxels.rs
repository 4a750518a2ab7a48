//! Look-up of marked voxels near others.

use contract::{RESIDUAL_EDGE, Voxel};
use std::collections::BTreeMap;

/// Edge of the cells in which neighbours are looked up, voxels.
const CELL: i32 = 9;
/// The same as a distance, metres.
const CELL_REACH: f64 = CELL as f64 * RESIDUAL_EDGE;

/// Voxels by cells, each with a mark.
#[derive(Default)]
pub(crate) struct NearVoxels {
    cells: BTreeMap<[i32; 3], Vec<(Voxel, u32)>>,
}

impl NearVoxels {
    /// Adds a voxel.
    pub(crate) fn add(&mut self, voxel: Voxel, mark: u32) {
        self.cells.entry(voxel.map(|v| v.div_euclid(CELL))).or_default().push((voxel, mark));
    }

    /// Distance of the nearest of these voxels from any place of a body, metres, and its mark;
    /// `None` beyond `reach`, metres.
    pub(crate) fn nearest(
        &self,
        places: impl Iterator<Item = Voxel>,
        reach: f64,
    ) -> Option<(f64, u32)> {
        let mut best: Option<(f64, u32)> = None;
        for voxel in places {
            self.around(voxel, reach, |distance, mark| {
                let found = (distance, mark);
                if best.is_none_or(|b| found < b) {
                    best = Some(found);
                }
            });
        }
        best
    }

    /// Calls `found` with the distance (metres) and the mark of each of these voxels within `reach`
    /// (metres) of one.
    pub(crate) fn around(&self, voxel: Voxel, reach: f64, mut found: impl FnMut(f64, u32)) {
        let half = (reach / CELL_REACH).ceil() as i32;
        let side = 2 * half + 1;
        let cell = voxel.map(|v| v.div_euclid(CELL));
        for k in 0..side * side * side {
            let by = [k / (side * side) - half, k / side % side - half, k % side - half];
            let cell = [0, 1, 2].map(|i| cell[i].saturating_add(by[i]));
            for (other, mark) in self.cells.get(&cell).into_iter().flatten() {
                let square: f64 =
                    (0..3).map(|i| (f64::from(other[i]) - f64::from(voxel[i])).powi(2)).sum();
                let distance = square.sqrt() * RESIDUAL_EDGE;
                if distance <= reach {
                    found(distance, *mark);
                }
            }
        }
    }
}
