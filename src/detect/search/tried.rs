//! Candidates of a region that were fitted before. A fallback pass may find bases of an earlier
//! pass again, whose fits would be the same.

use contract::{Candidate, Fit};
use geometry::Pose;

/// Distance (metres) and angle (radians) below which two bases count as the same for a fit, which
/// moves its base by more than that.
const SAME: (f64, f64) = (0.01, 0.01);

/// Distance (metres) and angle (radians) between neighbours on the finest grid of the base search,
/// and a little. A quick look moves its bases by that.
const NEAR: (f64, f64) = (0.03, 0.06);
/// Number of best bases of a candidate that lie near known ones if it is known.
const N_BEST: usize = 3;
/// Distance (metres) and angle (radians) from the base of a fit within which another search would
/// end at the same fit.
const FITTED: (f64, f64) = (0.05, 0.10);

/// Indices of models, the bases that they were fitted on, and those that fits ended at.
#[derive(Default)]
pub(super) struct TriedBases {
    tried: Vec<(usize, Vec<Pose>)>,
    ends: Vec<(usize, Pose)>,
}

impl TriedBases {
    pub(super) fn add(&mut self, candidate: &Candidate) {
        self.tried.push((candidate.model, candidate.bases.iter().map(|base| base.0).collect()));
    }

    /// Adds where a fit ended.
    pub(super) fn add_end(&mut self, fit: &Fit) {
        self.ends.push((fit.model, fit.world_from_base));
    }

    /// Whether the candidate's model was fitted on all of the candidate's bases, or beside the best
    /// of them, or ended at the best.
    pub(super) fn knows(&self, candidate: &Candidate) -> bool {
        let own = |model: &usize| *model == candidate.model;
        let is_among = |known: &[Pose], n: usize, within: (f64, f64)| {
            let bases = candidate.bases.iter().take(n);
            bases.map(|base| &base.0).all(|base| known.iter().any(|k| is_near(k, base, within)))
        };
        let is_tried =
            |known: &[Pose]| is_among(known, usize::MAX, SAME) || is_among(known, N_BEST, NEAR);
        self.tried.iter().any(|(model, known)| own(model) && is_tried(known))
            || self.ends.iter().any(|(model, end)| own(model) && is_among(&[*end], 1, FITTED))
    }
}

fn is_near(a: &Pose, b: &Pose, within: (f64, f64)) -> bool {
    (a.translation.vector - b.translation.vector).norm() < within.0
        && a.rotation.angle_to(&b.rotation) < within.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::InstallationPlane;
    use geometry::{Aabb, Plane, Vector};

    fn candidate(model: usize, xs: &[f64]) -> Candidate {
        let plane = Plane { normal: Vector::z(), offset: 0.0 };
        let plane = InstallationPlane { plane, bounds: Aabb::EMPTY, area: 1.0, is_floor: true };
        let bases = xs.iter().map(|x| (Pose::translation(*x, 0.0, 0.0), 0.5)).collect();
        Candidate { model, bounds: Aabb::EMPTY, plane, bases }
    }

    #[test]
    fn a_candidate_is_known_by_its_model_and_all_of_its_bases() {
        let mut tried = TriedBases::default();
        assert!(!tried.knows(&candidate(0, &[1.0])));
        tried.add(&candidate(0, &[1.0, 2.0]));
        assert!(tried.knows(&candidate(0, &[2.001, 1.0])));
        assert!(!tried.knows(&candidate(1, &[1.0])));
        // The best few beside known ones, whatever comes after them.
        assert!(tried.knows(&candidate(0, &[1.0, 2.02, 2.01, 7.0])));
        assert!(!tried.knows(&candidate(0, &[1.0, 2.04])));
    }

    #[test]
    fn a_candidate_is_known_where_a_fit_of_its_model_ended() {
        let mut tried = TriedBases::default();
        let world_from_base = Pose::translation(1.0, 0.0, 0.0);
        tried.add_end(&Fit { model: 2, world_from_base, ..Fit::default() });
        assert!(tried.knows(&candidate(2, &[1.04, 3.0])));
        assert!(!tried.knows(&candidate(2, &[1.06, 1.0])));
        assert!(!tried.knows(&candidate(1, &[1.0])));
    }
}
