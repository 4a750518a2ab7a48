//! Finds planes that something may be bolted to among patches that do not face up: ceilings, walls
//! and tilted plates.

use crate::union::Union;
use contract::{InstallationPlane, PlanePatch, ScanId};
use geometry::{Aabb, Moments, Vector};

/// Smallest area of a patch that is used, m²: a smaller one determines its plane poorly.
pub(crate) const MIN_PATCH: f64 = 0.02;
/// Smallest area of such a plane, m²: half of a rim of 6 cm about the foot of a small arm.
const MIN_AREA: f64 = 0.03;
/// Largest distance between patches of one plane, metres.
const SAME_PLANE_DISTANCE: f64 = 0.02;
/// Largest angle between the normals of patches of one plane, radians (3°).
const SAME_PLANE_ANGLE: f64 = 0.052;
/// Largest gap between patches of one plane, metres: what a foot hides.
const GAP: f64 = 0.5;
/// Largest numbers of planes of one place: of those that look down, of those that lean, and of the
/// others. A hall has more and larger walls than plates, and less is seen of a plate's rim around a
/// foot than of any cabinet, so that one common limit would keep cabinets only.
const MOST: [usize; 3] = [8, 12, 8];
/// A plane looks down (ceiling) if the z of its normal is below this, the cosine of 135°.
const DOWN: f64 = -0.7;
/// A plane leans (plate) if the z of its normal is above this, 10° from upright.
const LEANS: f64 = 0.17;

/// The largest planes of these patches: those that look down, those that lean, and the others, each
/// group with the largest first. Normals point to the side that was seen.
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
    let kinds: [fn(f64) -> bool; 3] =
        [|z| z < DOWN, |z| z > LEANS, |z| (DOWN..=LEANS).contains(&z)];
    let largest = |(is_kind, most): (fn(f64) -> bool, usize)| {
        out.iter()
            .filter(move |p| is_kind(p.plane.normal.z))
            .take(most)
            .cloned()
            .collect::<Vec<_>>()
    };
    kinds.into_iter().zip(MOST).flat_map(largest).collect()
}

fn one_plane(a: &PlanePatch, b: &PlanePatch) -> bool {
    if a.plane.normal.dot(&b.plane.normal) < SAME_PLANE_ANGLE.cos()
        || !a.bounds.grown(GAP).touches(&b.bounds)
    {
        return false;
    }
    let step = |of: &PlanePatch, at: Vector| of.plane.distance(&at).abs();
    step(a, b.moments.mean()).max(step(b, a.moments.mean())) < SAME_PLANE_DISTANCE
}

/// The joined plane of patches, each weighted by its area; its own area is the largest that a
/// single scan sees.
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

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Plane;

    /// A square with this side (metres), centre and normal.
    fn patch(at: [f64; 3], normal: Vector, side: f64) -> PlanePatch {
        let frame = Plane { normal, offset: 0.0 }.frame();
        let (mut moments, mut bounds) = (Moments::new(Vector::zeros()), Aabb::EMPTY);
        for i in 0..100 {
            let [x, y] = [i % 10, i / 10].map(|k| side * (f64::from(k) / 9.0 - 0.5));
            let p = Vector::from(at) + frame * Vector::new(x, y, 0.0);
            moments.add(&p);
            bounds.add(p.into());
        }
        let (scan, plane) = (ScanId(0), Plane { normal, offset: normal.dot(&Vector::from(at)) });
        let area = side * side;
        PlanePatch { scan, plane, moments, rms: 0.002, bounds, area, ground: Vec::new() }
    }

    #[test]
    fn the_rim_of_a_leaning_plate_is_kept_among_many_cabinets() {
        let cabinet =
            |k: i32| patch([f64::from(k), 3.0 + 0.1 * f64::from(k), 1.0], -Vector::y(), 0.8);
        let cabinets = (0..20).map(cabinet);
        let (ceiling, leaning) = (-Vector::z(), Vector::new(0.3_f64.sin(), 0.0, 0.3_f64.cos()));
        let plate = patch([5.0, 0.0, 0.7], leaning, 0.2);
        let crumb = patch([9.0, 0.0, 0.7], leaning, 0.15);
        let patches: Vec<PlanePatch> =
            cabinets.chain([patch([5.0, 0.0, 4.0], ceiling, 0.5), plate, crumb]).collect();
        let found = mounts(&patches.iter().collect::<Vec<_>>());
        let faces = |n: Vector| found.iter().filter(|p| p.plane.normal.dot(&n) > 0.99).count();
        assert_eq!(found.len(), 10);
        assert_eq!([faces(ceiling), faces(leaning), faces(-Vector::y())], [1, 1, 8]);
    }
}
