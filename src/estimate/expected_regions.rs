//! A preview of the regions that a run would search, from a sample of the points of all inputs.
//! Floor and voxels are computed more simply than in a run; clusters and regions come from the same
//! stages.

use crate::engine::{AllThreads, Engine};
use crate::job::Settings;

use contract::{Cluster, Floor, FloorLevel, Format, Input, Occupancy, Region, Result, Voxel};
use geometry::Plane;
use ingest::{GlanceSample, Sources};
use serde::Serialize;
use std::collections::BTreeMap;

/// Number of points that are decoded of an input, by format: about a second of one thread.
const DECODED: [(Format, u64); 8] = [
    (Format::E57, 20_000_000),
    (Format::Las, 20_000_000),
    (Format::Laz, 3_000_000),
    (Format::Ptx, 6_000_000),
    (Format::Pts, 3_000_000),
    (Format::Xyz, 3_000_000),
    (Format::Ply, 5_000_000),
    (Format::Pcd, 5_000_000),
];
/// Number of sampled points of all inputs: some twenty per surface voxel in a hall of 20 m x 20 m.
const KEPT: u64 = 3_000_000;
/// Edge of the columns with which the extent of a floor is measured, metres.
const COLUMN: f64 = 0.25;
/// Thickness of the layers among which the floor is searched, metres.
const LAYER: f64 = 0.05;
/// Least share of the columns of the widest layer that a floor covers: robots and machines hide
/// much of it, and ceilings are as wide.
const FLOOR_SHARE: f64 = 0.35;
/// Edge of a cell of the floor's heights, metres.
const CELL: f64 = 1.0;
/// Greatest distance of a cell's height from the layer, metres: floors lean.
const OFF: f64 = 0.15;
/// Step of heights within a cell, metres.
const STEP: f64 = 0.02;

/// Regions that a run would probably search.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ExpectedRegions {
    /// The regions, largest first.
    pub regions: Vec<ExpectedRegion>,
    /// Whether a floor was found; otherwise a run tries all heights.
    pub has_floor: bool,
}

/// A region that would be searched.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ExpectedRegion {
    /// Its extent along each axis, metres.
    pub size: [f64; 3],
    /// Estimated number of points above the floor in it.
    pub n_points: u64,
    /// Number of voxels above the floor that hold points.
    pub n_voxels: usize,
}

/// Samples the points of all inputs. A broken input gives no points: the run reports what is wrong
/// with it.
pub(super) fn sample(
    sources: &Sources,
    settings: &Settings,
    engine: &Engine,
) -> Result<ExpectedRegions> {
    let inputs = sources.opened();
    let all: u64 = inputs.iter().filter_map(|input| sources.n_stated(input.id)).sum();
    let of_input = |input: &Input| {
        let n = sources.n_stated(input.id).unwrap_or(0);
        let share = n as f64 / all.max(1) as f64;
        let most = DECODED.iter().find(|(format, _)| *format == input.format).map_or(0, |d| d.1);
        let sample = GlanceSample {
            n_decoded: (most as f64 * share) as u64,
            n_kept: (KEPT as f64 * share) as u64,
        };
        let pool = engine.pool()?;
        let glance = pool.install(|| sources.glance(input.id, sample, &AllThreads))?;
        // Number of points of the input that each sampled point represents.
        let each = n as f64 / glance.points.len().max(1) as f64;
        Ok((glance.points, each))
    };
    let seen: Vec<(Vec<[f64; 3]>, f64)> = inputs.iter().map(of_input).collect::<Result<_>>()?;
    Ok(regions_of(&seen, settings))
}

/// Regions of these points, each of which represents a number of points.
fn regions_of(seen: &[(Vec<[f64; 3]>, f64)], settings: &Settings) -> ExpectedRegions {
    let edge = settings.lattice.voxel;
    let mut voxels: BTreeMap<[i32; 3], f64> = BTreeMap::new();
    for (points, each) in seen {
        for p in points {
            // Sorted by height, then rows: the order of an occupancy.
            let [x, y, z] = p.map(|v| (v / edge).floor() as i32);
            *voxels.entry([z, y, x]).or_default() += each;
        }
    }
    let floor = floor(seen);
    let count = |(v, n): ([i32; 3], f64)| ([v[2], v[1], v[0]], n.round().max(1.0) as u32);
    let voxels: Vec<(Voxel, u32)> = voxels.into_iter().map(count).collect();
    let clusters = cluster::split(&Occupancy { edge, voxels }, &floor, &settings.cluster);
    let regions = base_search::regions(&clusters, &settings.region);
    let regions = regions.iter().map(|region| searched(&clusters, region)).collect();
    ExpectedRegions { regions, has_floor: !floor.levels.is_empty() }
}

/// Size, points and voxels of the clusters in a region.
pub(super) fn searched(clusters: &[Cluster], region: &Region) -> ExpectedRegion {
    let world = region.world_bounds();
    let mut out = ExpectedRegion { size: region.bounds.size(), n_points: 0, n_voxels: 0 };
    for cluster in clusters.iter().filter(|c| c.bounds.touches(&world)) {
        let is_in = |v: &&Voxel| world.contains(v.map(|i| (f64::from(i) + 0.5) * cluster.edge));
        let n = cluster.voxels.iter().filter(is_in).count();
        let share = n as f64 / cluster.voxels.len().max(1) as f64;
        out.n_voxels += n;
        out.n_points += (share * cluster.n_points as f64) as u64;
    }
    out
}

/// The lowest wide layer of the points, with its heights; empty where no layer is wide.
fn floor(seen: &[(Vec<[f64; 3]>, f64)]) -> Floor {
    let all = || seen.iter().flat_map(|(points, _)| points);
    let mut columns: Vec<[i32; 3]> = all()
        .map(|p| [p[2] / LAYER, p[0] / COLUMN, p[1] / COLUMN].map(|v| v.floor() as i32))
        .collect();
    columns.sort_unstable();
    columns.dedup();
    let layers: Vec<(i32, usize)> =
        columns.chunk_by(|a, b| a[0] == b[0]).map(|layer| (layer[0][0], layer.len())).collect();
    let widest = layers.iter().map(|(_, n)| *n).max().unwrap_or(0);
    let is_wide = |n: usize| {
        n as f64 * COLUMN * COLUMN >= MIN_AREA && n as f64 >= FLOOR_SHARE * widest as f64
    };
    let Some((layer, _)) = layers.iter().find(|(_, n)| is_wide(*n)) else {
        return Floor::default();
    };
    let middle = (f64::from(*layer) + 0.5) * LAYER;
    let mut cells: BTreeMap<[i32; 2], BTreeMap<i32, (u32, f64)>> = BTreeMap::new();
    for p in all().filter(|p| (p[2] - middle).abs() < OFF) {
        let cell = [p[0], p[1]].map(|v| (v / CELL).floor() as i32);
        let step = cells.entry(cell).or_default().entry((p[2] / STEP).floor() as i32).or_default();
        *step = (step.0 + 1, step.1 + p[2]);
    }
    let height = |(cell, steps): (&[i32; 2], &BTreeMap<i32, (u32, f64)>)| {
        let (n, sum) = steps.values().max_by_key(|(n, _)| *n).copied().unwrap_or((1, middle));
        (*cell, sum / f64::from(n))
    };
    let heights: Vec<([i32; 2], f64)> = cells.iter().map(height).collect();
    let level = FloorLevel {
        plane: Plane { normal: geometry::Vector::z(), offset: middle },
        waviness: 0.0,
        scatter: 0.0,
        area: heights.len() as f64 * CELL * CELL,
        cell: CELL,
        heights,
    };
    Floor { levels: vec![level], planes: Vec::new() }
}

/// Least area of a floor, m².
const MIN_AREA: f64 = 2.0;

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of an upright box's sides and top, 2 cm apart.
    fn cuboid(min: [f64; 3], max: [f64; 3], points: &mut Vec<[f64; 3]>) {
        let n = [0, 1, 2].map(|i| ((max[i] - min[i]) / 0.02).round() as i32);
        let at = |i: usize, k: i32| min[i] + 0.02 * f64::from(k);
        for k in 0..n[2] {
            for i in 0..n[0] {
                points.extend([[at(0, i), min[1], at(2, k)], [at(0, i), max[1], at(2, k)]]);
            }
            for j in 0..n[1] {
                points.extend([[min[0], at(1, j), at(2, k)], [max[0], at(1, j), at(2, k)]]);
            }
        }
        for i in 0..n[0] {
            points.extend((0..n[1]).map(|j| [at(0, i), at(1, j), max[2]]));
        }
    }

    fn hall(boxes: &[([f64; 3], [f64; 3])]) -> ExpectedRegions {
        let mut points = Vec::new();
        // A floor that leans, a ceiling as wide, and walls.
        for i in 0..500 {
            for j in 0..400 {
                let (x, y) = (0.02 * f64::from(i) + 0.01, 0.02 * f64::from(j) + 0.01);
                points.extend([[x, y, -2.0 + 0.002 * x], [x, y, 4.0]]);
            }
        }
        for k in 0..300 {
            let z = -2.0 + 0.02 * f64::from(k);
            points.extend((0..500).flat_map(|i| {
                let x = 0.02 * f64::from(i);
                [[x, 0.0, z], [x, 8.0, z]]
            }));
        }
        boxes.iter().for_each(|(min, max)| cuboid(*min, *max, &mut points));
        regions_of(&[(points, 7.0)], &Settings::default())
    }

    #[test]
    fn a_glance_finds_what_stands_on_a_floor_and_neither_floor_nor_walls_nor_ceiling() {
        let boxes = [([2.0, 2.0, -1.98], [2.8, 2.8, -0.5]), ([6.0, 4.0, -1.98], [7.5, 5.0, -1.0])];
        let seen = hall(&boxes);
        assert!(seen.has_floor);
        assert_eq!(seen.regions.len(), 2, "{seen:?}");
        for (min, max) in boxes {
            let fits = |r: &ExpectedRegion| {
                // A region reaches 0.4 m beyond what stands in it, and voxels are 5 cm.
                (0..2).all(|i| (r.size[i] - (max[i] - min[i]) - 0.8).abs() < 0.15)
            };
            assert!(seen.regions.iter().any(fits), "{seen:?}");
        }
        assert!(seen.regions.iter().all(|r| r.n_points > 10_000 && r.n_voxels > 1000), "{seen:?}");
        assert_eq!(hall(&[]).regions, [], "an empty hall has nothing to search");
    }

    #[test]
    fn nothing_has_no_floor() {
        assert_eq!(regions_of(&[], &Settings::default()), ExpectedRegions::default());
    }
}
