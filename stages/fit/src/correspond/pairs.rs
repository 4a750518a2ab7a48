//! Finds for each measured point the place on the model's surface that its beam ends on, and the
//! distance of the point from there, at a state of an adjustment.

use geometry::{Point, Pose, Vector};
use nalgebra::{Matrix3, UnitQuaternion};

use super::placed::{NearFacet, Placed};
use crate::model::{BeamPlace, Facet, MeshHit};
use crate::problem::{AdjustState, Problem};
use crate::state::ScanError;

/// Beam direction noise of a common scanner, radians (19″; METHOD.md §3).
const ANGLE_NOISE: f64 = 9e-5;
/// What tessellation of the model and rounding leave at least, metres, one sigma.
const SURFACE_NOISE: f64 = 3e-4;
/// Cosine below which a beam cannot have come from a facet's front.
const MIN_FACING: f64 = 0.05;
/// The model's surface must let a beam pass for so many gates before its point.
const FREE: f64 = 2.0;
/// Where no scanner is known a point is as uncertain in every direction.
const NO_BEAM: Vector = Vector::new(0.0, 0.0, 0.0);

/// A point matched with the place on the model's surface that its beam ends on, local frame.
pub(crate) struct SurfacePair {
    pub(crate) link: usize,
    /// Patch of the link.
    pub(crate) patch: u32,
    pub(crate) view: usize,
    /// The point, corrected by its scan's error.
    pub(crate) p: Vector,
    pub(crate) n: Vector,
    /// From the scanner to the point, unit length; zero where unknown.
    pub(crate) ray: Vector,
    /// The same in full length; from the origin where unknown.
    pub(crate) beam: Vector,
    /// Variance of the point's distance from the surface, m².
    pub(crate) variance: f64,
    pub(crate) r: f64,
}

/// The triangle that a point's beam met, and its patch.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MetTriangle {
    link: u32,
    patch: u32,
    triangle: u32,
}

impl MetTriangle {
    pub(crate) fn link(&self) -> usize {
        self.link as usize
    }
}

/// A frame as a matrix, which turns vectors sooner than a quaternion does.
struct LinkFrame {
    rotation: Matrix3<f64>,
    origin: Vector,
}

impl LinkFrame {
    fn of(pose: &Pose) -> Self {
        let rotation = pose.rotation.to_rotation_matrix().into_inner();
        Self { rotation, origin: pose.translation.vector }
    }

    /// A place and a direction in this frame.
    #[inline]
    fn inside(&self, BeamPlace { at, ray }: BeamPlace<'_>) -> (Vector, Vector) {
        (self.rotation.tr_mul(&(at - self.origin)), self.rotation.tr_mul(ray))
    }
}

/// The model as it stands at a state, and the scans as they are off.
pub(crate) struct Pairing<'a> {
    problem: &'a Problem<'a>,
    pub(crate) state: &'a AdjustState,
    /// Farthest distance of a point from the surface, metres.
    pub(crate) gate: f64,
    /// Where the links are, local frame.
    frames: Vec<LinkFrame>,
    placed: Placed<'a>,
    scanners: Vec<Option<Point>>,
    turns: Vec<Matrix3<f64>>,
    /// Variance of the points' ranges, m².
    sigma2: f64,
}

impl<'a> Pairing<'a> {
    pub(crate) fn new(problem: &'a Problem<'a>, state: &'a AdjustState, gate: f64) -> Self {
        let scene = problem.scene;
        let turn = |e: &ScanError| {
            UnitQuaternion::from_scaled_axis(e.turn).to_rotation_matrix().into_inner()
        };
        Self {
            problem,
            state,
            gate,
            frames: problem
                .prepared
                .local_from_links(&state.hypothesis)
                .iter()
                .map(LinkFrame::of)
                .collect(),
            placed: Placed::all(problem.prepared, &state.hypothesis, gate),
            scanners: (0..scene.views.len()).map(|v| scene.scanner(v as u16)).collect(),
            turns: state.scans.iter().map(turn).collect(),
            sigma2: state.noise * state.noise,
        }
    }

    /// A point and the normal where it lies, in the frame of its link.
    #[inline]
    pub(crate) fn inside(&self, pair: &SurfacePair) -> (Vector, Vector) {
        let LinkFrame { rotation, origin } = &self.frames[pair.link];
        (rotation.tr_mul(&(pair.p - origin)), rotation.tr_mul(&pair.n))
    }

    /// A point of the scene with the surface that it lies on; `None` where it lies on none. What
    /// triangle its beam met is known from a state like this one, or is kept for the next.
    pub(crate) fn pair(&self, point: u32, known: &mut Option<MetTriangle>) -> Option<SurfacePair> {
        let m = &self.problem.scene.points[point as usize];
        let view = usize::from(m.view);
        let raw = Vector::from(m.p.map(f64::from));
        let scanner = self.scanners[view].map_or_else(Vector::zeros, |s| s.coords);
        let (p, ray, range) = if self.scanners[view].is_some() {
            let error = &self.state.scans[view];
            let beam = raw - scanner;
            let range = beam.norm();
            let ray = self.turns[view] * (beam / range);
            (scanner + ray * (range - error.bias) + error.shift, ray, range)
        } else {
            let error = &self.state.scans[view];
            (self.turns[view] * raw + error.shift, NO_BEAM, 0.0)
        };
        let is_camera = self.problem.scene.views[view].is_camera;
        let is_ray = range > 0.0 && !is_camera;
        let before = known.and_then(|known| self.again(known, BeamPlace { at: &p, ray: &ray }));
        let hit = match before {
            Some(hit) => hit,
            None if is_ray => self.first(BeamPlace { at: &p, ray: &ray }, known)?,
            None => self.nearest(&p)?,
        };
        let SurfaceHit { link, patch, n, r } = hit;
        if r.abs() > self.gate {
            return None;
        }
        let facing = -n.dot(&ray);
        // Surface that faces away from the scanner, or lies along the beam, cannot have given this
        // point.
        if range > 0.0 && facing <= MIN_FACING {
            return None;
        }
        // A camera's errors are no jitter along the beam: what it sees from the side is off as far
        // as the rest.
        let variance = if range > 0.0 && !is_camera {
            let across = (range * ANGLE_NOISE).powi(2) * (1.0 - facing * facing);
            self.sigma2 * facing * facing + across + SURFACE_NOISE * SURFACE_NOISE
        } else {
            self.sigma2
        };
        Some(SurfacePair { link, patch, view, p, n, ray, beam: p - scanner, variance, r })
    }

    /// Where a beam first meets the model about a point of it, whichever link: noise moves points
    /// along their beams, past edges, round bends and behind what hides other surface, so that
    /// what is nearest is not always what was measured.
    fn first(&self, beam: BeamPlace<'_>, known: &mut Option<MetTriangle>) -> Option<SurfaceHit> {
        let (t, link, met) = self.meets(beam)?;
        let patch = self.problem.prepared.links[link].fields.patch_at(&met.x, &met.n)?;
        *known = Some(MetTriangle { link: link as u32, patch, triangle: met.triangle });
        Some(self.hit(link, patch, beam.ray, t, &met.n))
    }

    /// How far beyond a place on it a beam first meets the model, on which link, and where; `None`
    /// farther from it than the gate.
    pub(crate) fn meets(&self, beam: BeamPlace<'_>) -> Option<(f64, usize, MeshHit)> {
        let mut best: Option<(f64, usize, MeshHit)> = None;
        self.placed.each(beam.at.map(|v| v as f32).into(), |link| {
            let (at, ray) = self.frames[link].inside(beam);
            let own = &self.problem.prepared.model.links[link];
            let triangles = self.problem.prepared.links[link].fields.triangles(own);
            let end = best.as_ref().map_or(self.gate, |b| b.0);
            let stretch = [-FREE * self.gate, end];
            if let Some((t, met)) = triangles.first(BeamPlace { at: &at, ray: &ray }, stretch) {
                best = Some((t, link, met));
            }
        });
        best.filter(|(t, ..)| *t >= -self.gate)
    }

    /// The same where it is known which triangle it met.
    fn again(&self, known: MetTriangle, beam: BeamPlace<'_>) -> Option<SurfaceHit> {
        let link = known.link as usize;
        let (at, ray) = self.frames[link].inside(beam);
        let own = &self.problem.prepared.model.links[link];
        let triangles = self.problem.prepared.links[link].fields.triangles(own);
        let (t, n) = triangles.again(known.triangle, BeamPlace { at: &at, ray: &ray })?;
        Some(self.hit(link, known.patch, beam.ray, t, &n))
    }

    /// What a beam meets so far beyond its point, where the surface has a normal, link frame.
    #[inline]
    fn hit(&self, link: usize, patch: u32, ray: &Vector, t: f64, n: &Vector) -> SurfaceHit {
        let n = self.frames[link].rotation * n;
        SurfaceHit { link, patch, n, r: -t * n.dot(ray) }
    }

    /// The facet nearest to a place, and not beside the surface's edge, where its plane means
    /// nothing.
    fn nearest(&self, at: &Vector) -> Option<SurfaceHit> {
        let NearFacet { link, facet, .. } = self.placed.nearest(at.map(|v| v as f32).into())?;
        let fields = &self.problem.prepared.links[link].fields;
        let Facet { x, n } = fields.facets[facet];
        let LinkFrame { rotation, origin } = &self.frames[link];
        let n = rotation * Vector::from(n.map(f64::from));
        let off = at - origin - rotation * Vector::from(x.map(f64::from));
        let r = n.dot(&off);
        let beside = (off.norm_squared() - r * r).max(0.0).sqrt();
        let hit = SurfaceHit { link, patch: fields.patch(facet), n, r };
        (beside <= self.problem.beside(link)).then_some(hit)
    }
}

/// A place on the model's surface.
struct SurfaceHit {
    link: usize,
    patch: u32,
    /// The surface's normal there, local frame.
    n: Vector,
    /// Height of the point above the surface, metres.
    r: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::seen;

    #[test]
    fn points_belong_to_what_their_beams_meet_first() {
        // Ranges 6 mm too short and too long.
        let places = (-9..=9).flat_map(|y| (-9..=9).map(move |z| (f64::from(y), f64::from(z))));
        let beams = places.flat_map(|(y, z)| [-0.006, 0.006].map(|off| (0.01 * y, 0.01 * z, off)));
        seen(beams.clone(), |problem, state| {
            let pairing = Pairing::new(problem, state, 0.02);
            for (i, (y, z, off)) in beams.clone().enumerate() {
                let mut known = None;
                let pair = pairing.pair(i as u32, &mut known).expect("it is on the front");
                assert_eq!((pair.link, pair.n), (0, Vector::x()), "at {y}, {z}, {off}");
                assert!((pair.r + off * pair.ray.x.abs()).abs() < 1e-6, "{} for {off}", pair.r);
                let again = pairing.pair(i as u32, &mut known).expect("the same triangle");
                assert!((again.r - pair.r).abs() < 1e-12 && again.patch == pair.patch);
            }
        });
    }
}
