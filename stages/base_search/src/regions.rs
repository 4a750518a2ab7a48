//! Groups clusters to regions that are worth a search: clusters that may be parts of one object and
//! are large enough for a robot. Also makes guessed planes for bases where no plane was found.

use contract::{Cluster, InstallationPlane, Region};
use geometry::{Aabb, Plane, Point, Vector};
use std::ops::Range;

use crate::body_boxes::body_boxes;
use crate::settings::RegionSettings;

/// The regions that are worth a search, sorted by descending number of points of their clusters.
#[must_use]
pub fn regions(clusters: &[Cluster], settings: &RegionSettings) -> Vec<Region> {
    let mut groups: Vec<(Aabb, u64)> = Vec::new();
    for (bounds, n_points) in clusters.iter().flat_map(|c| body_boxes(c, settings)) {
        let size = bounds.size();
        if size.iter().fold(0.0_f64, |a, b| a.max(*b)) < settings.min_seed {
            continue;
        }
        let (mut bounds, mut n_points) = (bounds, n_points);
        // A grown group may come near another one: repeat until none is near.
        while let Some(at) =
            groups.iter().position(|(b, _)| b.grown(settings.join_gap).touches(&bounds))
        {
            let (b, n) = groups.remove(at);
            bounds = bounds.union(&b);
            n_points += n;
        }
        groups.push((bounds, n_points));
    }
    groups.retain(|(b, n)| {
        let size = b.size();
        *n >= settings.min_points
            && size[2] >= settings.min_height
            && size.iter().fold(0.0_f64, |a, v| a.max(*v)) >= settings.min_extent
    });
    groups.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.min[0].total_cmp(&b.0.min[0])));
    groups.iter().flat_map(|(b, _)| cut(b, settings)).map(|b| local(&b, settings.margin)).collect()
}

/// Distance between guessed planes, metres: the last tolerance of the base search covers half of
/// it.
pub(crate) const GUESS_STEP: f64 = 0.03;
/// How far below the lowest point of a region a base may stand, metres: a camera often cuts off the
/// lower half of a base.
const GUESS_BELOW: f64 = 0.5;

/// Range of the heights of stands above the floor, metres. The fit corrects smaller heights itself;
/// gantries are higher.
const STANDS: (f64, f64) = (0.12, 1.5);

/// Limit of the guessed planes: six metres.
const MAX_GUESSES: f64 = 200.0;

/// Level planes at all heights of a box (world frame, metres), for regions without a known
/// installation plane. Their area is zero, which means that no points support them and the fit does
/// not keep their height.
#[must_use]
pub fn guessed_planes(world: &Aabb) -> Vec<InstallationPlane> {
    level_planes(world, world.min[2] - GUESS_BELOW..world.max[2] - 0.3)
}

/// Level planes at the heights that a stand on a floor may have, within a box. `floor` is the
/// height of the floor, metres. A base may hide the whole top of its stand.
#[must_use]
pub fn stand_planes(world: &Aabb, floor: f64) -> Vec<InstallationPlane> {
    level_planes(world, floor + STANDS.0..(floor + STANDS.1).min(world.max[2] - 0.3))
}

/// Largest thickness of a plate between a mounting plane and the base bolted to it, metres.
const THICKEST: f64 = 0.15;

/// Planes in front of walls, ceilings and tilted plates, for mounting plates and brackets whose
/// rims are too narrow to be found as planes. Their area is zero.
#[must_use]
pub fn raised_planes(mounts: &[InstallationPlane]) -> Vec<InstallationPlane> {
    let n = (THICKEST / GUESS_STEP).round() as usize;
    let raised = |mount: &InstallationPlane, k: usize| {
        let (by, normal) = (k as f64 * GUESS_STEP, mount.plane.normal);
        let shift = |p: [f64; 3]| [0, 1, 2].map(|i| p[i] + by * normal[i]);
        let bounds = Aabb { min: shift(mount.bounds.min), max: shift(mount.bounds.max) };
        let plane = Plane { normal, offset: mount.plane.offset + by };
        InstallationPlane { plane, bounds, area: 0.0, is_floor: false }
    };
    mounts.iter().flat_map(|mount| (1..=n).map(move |k| raised(mount, k))).collect()
}

/// Whether the plane `high` is `n` guesses above `low`. Guessed planes in front of several walls
/// follow one another in the list, too.
pub(crate) fn are_stacked(low: &Plane, high: &Plane, n: isize) -> bool {
    let off = high.offset - low.offset - n as f64 * GUESS_STEP;
    low.normal == high.normal && off.abs() < 0.1 * GUESS_STEP
}

/// Level planes of a box at a range of heights (world frame, metres), every 3 cm (`GUESS_STEP`).
/// Their area is zero: no points support them, and the fit does not keep their height.
#[must_use]
pub fn level_planes(world: &Aabb, heights: Range<f64>) -> Vec<InstallationPlane> {
    let Range { start: low, end: high } = heights;
    let n = ((high - low) / GUESS_STEP).ceil().clamp(0.0, MAX_GUESSES) as usize;
    let level = |k: usize| {
        let z = low + k as f64 * GUESS_STEP;
        let bounds =
            Aabb { min: [world.min[0], world.min[1], z], max: [world.max[0], world.max[1], z] };
        let plane = Plane { normal: Vector::z(), offset: z };
        InstallationPlane { plane, bounds, area: 0.0, is_floor: false }
    };
    (0..n).map(level).collect()
}

/// Cuts a box into overlapping boxes of at most `max_extent` on the ground.
fn cut(bounds: &Aabb, settings: &RegionSettings) -> Vec<Aabb> {
    let spans = |i: usize| -> Vec<(f64, f64)> {
        let (low, high) = (bounds.min[i], bounds.max[i]);
        if high - low <= settings.max_extent {
            return vec![(low, high)];
        }
        let step = settings.max_extent - settings.overlap;
        let n = ((high - low - settings.overlap) / step).ceil().max(1.0);
        (0..n as usize)
            .map(|k| low + k as f64 * step)
            .map(|a| (a, (a + settings.max_extent).min(high)))
            .collect()
    };
    let mut out = Vec::new();
    for (x0, x1) in spans(0) {
        for (y0, y1) in spans(1) {
            out.push(Aabb { min: [x0, y0, bounds.min[2]], max: [x1, y1, bounds.max[2]] });
        }
    }
    out
}

fn local(bounds: &Aabb, margin: f64) -> Region {
    let grown = bounds.grown(margin);
    let c = grown.center();
    // An origin in whole centimetres is short to write and exact to add.
    let origin = Point::from([0, 1, 2].map(|i| (c[i] * 100.0).round() / 100.0));
    let shift = |p: [f64; 3]| std::array::from_fn(|i| p[i] - origin[i]);
    Region { origin, bounds: Aabb { min: shift(grown.min), max: shift(grown.max) } }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plates_before_a_wall_are_guessed_up_to_a_hand() {
        let normal = Vector::new(0.6, -0.8, 0.0);
        let bounds = Aabb { min: [-1.0, -1.0, 0.0], max: [1.0, 1.0, 3.0] };
        let plane = Plane { normal, offset: 0.25 };
        let wall = InstallationPlane { plane, bounds, area: 5.0, is_floor: false };
        let raised = raised_planes(&[wall]);
        assert_eq!(raised.len(), 5);
        for (k, plane) in (1..).zip(&raised) {
            let by = 0.03 * f64::from(k);
            assert!((plane.plane.offset - 0.25 - by).abs() < 1e-12 && plane.is_guess());
            let moved = Vector::from(plane.bounds.min) - Vector::from(bounds.min);
            assert!((moved - by * normal).norm() < 1e-12);
        }
    }

    #[test]
    fn planes_before_another_wall_are_not_above_those_before_the_first() {
        let bounds = Aabb { min: [-1.0, -1.0, 0.0], max: [1.0, 1.0, 3.0] };
        let wall = |normal: Vector, offset: f64| InstallationPlane {
            plane: Plane { normal, offset },
            bounds,
            area: 5.0,
            is_floor: false,
        };
        let walls = [wall(Vector::x(), 0.2), wall(Vector::x(), 1.7), wall(Vector::y(), 0.2)];
        let planes: Vec<Plane> = raised_planes(&walls).iter().map(|p| p.plane).collect();
        for (a, low) in (0_isize..).zip(&planes) {
            for (b, high) in (0_isize..).zip(&planes) {
                assert_eq!(are_stacked(low, high, b - a), a / 5 == b / 5, "{a} {b}");
            }
        }
    }
}
