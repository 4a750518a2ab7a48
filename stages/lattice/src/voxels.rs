//! Planar patches and normals of a scan without known scanner: local planes from the moments of
//! voxels, since there is no lattice. Neither veils nor the side from which a surface was seen can
//! be told.

use crate::Settings;
use crate::patch::{GroundCells, apply, from_sums, in_world, is_level, largest_first, world_rows};
use contract::{PlanePatch, Scan, Tile};
use geometry::{Aabb, Moments, Plane, Vector};

/// Smallest number of points of a voxel with a plane of its own.
const MIN_POINTS: f64 = 6.0;
/// Number of bits of one coordinate in a key; a tile is 128 voxels wide, and any height of a
/// building fits.
const BITS: u32 = 21;
/// Middle of a coordinate's range.
const MIDDLE: i64 = 1 << (BITS - 1);
/// Owner of a voxel without a plane of its own.
const FLAT_NOT: u32 = u32::MAX;
/// Owner of a voxel that belongs to no region.
const FREE: u32 = u32::MAX - 1;

/// Voxels of one tile; buffers are reused.
#[derive(Debug, Default)]
pub(crate) struct VoxelSurface {
    points: Vec<(u64, u32)>,
    /// Voxels, sorted by key.
    cells: Vec<VoxelCell>,
    /// Index of the voxel of each point.
    of_point: Vec<u32>,
}

#[derive(Debug)]
struct VoxelCell {
    key: u64,
    moments: Moments,
    /// Plane in the scan frame; the largest component of its normal is positive.
    plane: Option<Plane>,
    region: u32,
    bounds: [[f32; 3]; 2],
}

/// The plane with the sign for which the largest component of its normal is positive.
fn upright(plane: Plane) -> Plane {
    let n = plane.normal;
    if n[n.iamax()] < 0.0 { plane.flipped() } else { plane }
}

fn pack(at: [i64; 3]) -> u64 {
    let part = |v: i64| (v + MIDDLE).clamp(0, 2 * MIDDLE - 1) as u64;
    part(at[2]) << (2 * BITS) | part(at[1]) << BITS | part(at[0])
}

fn unpack(key: u64) -> [i64; 3] {
    std::array::from_fn(|i| (key >> (BITS * i as u32) & ((1 << BITS) - 1)) as i64 - MIDDLE)
}

impl VoxelSurface {
    fn fill(&mut self, tile: &Tile, settings: &Settings) {
        let edge = settings.surface_voxel;
        self.points.clear();
        self.points.extend(tile.xyz.iter().enumerate().map(|(i, p)| {
            (pack(p.map(|v| geometry::narrow::floor_i32(f64::from(v) / edge).into())), i as u32)
        }));
        self.points.sort_unstable();
        self.cells.clear();
        self.of_point.clear();
        self.of_point.resize(tile.len(), 0);
        for &(key, i) in &self.points {
            let p = tile.xyz[i as usize];
            if self.cells.last().is_none_or(|c| c.key != key) {
                let origin = Vector::from(p.map(f64::from));
                let moments = Moments::new(origin);
                self.cells.push(VoxelCell {
                    key,
                    moments,
                    plane: None,
                    region: FLAT_NOT,
                    bounds: [p, p],
                });
            }
            self.of_point[i as usize] = self.cells.len() as u32 - 1;
            if let Some(cell) = self.cells.last_mut() {
                cell.moments.add(&Vector::from(p.map(f64::from)));
                for k in 0..3 {
                    cell.bounds[0][k] = cell.bounds[0][k].min(p[k]);
                    cell.bounds[1][k] = cell.bounds[1][k].max(p[k]);
                }
            }
        }
        for cell in &mut self.cells {
            if cell.moments.n < MIN_POINTS {
                continue;
            }
            let fit = cell.moments.plane().filter(|f| {
                f.rms <= 2.0 * settings.surface_noise && f.spread[1] >= 2.5 * f.rms.max(0.002)
            });
            if let Some(fit) = fit {
                cell.plane = Some(upright(fit.plane));
                cell.region = FREE;
            }
        }
    }

    fn neighbours(&self, key: u64, out: &mut Vec<usize>) {
        out.clear();
        let [x, y, z] = unpack(key);
        for dz in -1..=1 {
            for dy in -1..=1 {
                let first = pack([x - 1, y + dy, z + dz]);
                let last = pack([x + 1, y + dy, z + dz]);
                let from = self.cells.partition_point(|c| c.key < first);
                out.extend((from..self.cells.len()).take_while(|&i| self.cells[i].key <= last));
            }
        }
    }

    /// Grows a region from cell `seed` and stores its cells in `members`.
    fn grow(&mut self, seed: usize, number: u32, members: &mut Vec<usize>, settings: &Settings) {
        let Some(mut plane) = self.cells[seed].plane else {
            return;
        };
        let cosine = settings.max_normal_tolerance.cos();
        let limit = 3.0 * settings.surface_noise + settings.flatness;
        members.clear();
        members.push(seed);
        self.cells[seed].region = number;
        let mut sums = self.cells[seed].moments;
        let (mut next, mut refit_at) = (0, 4);
        let mut around = Vec::new();
        while next < members.len() {
            self.neighbours(self.cells[members[next]].key, &mut around);
            next += 1;
            for &other in &around {
                let cell = &mut self.cells[other];
                let agrees =
                    cell.plane.is_some_and(|p| p.normal.dot(&plane.normal).abs() >= cosine);
                if cell.region == FREE
                    && agrees
                    && plane.distance(&cell.moments.mean()).abs() <= limit
                {
                    cell.region = number;
                    sums.join(&cell.moments);
                    members.push(other);
                }
            }
            if members.len() >= refit_at {
                refit_at *= 2;
                if let Some(fit) = sums.plane() {
                    plane = upright(fit.plane);
                }
            }
        }
    }

    fn patch(&self, members: &[usize], scan: &Scan, settings: &Settings) -> Option<PlanePatch> {
        let mut sums = self.cells[members[0]].moments;
        for &i in &members[1..] {
            sums.join(&self.cells[i].moments);
        }
        let moments = in_world(&sums, &scan.world_from_scan);
        let fit = moments.plane()?;
        let plane = upright(fit.plane);
        let level = is_level(&plane, settings);
        let local = sums.plane()?.plane.normal;
        let axis = local.iamax();
        let mut columns: Vec<[i64; 3]> = members
            .iter()
            .map(|&i| {
                let mut at = unpack(self.cells[i].key);
                at[axis] = 0;
                at
            })
            .collect();
        columns.sort_unstable();
        columns.dedup();
        let area = columns.len() as f64 * settings.surface_voxel.powi(2) / local[axis].abs();
        let width = fit.spread[1] * 12_f64.sqrt();
        let (min_area, min_width) = if level {
            (settings.min_level_area, settings.min_level_width)
        } else {
            (settings.min_patch_area, settings.min_patch_width)
        };
        if area < min_area || width < min_width || sums.n < settings.min_patch_points as f64 {
            return None;
        }
        let rows = world_rows(&scan.world_from_scan);
        let mut patch = from_sums(scan.id, moments, plane, fit.rms);
        let mut ground = GroundCells::default();
        for &i in members {
            let cell = &self.cells[i];
            let box_of = |k: usize| {
                Aabb { min: cell.bounds[0].map(f64::from), max: cell.bounds[1].map(f64::from) }
                    .corners()[k]
            };
            for k in 0..8 {
                patch.bounds.add(apply(&rows, box_of(k).map(geometry::narrow::local_f32)));
            }
            if level {
                let mean = scan.world_from_scan * geometry::Point::from(cell.moments.mean());
                ground.add([mean.x, mean.y, mean.z], cell.moments.n as u32);
            }
        }
        patch.area = area;
        patch.ground = ground.finish();
        Some(patch)
    }
}

/// Planar patches of a ground tile, largest first.
pub(crate) fn patches(
    tile: &Tile,
    scan: &Scan,
    surface: &mut VoxelSurface,
    settings: &Settings,
) -> Vec<PlanePatch> {
    surface.fill(tile, settings);
    let mut seeds: Vec<usize> =
        (0..surface.cells.len()).filter(|&i| surface.cells[i].plane.is_some()).collect();
    // Voxels with most points first, since their planes are known best.
    seeds.sort_by(|&a, &b| surface.cells[b].moments.n.total_cmp(&surface.cells[a].moments.n));
    let (mut out, mut members) = (Vec::new(), Vec::new());
    for (number, &seed) in seeds.iter().enumerate() {
        if surface.cells[seed].region == FREE {
            surface.grow(seed, number as u32, &mut members, settings);
            out.extend(surface.patch(&members, scan, settings));
        }
    }
    largest_first(&mut out);
    out
}

/// Normals of a tile's points by their voxels, scan frame, largest component positive.
pub(crate) fn normals(
    tile: &Tile,
    surface: &mut VoxelSurface,
    settings: &Settings,
) -> Vec<Option<[f32; 3]>> {
    surface.fill(tile, settings);
    let limit = 3.0 * settings.surface_noise;
    tile.xyz
        .iter()
        .zip(&surface.of_point)
        .map(|(p, &cell)| {
            let plane = surface.cells[cell as usize].plane?;
            let near = plane.distance(&Vector::from(p.map(f64::from))).abs() <= limit;
            near.then(|| plane.normal.map(geometry::narrow::local_f32).into())
        })
        .collect()
}
