//! Splits the occupied space above the floor into clusters: connected bodies, over all scans.
//!
//! # Example
//! ```
//! use contract::{Floor, Occupancy};
//!
//! // Two cubes of 10 × 10 × 10 voxels of 5 cm, one metre apart, with 4 points in each voxel.
//! let cube = |x0: i32| (0..1000).map(move |i| ([x0 + i % 10, i / 10 % 10, i / 100], 4));
//! let mut voxels: Vec<_> = cube(0).chain(cube(30)).collect();
//! voxels.sort_by_key(|&([x, y, z], _)| (z, y, x));
//! let occupancy = Occupancy { edge: 0.05, voxels };
//!
//! // No floor level is known, so that all of the occupied space is kept.
//! let clusters = cluster::split(&occupancy, &Floor::default(), &cluster::Settings::default());
//! assert_eq!(clusters.len(), 2);
//! assert_eq!(clusters[0].n_points, 4000);
//! ```
#![forbid(unsafe_code)]

mod above;
mod connect;
mod settings;

pub use settings::Settings;

use contract::{Cluster, Floor, Occupancy};
use geometry::Aabb;

/// Splits the occupied space above the floor into clusters, most points first. Where no floor is
/// known, all of the occupied space is used.
///
/// Voxels below every known level at their place are dropped: mirror images and noise.
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
    // A stable sort: equal clusters stay in the order of their first voxels.
    clusters.sort_by_key(|c| std::cmp::Reverse((c.n_points, c.voxels.len())));
    for (id, cluster) in clusters.iter_mut().enumerate() {
        cluster.id = id as u32;
    }
    clusters
}

#[cfg(test)]
mod tests;
