//! The links of a posture where they stand, and the facet of them that is nearest to a point.
//!
//! Most of the time is spent waiting for memory, so several places are looked up together.

use geometry::NearestField;
use geometry::depth::{LANES, Lanes, Rows, lanes, transform, transform_lanes};

use crate::model::Fields;
use crate::state::Hypothesis;
use crate::{MeasuredScene, Prepared};

/// Distance from which the coarse field answers, metres: just inside the fine field's reach.
pub(super) const FINE_REACH: f64 = 0.026;

/// A facet of a link next to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NearFacet {
    pub(crate) link: usize,
    /// Index among the facets of the link.
    pub(crate) facet: usize,
    /// Metres.
    pub(crate) distance: f64,
}

/// Links of a posture, for points in the local frame.
pub(crate) struct Placed<'a> {
    links: Vec<PlacedLink<'a>>,
}

/// A link where it stands.
struct PlacedLink<'a> {
    link: usize,
    fields: &'a Fields,
    /// The one of its fields whose reach covers the gate.
    field: &'a NearestField,
    link_from_local: Rows,
    /// Takes local coordinates to voxels of the field; `size` is how many it has on each axis.
    voxel_from_local: Rows,
    size: [f32; 3],
}

impl<'a> PlacedLink<'a> {
    fn new(prepared: &'a Prepared<'_>, link: usize, link_from_local: Rows, is_fine: bool) -> Self {
        let fields = &prepared.links[link].fields;
        let field = if is_fine { &fields.fine } else { &fields.coarse };
        let (origin, inverse_edge) = field.grid();
        let voxel_from_local = [0, 1, 2].map(|axis| {
            let [x, y, z, t] = link_from_local[axis];
            [x, y, z, t - origin[axis]].map(|v| v * inverse_edge)
        });
        let size = field.size().map(|n| n as f32);
        Self { link, fields, field, link_from_local, voxel_from_local, size }
    }

    /// Which of some places are within the field, and where in it they are, voxels.
    #[inline]
    fn hold(&self, local: &Lanes) -> ([bool; LANES], Lanes) {
        let at = transform_lanes(&self.voxel_from_local, local);
        let mut is_in = [true; LANES];
        for (v, size) in at.iter().zip(self.size) {
            for i in 0..LANES {
                is_in[i] &= (v[i] >= 0.0) & (v[i] < size);
            }
        }
        (is_in, at)
    }

    /// Squared distance of a place, local frame, from a facet, m².
    #[inline]
    fn distance2(&self, facet: usize, p: [f32; 3]) -> f32 {
        let (s, p) = (self.fields.facets[facet].x, transform(&self.link_from_local, p));
        (0..3).map(|i| (s[i] - p[i]) * (s[i] - p[i])).sum()
    }
}

impl<'a> Placed<'a> {
    /// The links that are chosen, for samples within `gate` metres.
    pub(crate) fn new(
        prepared: &'a Prepared<'_>,
        h: &Hypothesis,
        gate: f64,
        chosen: impl Fn(usize) -> bool,
    ) -> Self {
        let frames = prepared.frames(h).into_iter().filter(|(link, _)| chosen(*link));
        let stand = |(link, from_local): (usize, Rows)| {
            PlacedLink::new(prepared, link, from_local, gate < FINE_REACH)
        };
        Self { links: frames.map(stand).collect() }
    }

    /// All links with a surface.
    pub(crate) fn all(prepared: &'a Prepared<'_>, h: &Hypothesis, gate: f64) -> Self {
        Self::new(prepared, h, gate, |_| true)
    }

    /// Each link whose field knows a facet near a point.
    #[inline]
    pub(crate) fn each(&self, point: [f32; 3], mut take: impl FnMut(usize)) {
        for own in &self.links {
            let at = transform(&own.voxel_from_local, point);
            let is_in = (0..3).all(|i| at[i] >= 0.0 && at[i] < own.size[i]);
            if is_in && own.field.in_voxel(at.map(|v| v as u32)).is_some() {
                take(own.link);
            }
        }
    }

    /// The nearest facet over all links to a point.
    pub(crate) fn nearest(&self, point: [f32; 3]) -> Option<NearFacet> {
        self.nearest_of(&[point])[0]
    }

    /// The same for some points, as many as there are lanes at most: the voxels of all are asked
    /// for, then the facets of all.
    #[inline]
    fn nearest_of(&self, points: &[[f32; 3]]) -> [Option<NearFacet>; LANES] {
        let local = lanes(points);
        let mut best = [(f32::INFINITY, 0, 0); LANES];
        for own in &self.links {
            let (is_in, [x, y, z]) = own.hold(&local);
            let (mut which, mut facets, mut n) = ([0; LANES + 1], [None; LANES], 0);
            for (i, is_in) in is_in.into_iter().enumerate().take(points.len()) {
                which[n] = i;
                n += usize::from(is_in);
            }
            for &i in &which[..n] {
                facets[i] = own.field.in_voxel([x[i], y[i], z[i]].map(|v| v as u32));
            }
            for &i in &which[..n] {
                let Some(facet) = facets[i] else { continue };
                let d2 = own.distance2(facet, points[i]);
                if d2 < best[i].0 {
                    best[i] = (d2, own.link, facet);
                }
            }
        }
        best.map(|(d2, link, facet)| {
            let distance = f64::from(d2).sqrt();
            distance.is_finite().then_some(NearFacet { link, facet, distance })
        })
    }

    /// Points of a scene, each with its place and what is nearest to it.
    pub(crate) fn nearest_each(
        &self,
        scene: &MeasuredScene<'_>,
        points: &[u32],
        mut take: impl FnMut(u32, [f32; 3], Option<NearFacet>),
    ) {
        for some in points.chunks(LANES) {
            let mut places = [[0.0; 3]; LANES];
            for (place, i) in places.iter_mut().zip(some) {
                *place = scene.points[*i as usize].p;
            }
            let near = self.nearest_of(&places[..some.len()]);
            for ((i, place), near) in some.iter().zip(places).zip(near) {
                take(*i, place, near);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::before_front;

    #[test]
    fn points_looked_up_together_have_the_nearest_facet_of_all() {
        // Along the front, and beyond its edge out of all fields.
        let places: Vec<[f64; 2]> = (0..41).map(|i| [0.006 * f64::from(i), 0.03]).collect();
        before_front(&places, |problem, state| {
            let placed = Placed::all(problem.prepared, &state.hypothesis, 0.02);
            let points: Vec<u32> = (0..places.len() as u32).collect();
            let (mut n, mut n_near) = (0, 0);
            placed.nearest_each(problem.scene, &points, |i, p, near| {
                assert_eq!((i, p), (n, problem.scene.points[i as usize].p));
                assert_eq!(near, placed.nearest(p));
                n += 1;
                let Some(near) = near else { return assert!(p[1] > 0.12, "{p:?}") };
                n_near += 1;
                let distance = |x: &[f32; 3]| (0..3).map(|k| (x[k] - p[k]).powi(2)).sum::<f32>();
                let facets = |link: usize| problem.prepared.links[link].fields.facets.iter();
                let all = (0..2).flat_map(|link| facets(link).map(|f| distance(&f.x)));
                let least = f64::from(all.fold(f32::INFINITY, f32::min)).sqrt();
                let own = distance(&problem.prepared.links[near.link].fields.facets[near.facet].x);
                assert!((f64::from(own).sqrt() - near.distance).abs() < 1e-6);
                // To within a voxel's diagonal.
                assert!(near.distance < least + 0.012, "{} {least} at {p:?}", near.distance);
            });
            assert!(n == 41 && (17..41).contains(&n_near), "{n_near}");
        });
    }
}
