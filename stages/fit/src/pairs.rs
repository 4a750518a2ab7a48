//! A state of the adjustment in; for each measured point the facet of the model that it most likely lies on, and how far it is
//! from it, out.

use geometry::{Point, Pose, Vector};
use nalgebra::UnitQuaternion;

use crate::adjust::State;
use crate::facets::Facet;
use crate::placed::{Near, Placed};
use crate::refine::Refine;

/// Beam direction noise of a common scanner, radians (19″; fit.md §3.2).
const ANGLE_NOISE: f64 = 9e-5;
/// What sampling of the model and rounding leave at least, metres, one sigma.
const SURFACE_NOISE: f64 = 3e-4;
/// Cosine below which a beam cannot have come from a facet's front.
const MIN_FACING: f64 = 0.05;
/// Where no scanner is known a point is as uncertain in every direction.
const NO_BEAM: Vector = Vector::new(0.0, 0.0, 0.0);

/// A point matched with the facet that it most likely lies on, local frame.
pub(crate) struct Pair {
    pub(crate) link: usize,
    pub(crate) facet: usize,
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

/// The model as it stands at a state, and the scans as they are off.
pub(crate) struct Pairing<'a> {
    refine: &'a Refine<'a>,
    pub(crate) state: &'a State,
    /// Farthest distance of a point from the surface, metres.
    pub(crate) gate: f64,
    poses: Vec<Pose>,
    placed: Placed<'a>,
    scanners: Vec<Option<Point>>,
    turns: Vec<UnitQuaternion<f64>>,
    /// Variance of the points' ranges, m².
    sigma2: f64,
}

impl<'a> Pairing<'a> {
    pub(crate) fn new(refine: &'a Refine<'a>, state: &'a State, gate: f64) -> Self {
        let scene = refine.scene;
        let turn = |e: &crate::adjust::ScanError| UnitQuaternion::from_scaled_axis(e.turn);
        Self {
            refine,
            state,
            gate,
            poses: refine.local_from_links(&state.hypothesis),
            placed: Placed::all(refine.prepared, &state.hypothesis, gate),
            scanners: (0..scene.views.len()).map(|v| scene.scanner(v as u16)).collect(),
            turns: state.scans.iter().map(turn).collect(),
            sigma2: scene.noise * scene.noise,
        }
    }

    /// A point of the scene with its facet; `None` where it lies on none.
    pub(crate) fn pair(&self, point: u32) -> Option<Pair> {
        let m = &self.refine.scene.points[point as usize];
        let view = usize::from(m.view);
        let raw = Vector::from(m.p.map(f64::from));
        let scanner = self.scanners[view].map_or_else(Vector::zeros, |s| s.coords);
        let (p, ray, range) = if self.scanners[view].is_some() {
            let error = &self.state.scans[view];
            let beam = raw - scanner;
            let ray = beam.normalize();
            let p = scanner + self.turns[view] * (beam - ray * error.bias) + error.shift;
            (p, self.turns[view] * ray, beam.norm())
        } else {
            (raw, NO_BEAM, 0.0)
        };
        let Near { link, facet, distance } = self.placed.nearest(p.map(|v| v as f32).into())?;
        if distance > self.gate {
            return None;
        }
        let pose = &self.poses[link];
        let Facet { x, n } = self.refine.prepared.links[link].fields.facets[facet];
        let n = pose.rotation * Vector::from(n.map(f64::from));
        let x = pose * Point::from(x.map(f64::from));
        let r = n.dot(&(p - x.coords));
        // Beside the surface's edge its plane means nothing.
        let beside = (distance * distance - r * r).max(0.0).sqrt();
        if beside > self.refine.beside(link) {
            return None;
        }
        let facing = -n.dot(&ray);
        // A facet that faces away from the scanner cannot have given this point.
        if range > 0.0 && facing <= MIN_FACING {
            return None;
        }
        // A camera's errors are no jitter along the beam: what it sees from the side is off as far as the rest.
        let variance = if range > 0.0 && !self.refine.scene.views[view].is_camera {
            let across = (range * ANGLE_NOISE).powi(2) * (1.0 - facing * facing);
            self.sigma2 * facing * facing + across + SURFACE_NOISE * SURFACE_NOISE
        } else {
            self.sigma2
        };
        Some(Pair { link, facet, view, p, n, ray, beam: p - scanner, variance, r })
    }
}
