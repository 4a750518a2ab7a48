//! The floor of a cloud, and its points near a place.

use geometry::robust::tukey;
use geometry::{Moments, Pose, Vector};
use nalgebra::Point3;

/// Points of a floor in its own frame, sorted by cells of the plan.
pub(crate) struct FloorPoints {
    /// The frame of the floor, z up, in the frame of the search.
    pub(crate) pose: Pose,
    /// The points, metres, by cells.
    pub(crate) points: Vec<[f32; 3]>,
    grid: FloorGrid,
    /// First point of each cell, and the end.
    firsts: Vec<u32>,
}

/// Cells of a plan.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FloorGrid {
    pub(crate) low: [f32; 2],
    pub(crate) cell: f32,
    pub(crate) n: [usize; 2],
}

/// Height of a bin in which the floor is looked for, metres.
const BIN: f64 = 0.02;
/// Greatest height of a point above or below the plane, metres: real floors are no planes.
const BAND: f64 = 0.03;
/// Number of points that the plane is fitted to.
const FITTED: usize = 100_000;
/// Fewest points of a floor.
const FEWEST: usize = 5_000;
/// Farthest that a floor reaches from its middle, metres.
const REACH: f64 = 150.0;
/// Edge of a cell of the index, metres.
const CELL: f32 = 0.25;

impl FloorGrid {
    /// Cells of an edge over points.
    pub(crate) fn over(points: &[[f32; 3]], cell: f32) -> Self {
        let mut low = [f32::INFINITY; 2];
        let mut high = [f32::NEG_INFINITY; 2];
        for p in points {
            for a in 0..2 {
                low[a] = low[a].min(p[a]);
                high[a] = high[a].max(p[a]);
            }
        }
        let n = [0, 1].map(|a| ((high[a] - low[a]) / cell) as usize + 1);
        Self { low, cell, n }
    }

    /// The cell of a point within the grid.
    pub(crate) fn cell_of(&self, p: &[f32; 3]) -> usize {
        let at = [0, 1].map(|a| (((p[a] - self.low[a]) / self.cell) as usize).min(self.n[a] - 1));
        at[1] * self.n[0] + at[0]
    }

    /// Order of points by cells, and the first of each cell.
    pub(crate) fn sorted(&self, points: &[[f32; 3]]) -> (Vec<u32>, Vec<u32>) {
        let mut firsts = vec![0u32; self.n[0] * self.n[1] + 1];
        for p in points {
            firsts[self.cell_of(p) + 1] += 1;
        }
        for i in 1..firsts.len() {
            firsts[i] += firsts[i - 1];
        }
        let mut next = firsts.clone();
        let mut order = vec![0u32; points.len()];
        for (i, p) in points.iter().enumerate() {
            let slot = &mut next[self.cell_of(p)];
            order[*slot as usize] = i as u32;
            *slot += 1;
        }
        (order, firsts)
    }
}

impl FloorPoints {
    /// The floor of a cloud up to a distance from its middle; `None` where there are too few points
    /// of one.
    pub(crate) fn find(points: &[[f32; 3]], reach: f64) -> Option<Self> {
        let pose = frame(points)?;
        let local = pose.inverse().to_matrix().cast::<f32>();
        let mut own: Vec<[f32; 3]> = Vec::new();
        for p in points {
            let z = local.row(2);
            let height = z[0] * p[0] + z[1] * p[1] + z[2] * p[2] + z[3];
            if height.abs() < BAND as f32 {
                let along = |r: usize| {
                    let m = local.row(r);
                    m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3]
                };
                own.push([along(0), along(1), height]);
            }
        }
        let reach = reach.min(REACH) as f32;
        own.retain(|p| p[0].abs() < reach && p[1].abs() < reach);
        if own.len() < FEWEST {
            return None;
        }
        let grid = FloorGrid::over(&own, CELL);
        let (order, firsts) = grid.sorted(&own);
        let points = order.into_iter().map(|i| own[i as usize]).collect();
        Some(Self { pose, points, grid, firsts })
    }

    /// At most so many points at distances from a place within bounds, evenly chosen.
    pub(crate) fn near(&self, at: [f64; 2], [least, most]: [f64; 2], n: usize) -> Vec<[f64; 3]> {
        let mut out = Vec::new();
        let mut rows: Vec<(u32, u32)> = Vec::new();
        let cell = f64::from(self.grid.cell);
        let to = |v: f64, a: usize| (v - f64::from(self.grid.low[a])) / cell;
        let [from_y, to_y] = [to(at[1] - most, 1), to(at[1] + most, 1)];
        for y in from_y.max(0.0) as usize..=(to_y.max(0.0) as usize).min(self.grid.n[1] - 1) {
            let [from_x, to_x] = [to(at[0] - most, 0).max(0.0), to(at[0] + most, 0)];
            if to_x < 0.0 || from_x as usize >= self.grid.n[0] {
                continue;
            }
            let x = [from_x as usize, (to_x as usize).min(self.grid.n[0] - 1)];
            let first = self.firsts[y * self.grid.n[0] + x[0]];
            rows.push((first, self.firsts[y * self.grid.n[0] + x[1] + 1]));
        }
        let total: usize = rows.iter().map(|(a, b)| (b - a) as usize).sum();
        // The ring has a part of the square only.
        let every = (total as f64 * 0.8 / n as f64).max(1.0);
        let mut next = 0.0;
        let mut seen = 0.0;
        for (a, b) in rows {
            for p in &self.points[a as usize..b as usize] {
                seen += 1.0;
                if seen < next {
                    continue;
                }
                next += every;
                let p = p.map(f64::from);
                let r = (p[0] - at[0]).hypot(p[1] - at[1]);
                if r >= least && r < most {
                    out.push(p);
                }
            }
        }
        out
    }
}

/// The frame of the floor: the mode of heights below the median, and a robust plane.
fn frame(points: &[[f32; 3]]) -> Option<Pose> {
    let every = points.len().div_ceil(2_000_000).max(1);
    let mut heights: Vec<f64> = points.iter().step_by(every).map(|p| f64::from(p[2])).collect();
    let middle = geometry::robust::median(&mut heights)?;
    let lowest = heights.iter().fold(middle, |m, z| m.min(*z)).max(middle - 50.0);
    let mut bins = vec![0usize; ((middle - lowest) / BIN) as usize + 2];
    for z in heights.iter().filter(|z| **z <= middle && **z >= lowest) {
        bins[((z - lowest) / BIN) as usize] += 1;
    }
    let most = (0..bins.len()).max_by_key(|i| (bins[*i], bins.len() - i))?;
    let level = lowest + (most as f64 + 0.5) * BIN;
    let near: Vec<Vector> = points
        .iter()
        .filter(|p| (f64::from(p[2]) - level).abs() < 0.3)
        .map(|p| Vector::from(p.map(f64::from)))
        .collect();
    let every = near.len().div_ceil(FITTED).max(1);
    let (mut normal, mut center) = (Vector::z(), Vector::new(0.0, 0.0, level));
    for width in [0.06, 0.04, 0.03, 0.02, 0.02, 0.02] {
        let mut moments = Moments::new(center);
        for p in near.iter().step_by(every) {
            let w = tukey(normal.dot(&(p - center)), width);
            if w > 0.0 {
                let q = p - center;
                moments.n += w;
                moments.sum += q * w;
                moments.outer += q * q.transpose() * w;
            }
        }
        if moments.n < 100.0 {
            return None;
        }
        let mean = moments.sum / moments.n;
        let spread = moments.outer / moments.n - mean * mean.transpose();
        let eigen = spread.symmetric_eigen();
        let least = eigen.eigenvalues.imin();
        let axis = eigen.eigenvectors.column(least).into_owned();
        normal = if axis.z < 0.0 { -axis } else { axis };
        center += mean;
    }
    if normal.z < 0.9 {
        return None;
    }
    let turn = nalgebra::UnitQuaternion::rotation_between(&Vector::z(), &normal)?;
    Some(Pose::from_parts(Point3::from(center).coords.into(), turn))
}
