//! Candidates of a region that were fitted in, whether another one is nothing new out: what is left
//! over is searched for bases again, and where it finds those of before, their fits would be the
//! same.

use contract::Candidate;
use geometry::Pose;

/// Bases nearer than this to each other are one for a fit, metres and radians: it moves them
/// farther itself.
const SAME: (f64, f64) = (0.01, 0.01);

/// Models and the bases that they were fitted on.
#[derive(Default)]
pub(super) struct TriedBases(Vec<(usize, Vec<Pose>)>);

impl TriedBases {
    pub(super) fn add(&mut self, candidate: &Candidate) {
        self.0.push((candidate.model, candidate.bases.iter().map(|base| base.0).collect()));
    }

    /// Whether its model was fitted on all of its bases.
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
