//! Probes a body at a pose against the depth images of scans with known scanner positions, and
//! against the points of the other scans.
//!
//! All stages use [`Evidence::probe`], so that their results agree.

use crate::probe::{Probe, SurfaceSamples, probe};
use crate::{Eye, NearestField, Pose};
use std::sync::Arc;

/// All measurements of a region.
#[derive(Debug, Clone, Default)]
pub struct Evidence<'a> {
    /// Scanners whose position is known.
    eyes: Vec<Eye<'a>>,
    /// Points of scans whose scanner position is not known.
    cloud: Option<Arc<Cloud>>,
}

/// Points without beams: they can prove that something is at a place, but never that it is free.
#[derive(Debug, Clone)]
pub struct Cloud {
    points: Vec<[f32; 3]>,
    field: NearestField,
}

impl Cloud {
    /// A cloud of `points` (local frame, metres) with a nearest-point grid of voxels of `edge` that
    /// reaches `reach` from the points, metres.
    #[must_use]
    pub fn new(points: Vec<[f32; 3]>, edge: f32, reach: f32) -> Self {
        let field = NearestField::new(&points, edge, reach);
        Self { points, field }
    }
}

/// Price of a surface sample without a nearby point if no beam can show whether it is hidden. Two
/// or three scanners see a third to a half of a robot, so that absence must cost something, but the
/// right posture must still score above zero.
const ABSENT_PRICE: f32 = 0.25;
/// Largest distance along the surface between a sample and the point that confirms it, metres; the
/// points are thinned to the edge of a [`Cloud`]'s voxels.
const BESIDE: f32 = 0.02;

impl<'a> Evidence<'a> {
    /// Collects scanners with at least one image, and points without beams.
    #[must_use]
    pub fn new(eyes: impl IntoIterator<Item = Eye<'a>>, cloud: Option<Arc<Cloud>>) -> Self {
        Self { eyes: eyes.into_iter().filter(|eye| !eye.is_blind()).collect(), cloud }
    }

    /// The scanners whose position is known.
    #[must_use]
    pub fn eyes(&self) -> &[Eye<'a>] {
        &self.eyes
    }

    /// Probes surface samples of a body at the pose `local_from_body`. `points` (metres) and
    /// outward unit `normals` are given in the body's frame; a beam that ends within `tolerance`
    /// metres of a sample confirms it.
    #[must_use]
    pub fn probe(
        &self,
        points: &[[f32; 3]],
        normals: &[[f32; 3]],
        local_from_body: &Pose,
        tolerance: f32,
    ) -> Probe {
        let samples = SurfaceSamples { points, normals };
        self.probe_more(Probe::default(), samples, local_from_body, tolerance)
    }

    /// Adds further samples to the result `before` of other samples of the same body. The sum is
    /// the same as if all samples had been judged in one call.
    #[must_use]
    pub fn probe_more(
        &self,
        before: Probe,
        samples: SurfaceSamples<'_>,
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

    /// Whether any scan here can prove that space is free.
    #[must_use]
    pub fn has_beams(&self) -> bool {
        !self.eyes.is_empty()
    }
}

impl Cloud {
    /// Judges samples by the distance of the nearest point from the surface; its distance along
    /// the surface must not exceed the spacing of the points.
    fn probe(
        &self,
        before: Probe,
        samples: SurfaceSamples<'_>,
        local_from_body: &Pose,
        tolerance: f32,
    ) -> Probe {
        let SurfaceSamples { points, normals } = samples;
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
