//! A posture and points in; each point that may lie on the model, with the facet that is nearest to
//! it, out.

use geometry::{Point, Pose, Vector};

use crate::beam::Hypothesis;
use crate::placed::{Near, Placed};
use crate::refine::{FINE_REACH, Refine};

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
    refine: &'a Refine<'a>,
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
    pub(crate) fn new(refine: &'a Refine<'_>, h: &Hypothesis, gate: f64) -> Self {
        Self {
            refine,
            gate,
            placed: Placed::all(refine.prepared, h, gate),
            poses: refine.prepared.model.poses(&h.posture),
            base_from_local: h.local_from_base.inverse(),
            scanners: (0..refine.scene.views.len())
                .map(|v| refine.scene.scanner(v as u16))
                .collect(),
        }
    }

    /// Those of the points that match, in their order.
    pub(crate) fn each(&self, points: &[u32], mut take: impl FnMut(Match)) {
        self.placed.nearest_each(self.refine.scene, points, |i, _, near| {
            near.and_then(|near| self.matched(i, near)).into_iter().for_each(&mut take);
        });
    }

    /// A point with a facet; `None` where it is too far from it or cannot have come from it.
    #[inline]
    fn matched(&self, i: u32, Near { link, facet, distance }: Near) -> Option<Match> {
        if distance > self.gate {
            return None;
        }
        let m = &self.refine.scene.points[i as usize];
        let pose = &self.poses[link];
        let facet = &self.refine.prepared.links[link].fields.facets[facet];
        let n = pose.rotation * Vector::from(facet.n.map(f64::from));
        let q = self.base_from_local * Point::from(m.p.map(f64::from));
        let x = pose * Point::from(facet.x.map(f64::from));
        let r = n.dot(&(q - x));
        // Beside the surface's edge its plane means nothing: what hangs on a flange is wider than
        // it.
        let beside = (distance * distance - r * r).max(0.0).sqrt();
        if self.gate < FINE_REACH && beside > self.refine.beside(link).max(0.33 * self.gate) {
            return None;
        }
        // A facet that faces away from the scanner cannot have given this point.
        if let Some(scanner) = &self.scanners[usize::from(m.view)] {
            let ray = (self.base_from_local * scanner) - q;
            if n.dot(&ray) <= 0.05 * ray.norm() {
                return None;
            }
        }
        Some(Match { link, q: q.coords, n, r })
    }
}
