//! Candidates of a region that were fitted before. A fallback pass may find bases of an earlier
//! pass again, whose fits would be the same.

use contract::Candidate;
use geometry::Pose;

/// Distance (metres) and angle (radians) below which two bases count as the same for a fit, which
/// moves its base by more than that.
const SAME: (f64, f64) = (0.01, 0.01);

/// Indices of models, and the bases that they were fitted on.
#[derive(Default)]
pub(super) struct TriedBases(Vec<(usize, Vec<Pose>)>);

impl TriedBases {
    pub(super) fn add(&mut self, candidate: &Candidate) {
        self.0.push((candidate.model, candidate.bases.iter().map(|base| base.0).collect()));
    }

    /// Whether the candidate's model was fitted on all of the candidate's bases.
    pub(super) fn knows(&self, candidate: &Candidate) -> bool {
        let is_among = |known: &[Pose]| {
            candidate.bases.iter().all(|base| known.iter().any(|known| is_same(known, &base.0)))
        };
        self.0.iter().any(|(model, known)| *model == candidate.model && is_among(known))
    }
}

fn is_same(a: &Pose, b: &Pose) -> bool {
    (a.translation.vector - b.translation.vector).norm() < SAME.0
        && a.rotation.angle_to(&b.rotation) < SAME.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::InstallationPlane;
    use geometry::{Aabb, Plane, Vector};

    #[test]
    fn a_candidate_is_known_by_its_model_and_all_of_its_bases() {
        let candidate = |model: usize, xs: &[f64]| Candidate {
            model,
            bounds: Aabb::EMPTY,
            plane: InstallationPlane {
                plane: Plane { normal: Vector::z(), offset: 0.0 },
                bounds: Aabb::EMPTY,
                area: 1.0,
                is_floor: true,
            },
            bases: xs.iter().map(|x| (Pose::translation(*x, 0.0, 0.0), 0.5)).collect(),
        };
        let mut tried = TriedBases::default();
        assert!(!tried.knows(&candidate(0, &[1.0])));
        tried.add(&candidate(0, &[1.0, 2.0]));
        assert!(tried.knows(&candidate(0, &[2.001, 1.0])));
        assert!(!tried.knows(&candidate(0, &[1.0, 2.02])));
        assert!(!tried.knows(&candidate(1, &[1.0])));
    }
}
