//! Look-up of the cluster that a position belongs to.

use contract::{Cluster, Voxel};
use geometry::narrow::floor_i32;

/// Clusters indexed by voxel.
pub(crate) struct ClusterLookup {
    /// Inverse of the voxel edge, 1/m.
    inverse: f64,
    /// Voxels and their clusters, sorted by voxel.
    voxels: Vec<(Voxel, u32)>,
}

impl ClusterLookup {
    pub(crate) fn new(clusters: &[Cluster]) -> Self {
        let edge = clusters.first().map_or(1.0, |c| c.edge);
        let own = |c: &Cluster| c.voxels.iter().map(|v| (*v, c.id + 1)).collect::<Vec<_>>();
        let mut voxels: Vec<(Voxel, u32)> = clusters.iter().flat_map(own).collect();
        voxels.sort_unstable();
        Self { inverse: 1.0 / edge, voxels }
    }

    /// For each position (world frame, metres) the number of its cluster plus 1; 0 for the floor
    /// and for scattered points.
    pub(crate) fn of(&self, world: &[[f64; 3]]) -> Vec<u32> {
        // Consecutive points mostly fall into the same voxel.
        let mut last: Option<(Voxel, u32)> = None;
        let one = |p: &[f64; 3]| {
            let voxel = p.map(|v| floor_i32(v * self.inverse));
            match last {
                Some((at, body)) if at == voxel => body,
                _ => {
                    let found = self.voxels.binary_search_by_key(&voxel, |entry| entry.0);
                    let body = found.map_or(0, |at| self.voxels[at].1);
                    last = Some((voxel, body));
                    body
                }
            }
        };
        world.iter().map(one).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Aabb;

    #[test]
    fn places_belong_to_the_cluster_of_their_voxel() {
        let cluster = |id: u32, voxels: Vec<Voxel>| Cluster {
            id,
            voxels,
            edge: 0.05,
            n_points: 9,
            bounds: Aabb::EMPTY,
        };
        let bodies = ClusterLookup::new(&[
            cluster(0, vec![[0, 0, 0], [-1, 0, 0]]),
            cluster(1, vec![[0, 9, 0]]),
        ]);
        let places = [[0.01, 0.01, 0.01], [-0.01, 0.01, 0.01], [0.02, 0.46, 0.0], [1.0, 0.0, 0.0]];
        assert_eq!(bodies.of(&places), [1, 1, 2, 0]);
        assert_eq!(ClusterLookup::new(&[]).of(&places), [0; 4]);
    }
}
