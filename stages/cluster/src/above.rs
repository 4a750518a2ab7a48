//! Selects the occupied voxels above the floor.

use crate::connect::Counted;
use crate::settings::Settings;
use contract::{Floor, FloorLevel, Occupancy};

/// The voxels whose bottom lies above the floor, in their order.
pub(crate) fn above(occupancy: &Occupancy, floor: &Floor, settings: &Settings) -> Vec<Counted> {
    if floor.levels.is_empty() {
        return occupancy.voxels.clone();
    }
    let edge = occupancy.edge;
    let mut patches: Vec<LevelPatch> = floor.levels.iter().map(|_| LevelPatch::default()).collect();
    occupancy
        .voxels
        .iter()
        .filter(|(voxel, _)| {
            let [x, y] = [voxel[0], voxel[1]].map(|i| (f64::from(i) + 0.5) * edge);
            let bottom = f64::from(voxel[2]) * edge;
            let (mut known, mut lowest_is_above) = (false, true);
            for (level, patch) in floor.levels.iter().zip(&mut patches) {
                let Some(h) = patch.height(level, edge, [voxel[0], voxel[1]], [x, y]) else {
                    continue;
                };
                known = true;
                let up = bottom - h;
                if up > -edge - settings.slack && up < settings.clearance {
                    return false;
                }
                lowest_is_above &= up < 0.0;
            }
            !(known && lowest_is_above)
        })
        .copied()
        .collect()
}

/// Cached heights of one level by voxel column, so that each column is computed only once.
#[derive(Debug, Default)]
struct LevelPatch {
    /// Lowest voxel column of the cache.
    first: [i32; 2],
    size: [usize; 2],
    /// Heights, metres; NaN where not yet computed, +∞ where unknown.
    heights: Vec<f64>,
}

/// Largest number of cached columns: 32 MB of heights a level, a hall of 100 m × 100 m at 5 cm.
/// Heights of larger levels are computed each time.
const MOST: usize = 1 << 22;

impl LevelPatch {
    fn height(&mut self, level: &FloorLevel, edge: f64, at: [i32; 2], xy: [f64; 2]) -> Option<f64> {
        if self.heights.is_empty() {
            self.open(level, edge);
        }
        let [i, j] = [0, 1].map(|k| (i64::from(at[k]) - i64::from(self.first[k])) as usize);
        if i >= self.size[0] || j >= self.size[1] {
            return level.height(xy[0], xy[1]);
        }
        let held = &mut self.heights[j * self.size[0] + i];
        if held.is_nan() {
            *held = level.height(xy[0], xy[1]).unwrap_or(f64::INFINITY);
        }
        held.is_finite().then_some(*held)
    }

    /// Allocates the cache for all columns over the level, if they are not too many.
    fn open(&mut self, level: &FloorLevel, edge: f64) {
        let (mut low, mut high) = ([i32::MAX; 2], [i32::MIN; 2]);
        for (cell, _) in &level.heights {
            for k in 0..2 {
                low[k] = low[k].min(cell[k].saturating_sub(3));
                high[k] = high[k].max(cell[k].saturating_add(4));
            }
        }
        let voxel = |cell: i32| (f64::from(cell) * level.cell / edge).floor() as i32;
        self.first = low.map(voxel);
        let size =
            [0, 1].map(|k| (i64::from(voxel(high[k])) - i64::from(self.first[k])).max(0) as usize);
        if size[0].saturating_mul(size[1]) <= MOST {
            self.size = size;
        }
        self.heights = vec![f64::NAN; (self.size[0] * self.size[1]).max(1)];
    }
}
