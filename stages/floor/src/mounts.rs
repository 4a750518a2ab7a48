//! Patches that do not face up in, planes that something may be bolted to out: ceilings, walls, tilted plates.

use crate::union::Union;
use contract::{InstallationPlane, PlanePatch, ScanId};
use geometry::{Aabb, Moments, Vector};

/// Least area of a patch that is kept for this, m²: less says little of where a plane lies.
pub(crate) const MIN_PATCH: f64 = 0.02;
/// Least area of such a plane, m²: half a plate of 0.5 m × 0.5 m, the rest hidden by the foot.
const MIN_AREA: f64 = 0.06;
/// Planes of patches that differ by less are one, metres, and their normals, radians (3°).
const SAME: (f64, f64) = (0.02, 0.052);
/// Gap between patches of one plane, metres: what a foot hides.
const GAP: f64 = 0.5;
/// Most planes of one place that look down, and of those that do not: a hall has more and larger walls than plates.
const MOST: usize = 8;
/// A normal that points so far down is a ceiling's, cosine (45°).
const DOWN: f64 = -0.7;

/// The largest planes of these patches, those that look down and the others each largest first; normals to the side that was
/// seen.
#[must_use]
pub fn mounts(patches: &[&PlanePatch]) -> Vec<InstallationPlane> {
    let mut union = Union::new(patches.len());
    for (i, a) in patches.iter().enumerate() {
        for (j, b) in patches.iter().enumerate().skip(i + 1) {
            if one_plane(a, b) {
                union.join(i, j);
            }
        }
    }
    let mut groups: Vec<(usize, usize)> = (0..patches.len()).map(|i| (union.find(i), i)).collect();
    groups.sort_unstable();
    let mut out: Vec<InstallationPlane> = groups
        .chunk_by(|a, b| a.0 == b.0)
        .filter_map(|group| plane_of(&group.iter().map(|g| patches[g.1]).collect::<Vec<_>>()))
        .collect();
    out.sort_by(|a, b| b.area.total_cmp(&a.area));
    let (mut down, mut others): (Vec<_>, Vec<_>) =
        out.into_iter().partition(|p| p.plane.normal.z < DOWN);
    down.truncate(MOST);
    others.truncate(MOST);
    down.extend(others);
    down
}

fn one_plane(a: &PlanePatch, b: &PlanePatch) -> bool {
    if a.plane.normal.dot(&b.plane.normal) < SAME.1.cos() || !a.bounds.grown(GAP).touches(&b.bounds)
    {
        return false;
    }
    let step = |of: &PlanePatch, at: Vector| of.plane.distance(&at).abs();
    step(a, b.moments.mean()).max(step(b, a.moments.mean())) < SAME.0
}

/// Joined plane of patches, each weighted by its area, with the largest area that one scan sees of it.
fn plane_of(members: &[&PlanePatch]) -> Option<InstallationPlane> {
    let first = members.first()?;
    let mut moments = Moments::new(first.moments.mean());
    let mut bounds = Aabb::EMPTY;
    let mut areas: Vec<(ScanId, f64)> = Vec::new();
    for patch in members {
        moments.join(&patch.moments);
        bounds = bounds.union(&patch.bounds);
        match areas.iter_mut().find(|a| a.0 == patch.scan) {
            Some(own) => own.1 += patch.area,
            None => areas.push((patch.scan, patch.area)),
        }
    }
    let area = areas.iter().map(|a| a.1).fold(0.0, f64::max);
    let plane = moments.plane()?.plane;
    let plane = if plane.normal.dot(&first.plane.normal) < 0.0 { plane.flipped() } else { plane };
    (area >= MIN_AREA).then_some(InstallationPlane { plane, bounds, area, is_floor: false })
}
