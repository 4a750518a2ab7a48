//! Collects pieces of surface that several scans saw, with the place where each scan has it. Like
//! robots, they tell how the registrations of the scans differ.

use contract::{Overlap, PlanePatch, ScanId};
use geometry::Vector;
use geometry::narrow::floor_i32;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Edge of the cells in which patches form one piece, metres: floors and walls are flat to two
/// millimetres within it.
const EDGE: f64 = 1.0;
/// Smallest number of points of one scan on a piece.
const MIN_POINTS: f64 = 50.0;
/// Cosine of the largest angle between the normals of two scans on a piece (1.5°); beyond, it is no
/// common surface.
const ALIKE: f64 = 0.999_66;
/// Largest distance between the surfaces of two scans, metres; beyond, they are two surfaces.
const APART: f64 = 0.02;

/// A cell, and the axis and side to which its surface faces (the axis nearest to the normal).
type SurfaceCell = ([i32; 3], u8);

/// What each scan saw of each piece.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Overlaps(BTreeMap<SurfaceCell, Vec<ScanSurface>>);

/// What one scan saw of one piece.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct ScanSurface {
    scan: ScanId,
    n: f64,
    /// Sums of places (metres) and of normals over its points.
    place: Vector,
    normal: Vector,
}

impl Overlaps {
    pub(crate) fn add(&mut self, patch: &PlanePatch) {
        let (n, middle, normal) = (patch.moments.n, patch.moments.mean(), patch.plane.normal);
        let cell = [0, 1, 2].map(|i| floor_i32(middle[i] / EDGE));
        let axis = normal.iamax();
        let key = (cell, 2 * axis as u8 + u8::from(normal[axis] > 0.0));
        let seen = ScanSurface { scan: patch.scan, n, place: middle * n, normal: normal * n };
        self.seen(key, seen);
    }

    pub(crate) fn join(&mut self, later: Self) {
        later.0.into_iter().for_each(|(key, all)| all.into_iter().for_each(|s| self.seen(key, s)));
    }

    fn seen(&mut self, key: SurfaceCell, seen: ScanSurface) {
        let all = self.0.entry(key).or_default();
        match all.iter_mut().find(|known| known.scan == seen.scan) {
            Some(known) => {
                known.n += seen.n;
                known.place += seen.place;
                known.normal += seen.normal;
            }
            None => all.push(seen),
        }
    }

    /// The pieces that at least two scans saw.
    pub(crate) fn finish(self) -> Vec<Overlap> {
        self.0.into_values().filter_map(overlap).collect()
    }
}

fn overlap(mut all: Vec<ScanSurface>) -> Option<Overlap> {
    all.retain(|seen| seen.n >= MIN_POINTS);
    if all.len() < 2 {
        return None;
    }
    let normal = all.iter().map(|seen| seen.normal.normalize()).sum::<Vector>().normalize();
    let middle = all.iter().map(|seen| seen.place / seen.n).sum::<Vector>() / all.len() as f64;
    let is_it = |seen: &ScanSurface| {
        let off = normal.dot(&(seen.place / seen.n - middle));
        seen.normal.normalize().dot(&normal) > ALIKE && off.abs() < APART
    };
    all.iter().all(is_it).then(|| Overlap {
        normal: normal.into(),
        seen: all.iter().map(|seen| (seen.scan, (seen.place / seen.n).into())).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Aabb, Moments, Plane};

    fn patch(scan: u32, z: f64, tilt: f64) -> PlanePatch {
        let mut moments = Moments::new(Vector::zeros());
        for i in 0..100 {
            let (x, y) = (0.3 + 0.004 * f64::from(i % 10), 0.4 + 0.004 * f64::from(i / 10));
            moments.add(&Vector::new(x, y, z));
        }
        let normal = Vector::new(tilt.sin(), 0.0, tilt.cos());
        let (scan, plane) = (ScanId(scan), Plane { normal, offset: z });
        PlanePatch {
            scan,
            plane,
            moments,
            rms: 0.002,
            bounds: Aabb::EMPTY,
            area: 0.1,
            ground: Vec::new(),
        }
    }

    #[test]
    fn a_surface_seen_by_two_scans_gives_their_difference() {
        let overlaps = |patches: &[PlanePatch]| {
            let mut all = Overlaps::default();
            patches.iter().for_each(|patch| all.add(patch));
            all.finish()
        };
        let found = overlaps(&[patch(0, 0.5, 0.0), patch(1, 0.503, 0.0), patch(0, 0.5, 0.0)]);
        assert_eq!(found.len(), 1);
        let z = |k: usize| found[0].seen[k].1[2];
        assert!((z(1) - z(0) - 0.003).abs() < 1e-12 && found[0].normal == [0.0, 0.0, 1.0]);
        // A single scan, two surfaces, and two surfaces at an angle give no overlap.
        assert!(overlaps(&[patch(0, 0.5, 0.0), patch(0, 0.52, 0.0)]).is_empty());
        assert!(overlaps(&[patch(0, 0.5, 0.0), patch(1, 0.56, 0.0)]).is_empty());
        assert!(overlaps(&[patch(0, 0.5, 0.0), patch(1, 0.5, 0.1)]).is_empty());
    }
}
