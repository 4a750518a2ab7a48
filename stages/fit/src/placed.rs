//! A posture in; its links with a surface where they stand, and for any point the nearest facet of them, out.
//!
//! Most links are far from most points: a ball about each tells, eight at a time, before their fields are asked.

use geometry::Point;
use geometry::depth::{Rows, transform};
use robot::Link;

use crate::Prepared;
use crate::beam::Hypothesis;
use crate::refine::FINE_REACH;

/// Links that are asked together.
const N_LANES: usize = 8;

/// A ball that holds every place from which a link's fields know a sample.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Ball {
    /// Middle, link frame, metres.
    center: [f64; 3],
    /// Of the link's surface, metres.
    radius: f64,
}

impl Ball {
    /// Of the samples of a link.
    pub(crate) fn of(link: &Link) -> Self {
        let center = link.bounds.center();
        let far = |p: &[f32; 3]| (Point::from(p.map(f64::from)) - center).norm();
        let radius = link.cad.points.iter().map(far).fold(0.0, f64::max);
        Self { center: center.coords.into(), radius }
    }
}

/// A facet of a link next to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Near {
    pub(crate) link: usize,
    /// Its number among the link's.
    pub(crate) facet: usize,
    /// Metres.
    pub(crate) distance: f64,
}

/// Links of a posture, for points in the local frame.
pub(crate) struct Placed<'a> {
    prepared: &'a Prepared<'a>,
    links: Vec<(usize, Rows)>,
    balls: Vec<Balls>,
    is_fine: bool,
}

/// Balls of eight links: x, y, z of their middles, and their squared radii; radii of lanes that hold none are −1.
#[derive(Debug, Clone, Copy)]
struct Balls([[f32; N_LANES]; 4]);

impl Balls {
    /// Bit by bit, in which of the balls a point is.
    #[inline]
    fn hold(&self, p: [f32; 3]) -> u8 {
        let [x, y, z, r2] = &self.0;
        let mut d2 = [0.0_f32; N_LANES];
        for k in 0..N_LANES {
            let d = [x[k] - p[0], y[k] - p[1], z[k] - p[2]];
            d2[k] = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        }
        (0..N_LANES).fold(0, |bits, k| bits | u8::from(d2[k] <= r2[k]) << k)
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
        let is_fine = gate < FINE_REACH;
        let mut links = prepared.frames(h);
        links.retain(|(l, _)| chosen(*l));
        let poses = prepared.model.poses(&h.posture);
        let ball = |l: usize| {
            let own = &prepared.links[l];
            let center = h.local_from_base * poses[l] * Point::from(own.ball.center);
            let field = if is_fine { &own.fields.fine } else { &own.fields.coarse };
            let radius = own.ball.radius + field.reach();
            ([center.x as f32, center.y as f32, center.z as f32], (radius * radius) as f32)
        };
        let eight = |links: &[(usize, Rows)]| {
            let mut out = Balls([[-1.0; N_LANES]; 4]);
            for (k, (l, _)) in links.iter().enumerate() {
                let (center, r2) = ball(*l);
                (0..3).for_each(|i| out.0[i][k] = center[i]);
                out.0[3][k] = r2;
            }
            out
        };
        let balls = links.chunks(N_LANES).map(eight).collect();
        Self { prepared, links, balls, is_fine }
    }

    /// All links with a surface.
    pub(crate) fn all(prepared: &'a Prepared<'_>, h: &Hypothesis, gate: f64) -> Self {
        Self::new(prepared, h, gate, |_| true)
    }

    /// For each link whose field knows a facet near a point: the link, the facet, and the point in the link's frame.
    #[inline]
    pub(crate) fn each(&self, point: [f32; 3], mut take: impl FnMut(usize, usize, [f32; 3])) {
        for (balls, links) in self.balls.iter().zip(self.links.chunks(N_LANES)) {
            let mut bits = balls.hold(point);
            while bits != 0 {
                let (link, link_from_local) = &links[bits.trailing_zeros() as usize];
                bits &= bits - 1;
                let p = transform(link_from_local, point);
                let fields = &self.prepared.links[*link].fields;
                let field = if self.is_fine { &fields.fine } else { &fields.coarse };
                if let Some(facet) = field.nearest(p) {
                    take(*link, facet, p);
                }
            }
        }
    }

    /// The nearest facet over all links to a point.
    #[inline]
    pub(crate) fn nearest(&self, point: [f32; 3]) -> Option<Near> {
        let mut best: Option<(usize, usize, f32)> = None;
        self.each(point, |link, facet, p| {
            let s = self.prepared.links[link].fields.facets[facet].x;
            let d2 = (0..3).map(|i| (s[i] - p[i]) * (s[i] - p[i])).sum::<f32>();
            if best.is_none_or(|b| d2 < b.2) {
                best = Some((link, facet, d2));
            }
        });
        let (link, facet, d2) = best?;
        Some(Near { link, facet, distance: f64::from(d2).sqrt() })
    }
}
