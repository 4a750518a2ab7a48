//! Matches points with the facet of a posture that is nearest to them, where they may lie on it.

use geometry::{Point, Pose, Vector};

use super::placed::{FINE_REACH, NearFacet, Placed};
use crate::problem::Problem;
use crate::state::Hypothesis;

/// Share of the gate by which a point may lie beside the nearest facet.
const BESIDE_GATE: f64 = 0.33;
/// Cosine below which a beam cannot have come from a facet's front.
const MIN_FACING: f64 = 0.05;

/// A point with the facet of the model that is nearest to it, base frame.
pub(crate) struct Match {
    pub(crate) link: usize,
    /// Point, base frame.
    pub(crate) q: Vector,
    /// Normal, base frame.
    pub(crate) n: Vector,
    pub(crate) r: f64,
}

/// The model as it stands.
pub(crate) struct Matching<'a> {
    problem: &'a Problem<'a>,
    /// Farthest distance of a point from its facet, metres.
    gate: f64,
    placed: Placed<'a>,
    /// Base from links.
    poses: Vec<Pose>,
    base_from_local: Pose,
    /// Local frame.
    scanners: Vec<Option<Point>>,
}

impl<'a> Matching<'a> {
    pub(crate) fn new(problem: &'a Problem<'_>, h: &Hypothesis, gate: f64) -> Self {
        Self {
            problem,
            gate,
            placed: Placed::all(problem.prepared, h, gate),
            poses: problem.prepared.model.poses(&h.posture),
            base_from_local: h.local_from_base.inverse(),
            scanners: (0..problem.scene.views.len())
                .map(|v| problem.scene.scanner(v as u16))
                .collect(),
        }
    }

    /// Matches of the points that have one, in the order of the points.
    pub(crate) fn each(&self, points: &[u32], mut take: impl FnMut(Match)) {
        self.placed.nearest_each(self.problem.scene, points, |i, _, near| {
            near.and_then(|near| self.matched(i, near)).into_iter().for_each(&mut take);
        });
    }

    /// A point with a facet; `None` where it is too far from it or cannot have come from it.
    #[inline]
    fn matched(&self, i: u32, NearFacet { link, facet, distance }: NearFacet) -> Option<Match> {
        if distance > self.gate {
            return None;
        }
        let m = &self.problem.scene.points[i as usize];
        let pose = &self.poses[link];
        let facet = &self.problem.prepared.links[link].fields.facets[facet];
        let n = pose.rotation * Vector::from(facet.n.map(f64::from));
        let q = self.base_from_local * Point::from(m.p.map(f64::from));
        let x = pose * Point::from(facet.x.map(f64::from));
        let r = n.dot(&(q - x));
        // Beside the surface's edge its plane means nothing: what hangs on a flange is wider than
        // it.
        let beside = (distance * distance - r * r).max(0.0).sqrt();
        if self.gate < FINE_REACH && beside > self.problem.beside(link).max(BESIDE_GATE * self.gate)
        {
            return None;
        }
        // A facet that faces away from the scanner cannot have given this point.
        if let Some(scanner) = &self.scanners[usize::from(m.view)] {
            let ray = (self.base_from_local * scanner) - q;
            if n.dot(&ray) <= MIN_FACING * ray.norm() {
                return None;
            }
        }
        Some(Match { link, q: q.coords, n, r })
    }
}
