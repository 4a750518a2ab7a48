//! A cluster in; out come the boxes of what may be bodies in it: the whole of a small one; of walls, fences and what
//! touches them, the parts that are not flat.

use contract::{Cluster, Voxel};
use geometry::{Aabb, Vector};
use nalgebra::Matrix3;
use std::collections::BTreeMap;

use crate::RegionSettings;

/// Edge of the columns that structure is cut into, metres: no robot is flat over so much.
const COLUMN: f64 = 1.0;
/// Structure higher than this above its lowest point is no robot's, metres: ceilings, crane ways.
const MAX_HEIGHT: f64 = 3.6;
/// Thickness below which a column is a wall, fence or panel, metres, one sigma: voxels of 5 cm make a plane 2 cm thick.
const FLAT: f64 = 0.045;
/// Fewest voxels of a column that is not flat.
const MIN_VOXELS: usize = 12;

/// Boxes and numbers of points.
pub(crate) fn bodies(cluster: &Cluster, settings: &RegionSettings) -> Vec<(Aabb, u64)> {
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
    columns.retain(|_, voxels| voxels.len() >= MIN_VOXELS && !is_flat(voxels, cluster.edge));
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

/// Whether voxels lie on one upright plane.
fn is_flat(voxels: &[Voxel], edge: f64) -> bool {
    let n = voxels.len() as f64;
    let at = |v: &Voxel| Vector::from(v.map(f64::from)) * edge;
    let mean = voxels.iter().map(at).sum::<Vector>() / n;
    let spread: Matrix3<f64> =
        voxels.iter().map(|v| (at(v) - mean) * (at(v) - mean).transpose()).sum();
    (spread / n).symmetric_eigenvalues().min().max(0.0).sqrt() < FLAT
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box-shaped hall of walls with a body of 1 × 1 × 1.5 m that touches one of them.
    #[test]
    fn walls_are_left_out_and_what_touches_them_is_kept() {
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
        let found = bodies(&cluster, &RegionSettings::default());
        let body = Aabb { min: [10.0, 0.05, 0.0], max: [11.0, 1.05, 1.5] };
        let holds = |b: &Aabb| {
            (0..3).all(|i| b.min[i] <= body.min[i] + 0.2 && b.max[i] >= body.max[i] - 0.2)
        };
        assert_eq!(found.iter().filter(|(b, _)| holds(b)).count(), 1, "{found:?}");
        // Beside it only the corners of the hall.
        assert!(found.iter().all(|(b, _)| b.size()[0] < 3.5 && b.size()[1] < 3.5), "{found:?}");
    }
}
