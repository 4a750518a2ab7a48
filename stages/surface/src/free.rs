//! Known space around robots in; whether a place is proven free out.

use contract::{Space, SpaceGrid, SpaceKind};

/// Voxels that beams passed through, of all robots' grids.
#[derive(Default)]
pub struct FreeSpace {
    grids: Vec<FreeGrid>,
}

struct FreeGrid {
    grid: SpaceGrid,
    /// Whether each voxel is free; 64 a word.
    free: Vec<u64>,
    /// Whether each voxel is known to be something else; 64 a word.
    filled: Vec<u64>,
}

impl FreeSpace {
    /// Adds the space around a robot.
    pub fn add(&mut self, space: &Space) {
        let bits = |is_it: fn(SpaceKind) -> bool| {
            let word = |part: &[SpaceKind]| {
                let set = part.iter().enumerate().filter(|(_, kind)| is_it(**kind));
                set.fold(0_u64, |word, (k, _)| word | 1 << k)
            };
            space.voxels().chunks(64).map(word).collect()
        };
        self.grids.push(FreeGrid {
            grid: *space.grid(),
            free: bits(|kind| kind == SpaceKind::Free),
            filled: bits(|kind| !matches!(kind, SpaceKind::Free | SpaceKind::Unknown)),
        });
    }

    /// Whether nothing is known.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.grids.is_empty()
    }

    /// Whether a place lies in a voxel that is free in one grid and filled in none; world frame,
    /// metres.
    #[must_use]
    pub fn is_free(&self, world: [f64; 3]) -> bool {
        let mut is_free = false;
        for own in &self.grids {
            let Some(at) = own.grid.index(world) else { continue };
            let has = |bits: &[u64]| bits[at / 64] >> (at % 64) & 1 == 1;
            if has(&own.filled) {
                return false;
            }
            is_free |= has(&own.free);
        }
        is_free
    }

    /// A place, or if that is free, the nearest one in the voxel of `inside`, `apart` metres from
    /// its faces. `inside` is a point near the place: the voxel of a point is never free, and to no
    /// point of it can the place come farther by that.
    pub(crate) fn kept_out(&self, world: [f64; 3], inside: [f64; 3], apart: f64) -> [f64; 3] {
        if self.grids.is_empty() || !self.is_free(world) || self.is_free(inside) {
            return world;
        }
        let Some(own) = self.grids.iter().find(|own| own.grid.index(inside).is_some()) else {
            return world;
        };
        let edge = own.grid.edge;
        std::array::from_fn(|i| {
            let low = (inside[i] / edge).floor() * edge;
            world[i].clamp(low + apart, low + edge - apart)
        })
    }
}
