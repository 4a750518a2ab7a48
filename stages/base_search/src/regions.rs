//! Clusters in; out come the regions of the world that are worth a search: groups of clusters that
//! may be parts of one thing, not too small to be a robot.

use contract::{Cluster, InstallationPlane, Region};
use geometry::{Aabb, Plane, Point, Vector};

use crate::body_boxes::bodies;

/// What is tuned.
#[derive(Debug, Clone, PartialEq)]
pub struct RegionSettings {
    /// Clusters whose boxes come this near (metres) are one region: a thin arm may be cut from its
    /// body by shadow.
    pub join_gap: f64,
    /// How far a region reaches beyond its clusters, metres.
    pub margin: f64,
    /// Smallest height of a region, metres: no robot folds lower.
    pub min_height: f64,
    /// Smallest larger edge of a region, metres.
    pub min_extent: f64,
    /// Fewest points of a region.
    pub min_points: u64,
    /// A cluster smaller than this (metres, larger edge) joins a region but does not found one.
    pub min_seed: f64,
    /// Largest edge of a region on the ground, metres; larger ones are cut into overlapping
    /// squares.
    pub max_extent: f64,
    /// How far such squares overlap, metres: the reach of a large robot.
    pub overlap: f64,
    /// A cluster longer than this (metres) is structure, walls and fences and what touches them:
    /// what is flat of it is left out, the rest taken apart.
    pub max_body: f64,
}

impl Default for RegionSettings {
    fn default() -> Self {
        Self {
            join_gap: 0.15,
            margin: 0.4,
            min_height: 0.25,
            min_extent: 0.3,
            min_points: 300,
            min_seed: 0.2,
            max_extent: 12.0,
            overlap: 3.0,
            max_body: 6.0,
        }
    }
}

/// The regions worth a search, by size of what founds them, largest first.
#[must_use]
pub fn regions(clusters: &[Cluster], settings: &RegionSettings) -> Vec<Region> {
    let mut groups: Vec<(Aabb, u64)> = Vec::new();
    for (bounds, n_points) in clusters.iter().flat_map(|c| bodies(c, settings)) {
        let size = bounds.size();
        if size.iter().fold(0.0_f64, |a, b| a.max(*b)) < settings.min_seed {
            continue;
        }
        let (mut bounds, mut n_points) = (bounds, n_points);
        // Growing may bring the group near another one: repeat until nothing joins.
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

/// Distance between guessed heights, metres: the last tolerance of the base search forgives half of
/// it.
pub(crate) const GUESS_STEP: f64 = 0.03;
/// How far below what is seen a foot may stand, metres: a camera often cuts off the lower half of a
/// base.
const GUESS_BELOW: f64 = 0.5;

/// Heights above the floor that a stand may have, metres: lower ones the fit takes up, higher ones
/// are gantries.
const STANDS: (f64, f64) = (0.12, 1.5);

/// Most guessed heights: six metres.
const MAX_GUESSES: f64 = 200.0;

/// Level planes at all heights of a box, where no plane is known to stand on. Their area is zero:
/// no points carry them, so that a fit does not hold on to their height.
#[must_use]
pub fn guessed_planes(world: &Aabb) -> Vec<InstallationPlane> {
    level_planes(world, (world.min[2] - GUESS_BELOW, world.max[2] - 0.3))
}

/// The same above a floor (height, metres) in a box: a foot may hide all of the stand's top under
/// it.
#[must_use]
pub fn stand_planes(world: &Aabb, floor: f64) -> Vec<InstallationPlane> {
    level_planes(world, (floor + STANDS.0, (floor + STANDS.1).min(world.max[2] - 0.3)))
}

/// Thickest plate between a wall, a ceiling or a leaning plate and what is bolted to it, metres.
const THICKEST: f64 = 0.15;

/// Planes before walls, ceilings and leaning plates, as plates and brackets lie on them whose rims
/// are too narrow to be planes of their own. Their area is zero, too.
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

/// Whether one guessed plane is so many guesses above another: those before several walls follow
/// one another, too.
pub(crate) fn are_stacked(low: &Plane, high: &Plane, n: isize) -> bool {
    let off = high.offset - low.offset - n as f64 * GUESS_STEP;
    low.normal == high.normal && off.abs() < 0.1 * GUESS_STEP
}

fn level_planes(world: &Aabb, (low, high): (f64, f64)) -> Vec<InstallationPlane> {
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

/// Squares of at most `max_extent` that overlap and cover the box.
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
    // Whole centimetres keep the origin short to write and exact to add.
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
