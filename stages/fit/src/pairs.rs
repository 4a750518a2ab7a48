//! A state of the adjustment in; for each measured point the facet of the model that it most likely lies on, and how far it is
//! from it, out.

use geometry::{Point, Pose, Vector};
use nalgebra::UnitQuaternion;

use crate::adjust::State;
use crate::exact::{self, Met};
use crate::facets::Facet;
use crate::placed::{Near, Placed};
use crate::refine::Refine;

/// Beam direction noise of a common scanner, radians (19″; fit.md §3.2).
const ANGLE_NOISE: f64 = 9e-5;
/// What tessellation of the model and rounding leave at least, metres, one sigma.
const SURFACE_NOISE: f64 = 3e-4;
/// Cosine below which a beam cannot have come from a facet's front.
const MIN_FACING: f64 = 0.05;
/// Most looks for the facet that a beam ends on, and how near to it is near enough, metres.
const MAX_LOOKS: usize = 6;
const CLOSE: f64 = 1e-4;
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

/// The triangle that a point's beam met, and the facet beside it.
#[derive(Clone, Copy)]
pub(crate) struct Known {
    link: u32,
    facet: u32,
    triangle: u32,
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
            sigma2: state.noise * state.noise,
        }
    }

    /// A point of the scene with its facet; `None` where it lies on none. What triangle its beam met is known from a
    /// state like this one, or is kept for the next.
    pub(crate) fn pair(&self, point: u32, known: &mut Option<Known>) -> Option<Pair> {
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
        let is_camera = self.refine.scene.views[view].is_camera;
        let is_ray = range > 0.0 && !is_camera;
        let before = known.and_then(|known| self.again(known, (&p, &ray)));
        let hit = match before {
            Some(hit) => hit,
            None if is_ray => {
                let hit = along(|at| self.nearest(at), (&p, &ray), self.gate)?;
                self.met(hit, &ray, known)
            }
            None => self.nearest(&p)?,
        };
        let Hit { link, facet, n, x, at } = hit;
        let r = n.dot(&(p - x));
        if r.abs() > self.gate {
            return None;
        }
        // Beside the surface's edge its plane means nothing.
        let off = at - x;
        let beside = (off.norm_squared() - n.dot(&off).powi(2)).max(0.0).sqrt();
        if beside > self.refine.beside(link) {
            return None;
        }
        let facing = -n.dot(&ray);
        // A facet that faces away from the scanner cannot have given this point.
        if range > 0.0 && facing <= MIN_FACING {
            return None;
        }
        // A camera's errors are no jitter along the beam: what it sees from the side is off as far as the rest.
        let variance = if range > 0.0 && !is_camera {
            let across = (range * ANGLE_NOISE).powi(2) * (1.0 - facing * facing);
            self.sigma2 * facing * facing + across + SURFACE_NOISE * SURFACE_NOISE
        } else {
            self.sigma2
        };
        Some(Pair { link, facet, view, p, n, ray, beam: p - scanner, variance, r })
    }

    /// The place where a beam that ends on a facet meets the mesh.
    fn met(&self, hit: Hit, ray: &Vector, known: &mut Option<Known>) -> Hit {
        let (link, pose) = (hit.link, &self.poses[hit.link]);
        let on_plane = hit.at + ray * (hit.n.dot(&(hit.x - hit.at)) / hit.n.dot(ray));
        let at = pose.inverse_transform_point(&on_plane.into()).coords;
        let ray = pose.inverse_transform_vector(ray);
        let own = &self.refine.prepared.model.links[link];
        let triangles = self.refine.prepared.links[link].fields.triangles(own);
        let Some(met) = triangles.meet(&own.mesh, &at, &ray) else { return hit };
        let (own, facet) = (link as u32, hit.facet as u32);
        *known = Some(Known { link: own, facet, triangle: met.triangle });
        self.placed_at(link, hit.facet, &met)
    }

    /// The same where it is known which triangle it met.
    fn again(&self, known: Known, (p, ray): (&Vector, &Vector)) -> Option<Hit> {
        let link = known.link as usize;
        let pose = &self.poses[link];
        let at = pose.inverse_transform_point(&Point::from(*p)).coords;
        let ray = pose.inverse_transform_vector(ray);
        let mesh = &self.refine.prepared.model.links[link].mesh;
        let met = exact::again(mesh, known.triangle, (&at, &ray))?;
        Some(self.placed_at(link, known.facet as usize, &met))
    }

    fn placed_at(&self, link: usize, facet: usize, met: &Met) -> Hit {
        let pose = &self.poses[link];
        let x = (pose * Point::from(met.x)).coords;
        Hit { link, facet, n: pose.rotation * met.n, x, at: x }
    }

    /// The facet nearest to a place.
    fn nearest(&self, at: &Vector) -> Option<Hit> {
        let Near { link, facet, .. } = self.placed.nearest(at.map(|v| v as f32).into())?;
        let Facet { x, n } = self.refine.prepared.links[link].fields.facets[facet];
        let pose = &self.poses[link];
        let n = pose.rotation * Vector::from(n.map(f64::from));
        let x = (pose * Point::from(x.map(f64::from))).coords;
        Some(Hit { link, facet, n, x, at: *at })
    }
}

/// The facet that a beam ends on near a point of it, from what looks for the nearest one: noise moves points along their beams,
/// past edges and round bends, so that the nearest facet is not always the one that was measured.
fn along(
    look: impl Fn(&Vector) -> Option<Hit>,
    (p, ray): (&Vector, &Vector),
    gate: f64,
) -> Option<Hit> {
    let (mut t, mut last) = (0.0, None);
    let mut is_afresh = false;
    for _ in 0..MAX_LOOKS {
        let hit = look(&(p + ray * t))?;
        let facing = -hit.n.dot(ray);
        if facing <= MIN_FACING {
            // Behind the surface or along it: from before it, once.
            if is_afresh {
                return None;
            }
            (t, is_afresh, last) = (-gate, true, None);
            continue;
        }
        let off = hit.n.dot(&(hit.at - hit.x)) / facing;
        let is_same = last == Some((hit.link, hit.facet));
        if is_same || off.abs() < CLOSE {
            return Some(hit);
        }
        last = Some((hit.link, hit.facet));
        t += off;
        if t.abs() > 2.0 * gate {
            return None;
        }
    }
    None
}

/// A place on the model's surface.
struct Hit {
    link: usize,
    facet: usize,
    /// The facet's normal and middle, local frame.
    n: Vector,
    x: Vector,
    /// Where it was looked for.
    at: Vector,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The nearest of some facets, each with its normal and middle.
    fn nearest(facets: &[[Vector; 2]]) -> impl Fn(&Vector) -> Option<Hit> + '_ {
        move |at| {
            let apart = |i: &usize| (facets[*i][1] - at).norm_squared();
            let facet = (0..facets.len()).min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
            let [n, x] = facets[facet];
            Some(Hit { link: 0, facet, n, x, at: *at })
        }
    }

    #[test]
    fn a_point_behind_an_edge_belongs_to_the_face_that_its_beam_met() {
        // A block's front (x = 0, below z = 0) and its top, a sample each 4 mm; the beam comes from before and a little above.
        let places = (0..20).flat_map(|i| (-20..20).map(move |j| (i, j)));
        let place = |(i, j): (i32, i32)| [0.002 + 0.004 * f64::from(i), 0.004 * f64::from(j)];
        let both = places.map(place).flat_map(|[deep, y]| {
            [[-Vector::x(), Vector::new(0.0, y, -deep)], [Vector::z(), Vector::new(deep, y, 0.0)]]
        });
        let facets: Vec<[Vector; 2]> = both.collect();
        let look = nearest(&facets);
        let (p, ray) = (Vector::new(0.007, 0.001, -0.003), Vector::new(1.0, 0.0, -0.1).normalize());
        assert_eq!(look(&p).expect("a facet").n, Vector::z());
        let hit = along(&look, (&p, &ray), 0.02).expect("the beam ends on the block");
        assert_eq!(hit.n, -Vector::x());
        // A beam that passes above ends on nothing.
        let above = Vector::new(-0.002, 0.0, 0.012);
        assert!(along(&look, (&above, &Vector::x()), 0.02).is_none());
    }

    #[test]
    fn noise_along_the_beam_pushes_no_round_surface() {
        const RADIUS: f64 = 0.05;
        let around = (0..2000).map(|k| f64::from(k) * std::f64::consts::TAU / 2000.0);
        let facets: Vec<[Vector; 2]> =
            around.map(|a| Vector::new(a.cos(), a.sin(), 0.0)).map(|n| [n, n * RADIUS]).collect();
        let look = nearest(&facets);
        let ray = -Vector::x();
        let mean = |hit: &dyn Fn(&Vector) -> Option<Hit>| {
            // Beams that end 30 to 38 mm beside the axis, 4 mm too long and too short.
            let beams = (0..200).flat_map(|k| [-0.004, 0.004].map(|noise| (k, noise)));
            let points = beams.map(|(k, noise)| {
                let y: f64 = 0.030 + 0.000_04 * f64::from(k);
                Vector::new((RADIUS * RADIUS - y * y).sqrt() + noise, y, 0.0)
            });
            let off = points.filter_map(|p| hit(&p).map(|hit| hit.n.dot(&(p - hit.x))));
            let all: Vec<f64> = off.collect();
            all.iter().sum::<f64>() / all.len() as f64
        };
        let beside = mean(&|p| look(p));
        let ended = mean(&|p| along(&look, (p, &ray), 0.02));
        assert!(beside > 5e-5, "the nearest facets are {beside} m off on average");
        assert!(ended.abs() < 1e-5, "those along the beams {ended} m");
    }
}
