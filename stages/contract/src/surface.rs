//! Planes and occupied space of a whole plant, reduced to what the stages floor and cluster need.

use crate::{ScanId, Weigh};
use geometry::{Aabb, Moments, Plane};
use serde::{Deserialize, Serialize};

/// A planar region of one tile, in the world frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlanePatch {
    /// The scan that saw the region.
    pub scan: ScanId,
    /// Least-squares plane. Its normal points to the scanner, or upwards where that is unknown.
    pub plane: Plane,
    /// Moments of the points; patches are joined by joining their moments.
    pub moments: Moments,
    /// RMS distance of the points from the plane, metres.
    pub rms: f64,
    /// Bounds of the points in the world, metres.
    pub bounds: Aabb,
    /// Area that the points cover, m²: from solid angle, range and incidence, not from the
    /// outline.
    pub area: f64,
    /// Ground cells that the points touch, sorted: index (floor(x/0.25 m), floor(y/0.25 m)),
    /// number of points, and sum of their z (metres). Empty where the patch is not nearly
    /// horizontal.
    pub ground: Vec<([i32; 2], u32, f64)>,
}

/// A piece of surface that several scans measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Overlap {
    /// Unit normal towards the scanners, world.
    pub normal: [f64; 3],
    /// For each scan the centroid of its points on the surface, world, metres.
    pub seen: Vec<(ScanId, [f64; 3])>,
}

/// Occupied voxels with the number of points in each, sorted by (z, y, x), without duplicates.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Occupancy {
    /// Edge of a voxel, metres. Voxel `[i, j, k]` spans `[i·edge, (i+1)·edge)` along world x, and
    /// likewise along y and z.
    pub edge: f64,
    /// Index of each voxel and number of points in it.
    pub voxels: Vec<([i32; 3], u32)>,
}

impl Occupancy {
    /// Adds the points of `other`, voxel by voxel; both must have the same edge unless one is
    /// empty.
    pub fn merge(&mut self, other: Self) {
        if self.voxels.is_empty() {
            *self = other;
            return;
        }
        debug_assert!(other.voxels.is_empty() || self.edge == other.edge, "voxels of two sizes");
        let key = |v: &([i32; 3], u32)| (v.0[2], v.0[1], v.0[0]);
        let mine = std::mem::take(&mut self.voxels);
        let mut out = Vec::with_capacity(mine.len().max(other.voxels.len()));
        let (mut a, mut b) = (mine.into_iter().peekable(), other.voxels.into_iter().peekable());
        while let (Some(x), Some(y)) = (a.peek(), b.peek()) {
            match key(x).cmp(&key(y)) {
                std::cmp::Ordering::Less => out.extend(a.next()),
                std::cmp::Ordering::Greater => out.extend(b.next()),
                std::cmp::Ordering::Equal => {
                    out.push((x.0, x.1.saturating_add(y.1)));
                    a.next();
                    b.next();
                }
            }
        }
        out.extend(a);
        out.extend(b);
        self.voxels = out;
    }
}

/// Summary of one tile for the stages floor and cluster.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TileSummary {
    /// Number of points.
    pub n_points: u64,
    /// Number of veil points: mixed pixels between a near edge and the surface behind it.
    pub n_veils: u64,
    /// Planar regions, largest first.
    pub patches: Vec<PlanePatch>,
    /// Occupied space; veil points are left out.
    pub occupancy: Occupancy,
}

impl Weigh for TileSummary {
    fn weight_bytes(&self) -> usize {
        let ground: usize = self.patches.iter().map(|p| p.ground.len() * 24).sum();
        size_of::<Self>()
            + self.patches.len() * size_of::<PlanePatch>()
            + ground
            + self.occupancy.voxels.len() * 16
    }
}

/// One level of the floor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FloorLevel {
    /// Mean plane; its normal points upwards.
    pub plane: Plane,
    /// RMS deviation of the cells' heights from the mean plane (waviness), metres.
    pub waviness: f64,
    /// Standard deviation of the points from the height of their cell, metres: noise, registration
    /// errors, and waves shorter than a cell.
    pub scatter: f64,
    /// Area, m².
    pub area: f64,
    /// Edge of a cell of the height map, metres.
    pub cell: f64,
    /// Height of the floor in each cell with index (floor(x/cell), floor(y/cell)), metres; sorted.
    pub heights: Vec<([i32; 2], f64)>,
}

impl FloorLevel {
    /// Height of the floor at (x, y), metres: interpolated between the heights at the middles of
    /// cells, or that of the mean plane where these are missing. `None` farther than two cells from
    /// any known cell.
    #[must_use]
    pub fn height(&self, x: f64, y: f64) -> Option<f64> {
        let (u, v) = (x / self.cell - 0.5, y / self.cell - 0.5);
        let (i, j) = (u.floor(), v.floor());
        let (fu, fv) = (u - i, v - j);
        let (mut sum, mut weight) = (0.0, 0.0);
        for (di, dj, w) in [
            (0, 0, (1.0 - fu) * (1.0 - fv)),
            (1, 0, fu * (1.0 - fv)),
            (0, 1, (1.0 - fu) * fv),
            (1, 1, fu * fv),
        ] {
            if let Some(h) = self.cell_height([i as i32 + di, j as i32 + dj]) {
                sum += (w + 1e-6) * h;
                weight += w + 1e-6;
            }
        }
        if weight > 0.0 {
            return Some(sum / weight);
        }
        let near = (-2..=2).any(|di| {
            (-2..=2).any(|dj| self.cell_height([i as i32 + di, j as i32 + dj]).is_some())
        });
        near.then(|| self.mean_height(x, y))
    }

    /// Height of the mean plane at (x, y), metres.
    #[must_use]
    pub fn mean_height(&self, x: f64, y: f64) -> f64 {
        let n = self.plane.normal;
        (self.plane.offset - n.x * x - n.y * y) / n.z
    }

    fn cell_height(&self, at: [i32; 2]) -> Option<f64> {
        self.heights.binary_search_by_key(&at, |c| c.0).ok().map(|i| self.heights[i].1)
    }
}

/// A horizontal plane that a robot may stand on: a floor level, or a stand, pedestal or table top.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct InstallationPlane {
    /// The plane; its normal points upwards, away from the body that carries the plane.
    pub plane: Plane,
    /// Bounds of the points on it in the world, metres.
    pub bounds: Aabb,
    /// Area covered by points, m²; 0 for a height that is assumed without points.
    pub area: f64,
    /// Whether it is a floor level.
    pub is_floor: bool,
}

impl InstallationPlane {
    /// Whether no points carry the plane: its height is assumed because no plane was found.
    #[must_use]
    pub fn is_guess(&self) -> bool {
        self.area == 0.0
    }
}

/// The floor of the plant, with its levels and the smaller planes that a robot may stand on.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Floor {
    /// The levels, largest first; empty where no floor was found.
    pub levels: Vec<FloorLevel>,
    /// Floor levels and horizontal planes of the size of a stand, sorted by height, then area.
    pub planes: Vec<InstallationPlane>,
}

impl Floor {
    /// Height of `p` (world, metres) above the nearest floor level below it, metres. A level counts
    /// as below if it is at most `slack` metres above `p`. `None` where no level is known.
    #[must_use]
    pub fn height_above(&self, p: [f64; 3], slack: f64) -> Option<f64> {
        self.levels
            .iter()
            .filter_map(|level| level.height(p[0], p[1]))
            .map(|h| p[2] - h)
            .filter(|h| *h >= -slack)
            .min_by(f64::total_cmp)
    }
}
