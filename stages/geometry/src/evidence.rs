//! Evidence for a body at a pose: the depth images of scans with beams, and the bare points of
//! scans without. Surface samples in; a [`Probe`] out. The one place where "is it there?" is
//! answered.

use crate::probe::{Probe, probe};
use crate::{Eye, NearestField, Pose};
use std::sync::Arc;

/// Everything that was measured in a region.
#[derive(Debug, Clone, Default)]
pub struct Evidence<'a> {
    /// Scans whose scanner is known.
    eyes: Vec<Eye<'a>>,
    /// Points of the scans whose scanner is not known.
    cloud: Option<Arc<Cloud>>,
}

/// Points without beams: they can say "something is here", never "nothing is here".
#[derive(Debug, Clone)]
pub struct Cloud {
    points: Vec<[f32; 3]>,
    field: NearestField,
}

impl Cloud {
    /// A cloud that knows its surroundings up to `reach` metres, to about `edge` metres.
    #[must_use]
    pub fn new(points: Vec<[f32; 3]>, edge: f32, reach: f32) -> Self {
        let field = NearestField::new(&points, edge, reach);
        Self { points, field }
    }
}

/// Price of a surface sample without a point near it, where no beam can say whether it is hidden:
/// of a robot two or three scanners see a third to a half, so absence must cost something, but a
/// right posture must stay above nothing.
const ABSENT_PRICE: f32 = 0.25;
/// A point is on a surface sample up to so far beside it, metres: points are thinned to [`Cloud`]'s
/// edge.
const BESIDE: f32 = 0.02;

impl<'a> Evidence<'a> {
    /// Of scans whose scanner is known, those with images, and of points without beams.
    #[must_use]
    pub fn new(eyes: impl IntoIterator<Item = Eye<'a>>, cloud: Option<Arc<Cloud>>) -> Self {
        Self { eyes: eyes.into_iter().filter(|eye| !eye.is_blind()).collect(), cloud }
    }

    /// The scans whose scanner is known.
    #[must_use]
    pub fn eyes(&self) -> &[Eye<'a>] {
        &self.eyes
    }

    /// Judges surface samples (`points` with outward `normals`, frame of the body) with the body at
    /// `local_from_body`, to within `tolerance` metres.
    #[must_use]
    pub fn probe(
        &self,
        points: &[[f32; 3]],
        normals: &[[f32; 3]],
        local_from_body: &Pose,
        tolerance: f32,
    ) -> Probe {
        self.probe_more(Probe::default(), (points, normals), local_from_body, tolerance)
    }

    /// The same with what was said `before` of other samples of the body: just as if all of them
    /// were asked about at once.
    #[must_use]
    pub fn probe_more(
        &self,
        before: Probe,
        samples: (&[[f32; 3]], &[[f32; 3]]),
        local_from_body: &Pose,
        tolerance: f32,
    ) -> Probe {
        match &self.cloud {
            Some(cloud) if self.eyes.is_empty() => {
                cloud.probe(before, samples, local_from_body, tolerance)
            }
            _ => probe(&self.eyes, before, samples, local_from_body, tolerance),
        }
    }

    /// Whether anything here can prove that space is free.
    #[must_use]
    pub fn has_beams(&self) -> bool {
        !self.eyes.is_empty()
    }
}

impl Cloud {
    /// Judges samples by how far the nearest point is off the surface; how far beside says how
    /// dense the points are.
    fn probe(
        &self,
        before: Probe,
        (points, normals): (&[[f32; 3]], &[[f32; 3]]),
        local_from_body: &Pose,
        tolerance: f32,
    ) -> Probe {
        let m = crate::depth::rows(local_from_body);
        let mut out = Probe { n: before.n + points.len() as u32, ..before };
        for (p, n) in points.iter().zip(normals) {
            let (q, n) = (crate::depth::transform(&m, *p), crate::depth::rotate(&m, *n));
            let near = self.field.nearest(q).map(|i| {
                let off: [f32; 3] = std::array::from_fn(|k| self.points[i][k] - q[k]);
                let along = off[0] * n[0] + off[1] * n[1] + off[2] * n[2];
                let square = off.iter().map(|v| v * v).sum::<f32>();
                (along.abs(), square - along * along)
            });
            match near {
                Some((d, beside)) if d < tolerance && beside < BESIDE * BESIDE => {
                    out.score += 1.0 - d / tolerance;
                    out.n_seen += 1;
                    out.n_on += 1;
                }
                _ => out.score -= ABSENT_PRICE,
            }
        }
        out
    }
}
