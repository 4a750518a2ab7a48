//! Converts the regions of a raster to patches in the world frame, largest first.

use crate::Settings;
use crate::raster::TileRaster;
use crate::regions::{Grown, Regions};
use contract::{PlanePatch, Scan, ScanId};
use geometry::{Aabb, Moments, Plane, Pose, Vector};

/// Edge of a ground cell, metres; must be that of `PlanePatch::ground`.
pub(crate) const GROUND: f64 = 0.25;
/// Smallest cosine of incidence in areas: below, the area of a pixel is mostly noise.
const MIN_COSINE: f32 = 0.01;

/// The patches of all regions that are large enough.
pub(crate) fn patches(
    raster: &TileRaster,
    regions: &Regions,
    scan: &Scan,
    settings: &Settings,
) -> Vec<PlanePatch> {
    let mut out: Vec<PlanePatch> = regions
        .grown
        .iter()
        .filter_map(|grown| patch(raster, regions, grown, scan, settings))
        .collect();
    largest_first(&mut out);
    out
}

/// Sorts patches by area, and those of equal area by their place.
pub(crate) fn largest_first(patches: &mut [PlanePatch]) {
    patches.sort_by(|a, b| {
        let place = |p: &PlanePatch| p.bounds.min;
        let by_place = || {
            let (a, b) = (place(a), place(b));
            (0..3).fold(std::cmp::Ordering::Equal, |o, i| o.then(a[i].total_cmp(&b[i])))
        };
        b.area.total_cmp(&a.area).then_with(by_place)
    });
}

fn patch(
    raster: &TileRaster,
    regions: &Regions,
    grown: &Grown,
    scan: &Scan,
    settings: &Settings,
) -> Option<PlanePatch> {
    let members = &regions.members[grown.members.clone()];
    let moments = in_world(&grown.moments, &scan.world_from_scan);
    let fit = moments.plane()?;
    let towards = scan.world_from_scan.rotation * Vector::from(grown.normal.map(f64::from));
    let plane = if fit.plane.normal.dot(&towards) < 0.0 { fit.plane.flipped() } else { fit.plane };
    let level = is_level(&plane, settings);
    let area = area(raster, members, grown);
    let (min_area, min_width) = if level {
        (settings.min_level_area, settings.min_level_width)
    } else {
        (settings.min_patch_area, settings.min_patch_width)
    };
    if area < min_area || fit.spread[1] * 12_f64.sqrt() < min_width {
        return None;
    }
    let points = members.iter().map(|&at| raster.xyzr[usize::from(at)]);
    let rows = world_rows(&scan.world_from_scan);
    let mut bounds = Aabb::EMPTY;
    let mut ground = GroundCells::default();
    let weight = raster.weight();
    for p in points {
        let w = apply(&rows, [p[0], p[1], p[2]]);
        bounds.add(w);
        if level {
            ground.add(w, weight);
        }
    }
    Some(PlanePatch {
        scan: scan.id,
        plane,
        moments,
        rms: fit.rms,
        bounds,
        area,
        ground: ground.finish(),
    })
}

/// A patch from moments alone, where there is no raster.
pub(crate) fn from_sums(scan: ScanId, moments: Moments, plane: Plane, rms: f64) -> PlanePatch {
    PlanePatch { scan, plane, moments, rms, bounds: Aabb::EMPTY, area: 0.0, ground: Vec::new() }
}

/// Whether a plane is nearly horizontal.
pub(crate) fn is_level(plane: &Plane, settings: &Settings) -> bool {
    plane.normal.z.abs() >= settings.level_tilt.cos()
}

/// Area of a region from the solid angle, range and incidence of its pixels, m².
fn area(raster: &TileRaster, members: &[u16], grown: &Grown) -> f64 {
    let mut area = 0.0_f64;
    for &at in members {
        let p = raster.xyzr[usize::from(at)];
        let n = grown.normal;
        let cosine = (n[0] * p[0] + n[1] * p[1] + n[2] * p[2]).abs() / p[3];
        let solid = raster.row_step * raster.col_step[usize::from(at) / raster.side];
        area += f64::from(p[3] * p[3] * solid / cosine.max(MIN_COSINE));
    }
    area
}

/// Converts moments from the scan frame to the world frame.
pub(crate) fn in_world(scan: &Moments, world_from_scan: &Pose) -> Moments {
    let turn = world_from_scan.rotation.to_rotation_matrix();
    let m = turn.matrix();
    Moments {
        origin: m * scan.origin + world_from_scan.translation.vector,
        n: scan.n,
        sum: m * scan.sum,
        outer: m * scan.outer * m.transpose(),
    }
}

/// A pose as three rows of four `f64`, for inner loops.
pub(crate) type WorldRows = [[f64; 4]; 3];

/// `world_from_scan` as rows.
pub(crate) fn world_rows(world_from_scan: &Pose) -> WorldRows {
    let m = world_from_scan.to_homogeneous();
    std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)]))
}

/// Converts a point of the scan frame to the world, metres.
#[inline]
pub(crate) fn apply(m: &WorldRows, p: [f32; 3]) -> [f64; 3] {
    let [x, y, z] = p.map(f64::from);
    std::array::from_fn(|r| m[r][0] * x + m[r][1] * y + m[r][2] * z + m[r][3])
}

/// Collects ground cells; runs of points in one cell are summed before they are sorted.
#[derive(Debug, Default)]
pub(crate) struct GroundCells {
    runs: Vec<([i32; 2], u32, f64)>,
}

impl GroundCells {
    /// Adds `n` points at a place in the world, metres.
    #[inline]
    pub(crate) fn add(&mut self, w: [f64; 3], n: u32) {
        let cell = [
            geometry::narrow::floor_i32(w[0] / GROUND),
            geometry::narrow::floor_i32(w[1] / GROUND),
        ];
        let z = w[2] * f64::from(n);
        match self.runs.last_mut() {
            Some(run) if run.0 == cell => {
                run.1 += n;
                run.2 += z;
            }
            _ => self.runs.push((cell, n, z)),
        }
    }

    /// The cells, sorted, without duplicates.
    pub(crate) fn finish(mut self) -> Vec<([i32; 2], u32, f64)> {
        // A stable sort, so that sums are always added in the same order.
        self.runs.sort_by_key(|run| run.0);
        self.runs.dedup_by(|later, kept| {
            let same = later.0 == kept.0;
            if same {
                kept.1 += later.1;
                kept.2 += later.2;
            }
            same
        });
        self.runs.shrink_to_fit();
        self.runs
    }
}
