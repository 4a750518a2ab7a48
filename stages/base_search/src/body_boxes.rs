//! Finds the boxes of possible bodies in a cluster: all of a small cluster; of walls, fences and
//! what touches them, the parts that are not flat.

use contract::{Cluster, Voxel};
use geometry::{Aabb, Vector};
use nalgebra::Matrix3;
use std::collections::BTreeMap;

use crate::settings::RegionSettings;

/// Edge of the columns that a structure is cut into, metres. No robot is flat over this length.
const COLUMN: f64 = 1.0;
/// Height above the lowest point of a structure beyond which voxels are ignored, metres: ceilings
/// and crane runways.
const MAX_HEIGHT: f64 = 3.6;
/// Thickness of a column (one standard deviation, metres) below which it is a wall, fence or panel:
/// voxels of 5 cm give a plane 2 cm.
const FLAT: f64 = 0.045;
/// Where walls meet: largest share of a column's voxels that lie on neither of two upright planes.
const MAX_SHARE_LEFT_OVER: f64 = 0.08;
/// Where walls meet: limit of these voxels, however small their share is.
const MAX_LEFT_OVER: f64 = 60.0;
/// Least height of a corner of a room, metres. A lower one may be the body of a machine.
const MIN_CORNER: f64 = 2.4;
/// Number of pairs of voxels that are tried for a plane through them.
const N_PAIRS: usize = 48;
/// Fewest voxels of a column that is not discarded.
const MIN_VOXELS: usize = 12;

/// The boxes of possible bodies (world frame, metres), each with its number of points.
pub(crate) fn body_boxes(cluster: &Cluster, settings: &RegionSettings) -> Vec<(Aabb, u64)> {
    let size = cluster.bounds.size();
    if size[0].max(size[1]) <= settings.max_body {
        return vec![(cluster.bounds, cluster.n_points)];
    }
    let per_column = (COLUMN / cluster.edge).round().max(1.0) as i32;
    let top = cluster.bounds.min[2] + MAX_HEIGHT;
    let mut columns: BTreeMap<[i32; 2], Vec<Voxel>> = BTreeMap::new();
    for voxel in &cluster.voxels {
        if f64::from(voxel[2]) * cluster.edge < top {
            let at = [voxel[0].div_euclid(per_column), voxel[1].div_euclid(per_column)];
            columns.entry(at).or_default().push(*voxel);
        }
    }
    columns.retain(|_, voxels| {
        voxels.len() >= MIN_VOXELS
            && !is_flat(voxels, cluster.edge)
            && !is_corner(voxels, cluster.edge)
    });
    let share = cluster.n_points as f64 / cluster.voxels.len().max(1) as f64;
    let mut out = Vec::new();
    while let Some((&seed, _)) = columns.first_key_value() {
        let (mut bounds, mut n, mut open) = (Aabb::EMPTY, 0, vec![seed]);
        while let Some(at) = open.pop() {
            let Some(voxels) = columns.remove(&at) else { continue };
            n += voxels.len();
            for voxel in voxels {
                let low = voxel.map(|i| f64::from(i) * cluster.edge);
                bounds.add(low);
                bounds.add(low.map(|v| v + cluster.edge));
            }
            open.extend([[1, 0], [-1, 0], [0, 1], [0, -1]].map(|d| [at[0] + d[0], at[1] + d[1]]));
        }
        out.push((bounds, (n as f64 * share) as u64));
    }
    out
}

/// Whether the voxels of a column lie on one plane.
fn is_flat(voxels: &[Voxel], edge: f64) -> bool {
    let n = voxels.len() as f64;
    let at = |v: &Voxel| Vector::from(v.map(f64::from)) * edge;
    let mean = voxels.iter().map(at).sum::<Vector>() / n;
    let spread: Matrix3<f64> =
        voxels.iter().map(|v| (at(v) - mean) * (at(v) - mean).transpose()).sum();
    (spread / n).symmetric_eigenvalues().min().max(0.0).sqrt() < FLAT
}

/// A pile: the voxels above each other at one place on the ground.
#[derive(Debug, Clone, Copy)]
struct Pile {
    at: [f64; 2],
    n: f64,
    low: i32,
    high: i32,
}

/// Whether the voxels of a column lie on two high upright planes, as where walls meet.
fn is_corner(voxels: &[Voxel], edge: f64) -> bool {
    let mut piles: BTreeMap<[i32; 2], Pile> = BTreeMap::new();
    for v in voxels {
        let at = [v[0], v[1]];
        let new = Pile { at: at.map(|i| f64::from(i) * edge), n: 0.0, low: v[2], high: v[2] };
        let pile = piles.entry(at).or_insert(new);
        (pile.n, pile.low, pile.high) = (pile.n + 1.0, pile.low.min(v[2]), pile.high.max(v[2]));
    }
    let mut left: Vec<Pile> = piles.into_values().collect();
    for _ in 0..2 {
        let Some(line) = best_line(&left) else { return false };
        let (on, off): (Vec<Pile>, Vec<Pile>) = left.iter().partition(|pile| !is_off(pile, &line));
        let low = on.iter().map(|p| p.low).min().unwrap_or(0);
        let high = on.iter().map(|p| p.high).max().unwrap_or(0);
        if f64::from(high - low) * edge < MIN_CORNER {
            return false;
        }
        left = off;
    }
    let over: f64 = left.iter().map(|p| p.n).sum();
    over <= (MAX_SHARE_LEFT_OVER * voxels.len() as f64).min(MAX_LEFT_OVER)
}

/// A line on the ground.
#[derive(Debug, Clone, Copy)]
struct GroundLine {
    /// A point on it, metres.
    point: [f64; 2],
    /// Its unit normal.
    normal: [f64; 2],
}

fn is_off(pile: &Pile, line: &GroundLine) -> bool {
    let (p, normal) = (line.point, line.normal);
    let off = (pile.at[0] - p[0]) * normal[0] + (pile.at[1] - p[1]) * normal[1];
    off.abs() > 2.0 * FLAT
}

/// The line through two piles that the fewest voxels lie off.
fn best_line(piles: &[Pile]) -> Option<GroundLine> {
    // Voxels far from each other in their order are far from each other in space.
    let n = piles.len();
    let pair = |k: usize| (piles[k * n / N_PAIRS].at, piles[(k * n / N_PAIRS + n / 2) % n].at);
    let lines = (0..if n > 0 { N_PAIRS } else { 0 }).map(pair).filter_map(|(a, b)| {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let length = dx.hypot(dy);
        (length > 2.0 * FLAT).then(|| GroundLine { point: a, normal: [-dy / length, dx / length] })
    });
    let over = |line: &GroundLine| -> f64 {
        piles.iter().filter(|pile| is_off(pile, line)).map(|pile| pile.n).sum()
    };
    lines.min_by(|a, b| over(a).total_cmp(&over(b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box-shaped hall of walls with a body of 1 × 1 × 1.5 m that touches one of them.
    #[test]
    fn walls_are_left_out_and_objects_that_touch_them_are_kept() {
        let mut voxels = Vec::new();
        for k in 0..80 {
            for i in 0..400 {
                voxels.extend([[i, 0, k], [i, 399, k], [0, i, k], [399, i, k]]);
            }
        }
        for k in 0..30 {
            for i in 0..20 {
                voxels.extend([
                    [200 + i, 1, k],
                    [200 + i, 21, k],
                    [200, 1 + i, k],
                    [220, 1 + i, k],
                ]);
            }
        }
        voxels.sort_unstable_by_key(|v| (v[2], v[1], v[0]));
        voxels.dedup();
        let edge = 0.05;
        let bounds = Aabb { min: [0.0; 3], max: [20.0, 20.0, 4.0] };
        let n_points = voxels.len() as u64;
        let cluster = Cluster { id: 0, voxels, edge, n_points, bounds };
        let found = body_boxes(&cluster, &RegionSettings::default());
        let body = Aabb { min: [10.0, 0.05, 0.0], max: [11.0, 1.05, 1.5] };
        let holds = |b: &Aabb| {
            (0..3).all(|i| b.min[i] <= body.min[i] + 0.2 && b.max[i] >= body.max[i] - 0.2)
        };
        assert_eq!(found.iter().filter(|(b, _)| holds(b)).count(), 1, "{found:?}");
        // There is nothing else, not even the corners of the hall.
        assert_eq!(found.len(), 1, "{found:?}");
    }
}
