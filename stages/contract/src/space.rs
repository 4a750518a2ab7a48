//! A voxel grid of the space around a robot. Each voxel is free, fixed, part of the robot, part of
//! another robot, or unknown.

use crate::{Label, PointKind};
use geometry::Aabb;
use serde::{Deserialize, Serialize};

/// State of a voxel; the numbers are those of the output files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u8)]
pub enum SpaceKind {
    /// No beam passed through it and no point lies in it.
    Unknown = 0,
    /// At least one beam passed through it.
    Free = 1,
    /// Points in it stand still or may stand still.
    Fixed = 2,
    /// It belongs to the robot's own body, or its points move with the robot.
    Robot = 3,
    /// It belongs to another robot's body, or its points move with that robot.
    Other = 4,
}

impl SpaceKind {
    /// All states.
    pub const ALL: [Self; 5] = [Self::Unknown, Self::Free, Self::Fixed, Self::Robot, Self::Other];

    /// Whether a moving robot would collide with it: fixed things, and other robots as found.
    #[must_use]
    pub fn is_obstacle(self) -> bool {
        matches!(self, Self::Fixed | Self::Other)
    }
}

/// Placement of the voxels: aligned to whole multiples of the edge from the world's origin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SpaceGrid {
    /// Edge of a voxel, metres.
    pub edge: f64,
    /// Lowest corner of the first voxel in the world, in units of the edge.
    pub first: [i64; 3],
    /// Number of voxels along x, y and z.
    pub size: [usize; 3],
}

/// The state of each voxel around one robot.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Space {
    grid: SpaceGrid,
    /// The voxels; z varies fastest, then y.
    voxels: Vec<SpaceKind>,
}

/// Largest number of voxels of one grid; the largest robots need 3 million at the default edge.
const MAX_VOXELS: f64 = 64e6;

impl SpaceGrid {
    /// A grid over bounds in the world, metres. The edge is widened where there would be too many
    /// voxels.
    #[must_use]
    pub fn over(bounds: &Aabb, edge: f64) -> Self {
        let volume: f64 = bounds.size().iter().map(|s| s.max(edge)).product();
        let edge = edge.max((volume / MAX_VOXELS).cbrt());
        let first = bounds.min.map(|v| (v / edge).floor() as i64);
        let last = bounds.max.map(|v| (v / edge).ceil() as i64);
        let size = std::array::from_fn(|i| usize::try_from(last[i] - first[i]).unwrap_or(0).max(1));
        Self { edge, first, size }
    }

    /// Bounds of the grid in the world, metres.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        let at = |i: usize, v: i64| (self.first[i] + v) as f64 * self.edge;
        Aabb {
            min: std::array::from_fn(|i| at(i, 0)),
            max: std::array::from_fn(|i| at(i, self.size[i] as i64)),
        }
    }

    /// Index of the voxel of a point in the world, metres; `None` outside of the grid.
    #[must_use]
    pub fn index(&self, p: [f64; 3]) -> Option<usize> {
        let mut out = 0;
        for i in 0..3 {
            let at = (p[i] / self.edge).floor() - self.first[i] as f64;
            if !(at >= 0.0 && at < self.size[i] as f64) {
                return None;
            }
            out = out * self.size[i] + at as usize;
        }
        Some(out)
    }

    /// Position of a voxel along x, y and z, from its index.
    #[must_use]
    pub fn cell(&self, at: usize) -> [usize; 3] {
        let [_, y, z] = self.size;
        [at / (y * z), at / z % y, at % z]
    }

    /// Centre of a voxel in the world, metres.
    #[must_use]
    pub fn middle(&self, at: usize) -> [f64; 3] {
        let cell = self.cell(at);
        std::array::from_fn(|i| ((self.first[i] + cell[i] as i64) as f64 + 0.5) * self.edge)
    }

    /// Indices of the voxels that a `surface` (indices of voxels) encloses: those that cannot be
    /// reached from outside of `bounds` (world, metres) without crossing it. Ascending.
    #[must_use]
    pub fn enclosed(&self, bounds: &Aabb, surface: &[usize]) -> Vec<usize> {
        let cell = |p: [f64; 3], up: bool| -> [usize; 3] {
            std::array::from_fn(|i| {
                let at = (p[i] / self.edge).floor() - self.first[i] as f64;
                let at = if up { at + 2.0 } else { at - 1.0 };
                at.clamp(0.0, self.size[i] as f64) as usize
            })
        };
        let (low, high) = (cell(bounds.min, false), cell(bounds.max, true));
        let size: [usize; 3] = std::array::from_fn(|i| high[i].saturating_sub(low[i]));
        let place = |c: [usize; 3]| (c[0] * size[1] + c[1]) * size[2] + c[2];
        let mut seen = vec![false; size.iter().product()];
        for at in surface {
            let c = self.cell(*at);
            if (0..3).all(|i| c[i] >= low[i] && c[i] < high[i]) {
                seen[place(std::array::from_fn(|i| c[i] - low[i]))] = true;
            }
        }
        let is_rim = |c: &[usize; 3]| (0..3).any(|i| c[i] == 0 || c[i] + 1 == size[i]);
        let all = (0..size[0])
            .flat_map(|x| (0..size[1]).flat_map(move |y| (0..size[2]).map(move |z| [x, y, z])));
        let mut open: Vec<[usize; 3]> = all.filter(is_rim).filter(|c| !seen[place(*c)]).collect();
        open.iter().for_each(|c| seen[place(*c)] = true);
        while let Some(c) = open.pop() {
            for axis in 0..3 {
                for step in [-1_isize, 1] {
                    let mut next = c;
                    let Some(to) = c[axis].checked_add_signed(step) else { continue };
                    next[axis] = to;
                    if to < size[axis] && !std::mem::replace(&mut seen[place(next)], true) {
                        open.push(next);
                    }
                }
            }
        }
        let enclosed = seen.iter().enumerate().filter(|(_, seen)| !**seen).map(|(at, _)| {
            let c = [at / (size[1] * size[2]), at / size[2] % size[1], at % size[2]];
            let c: [usize; 3] = std::array::from_fn(|i| c[i] + low[i]);
            (c[0] * self.size[1] + c[1]) * self.size[2] + c[2]
        });
        enclosed.collect()
    }
}

impl Space {
    /// A grid of unknown voxels.
    #[must_use]
    pub fn unknown(grid: SpaceGrid) -> Self {
        Self { grid, voxels: vec![SpaceKind::Unknown; grid.size.iter().product()] }
    }

    /// Placement of the voxels.
    #[must_use]
    pub fn grid(&self) -> &SpaceGrid {
        &self.grid
    }

    /// All voxels, for writing; z varies fastest, then y.
    pub fn voxels_mut(&mut self) -> &mut [SpaceKind] {
        &mut self.voxels
    }

    /// All voxels; z varies fastest, then y.
    #[must_use]
    pub fn voxels(&self) -> &[SpaceKind] {
        &self.voxels
    }

    /// Volume of all voxels of one state, m³.
    #[must_use]
    pub fn volume(&self, kind: SpaceKind) -> f64 {
        let n = self.voxels.iter().filter(|v| **v == kind).count();
        n as f64 * self.grid.edge.powi(3)
    }

    /// Adds a labelled point to a voxel. Fixed overrides every other state, and another robot
    /// overrides the robot's own body, so that an obstacle is never lost.
    pub fn mark(&mut self, index: usize, voxel: SpaceKind) {
        let rank = |kind| match kind {
            SpaceKind::Unknown | SpaceKind::Free => 0,
            SpaceKind::Robot => 1,
            SpaceKind::Other => 2,
            SpaceKind::Fixed => 3,
        };
        let old = &mut self.voxels[index];
        if rank(voxel) > rank(*old) {
            *old = voxel;
        }
    }

    /// The state that a point with this label gives its voxel in the space of robot `robot`.
    #[must_use]
    pub fn kind_of(label: Label, robot: usize) -> SpaceKind {
        match label.kind {
            PointKind::Link | PointKind::Attachment
                if usize::try_from(label.robot).is_ok_and(|own| own == robot) =>
            {
                SpaceKind::Robot
            }
            PointKind::Link | PointKind::Attachment => SpaceKind::Other,
            PointKind::Fixed | PointKind::Floor | PointKind::Uncertain => SpaceKind::Fixed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_from_the_origin_voxels_stay_whole() {
        let bounds = Aabb { min: [4e5, 5e6, 0.0], max: [4e5 + 1.0, 5e6 + 1.0, 1.0] };
        let grid = SpaceGrid::over(&bounds, 0.05);
        assert!(grid.size.iter().all(|n| (20..=22).contains(n)), "{:?}", grid.size);
        assert!(grid.index([4e5 + 0.5, 5e6 + 0.5, 0.5]).is_some());
        assert!(grid.index([0.0; 3]).is_none());
        let huge = Aabb { min: [0.0; 3], max: [1e4; 3] };
        assert!(SpaceGrid::over(&huge, 0.05).size.iter().product::<usize>() < 80_000_000);
    }
}
