//! Occupied space and floor in, clusters out: connected sets of what stands above the floor, over
//! all scans.
#![forbid(unsafe_code)]

mod above;
mod connect;

use contract::{Cluster, Floor, Occupancy, Voxel};
use geometry::Aabb;

/// Settings of the cluster stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Empty voxels that a cluster may bridge: 1, since thin and distant parts leave holes at 5
    /// cm.
    pub gap: i32,
    /// Least height of a voxel's bottom above the floor, metres: three times the noise of a common
    /// scanner.
    pub clearance: f64,
    /// Depth below a level down to which a voxel still counts as that level's noise or dirt,
    /// metres.
    pub slack: f64,
    /// Fewest points of a cluster: fewer are dust.
    pub min_points: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { gap: 1, clearance: 0.012, slack: 0.15, min_points: 10 }
    }
}

/// Clusters of what stands above the floor, most points first. Where no floor is known, of
/// everything.
///
/// What lies below every known level at its place is dropped: mirror images and noise.
#[must_use]
pub fn split(occupancy: &Occupancy, floor: &Floor, settings: &Settings) -> Vec<Cluster> {
    let kept = above::above(occupancy, floor, settings);
    let sets = connect::connect(&kept, settings.gap.max(0));
    let n_sets = sets.iter().max().map_or(0, |&m| m as usize + 1);
    let mut clusters: Vec<Cluster> = (0..n_sets)
        .map(|_| Cluster {
            id: 0,
            voxels: Vec::new(),
            edge: occupancy.edge,
            n_points: 0,
            bounds: Aabb::EMPTY,
        })
        .collect();
    for (&(voxel, n), &set) in kept.iter().zip(&sets) {
        let cluster = &mut clusters[set as usize];
        cluster.voxels.push(voxel);
        cluster.n_points += u64::from(n);
        let low = voxel.map(|i| f64::from(i) * occupancy.edge);
        cluster.bounds.add(low);
        cluster.bounds.add(low.map(|v| v + occupancy.edge));
    }
    clusters.retain(|c| c.n_points >= settings.min_points);
    // Stable: equal ones stay in the order of their first voxels.
    clusters.sort_by_key(|c| std::cmp::Reverse((c.n_points, c.voxels.len())));
    for (id, cluster) in clusters.iter_mut().enumerate() {
        cluster.id = id as u32;
    }
    clusters
}

/// A voxel with the number of points in it.
type Counted = (Voxel, u32);

#[cfg(test)]
mod tests;
