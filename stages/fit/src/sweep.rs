//! A posture and one of its joints in; out comes how far the points near the links that the joint
//! moves are from the arm as it turns (METHOD.md §9).

use geometry::Point;
use geometry::depth::transform;

use crate::beam::Hypothesis;
use crate::facets::Facet;
use crate::refine::Refine;

/// Arc between trial values at the joint's lever, metres: finer than the features that tell them
/// apart.
const STEP: f64 = 0.003;
/// Largest step, radians: 1°.
const MAX_STEP: f64 = 0.0175;
/// Points farther than this from everything count as if they were so far, metres.
pub(crate) const CAP: f32 = 0.015;
/// Points in front of the flange's face count as if they were no farther, metres: something may
/// hang there.
const HELD: f32 = 0.5 * CAP;
/// Points within this of the swept links take part, metres.
const NEAR: f64 = 0.03;
/// Most points of a sweep.
const MAX_POINTS: usize = 3000;
/// Fewer points tell nothing.
pub(crate) const MIN_POINTS: usize = 30;

/// The links behind one joint, which turn apart from the rest of a posture.
pub(crate) struct Sweep<'a> {
    refine: &'a Refine<'a>,
    h: &'a Hypothesis,
    joint: usize,
    /// Points that any turn of those links may explain.
    points: Vec<u32>,
    /// Distances of the points to all other links, metres.
    still: Vec<f32>,
    /// The links that turn.
    pub(crate) moved: Vec<usize>,
}

impl<'a> Sweep<'a> {
    /// `None` where the joint slides or moves nothing, or the points are too few.
    pub(crate) fn new(
        refine: &'a Refine<'a>,
        h: &'a Hypothesis,
        near: &[u32],
        joint: usize,
    ) -> Option<Self> {
        let moved = refine.prepared.carried(joint);
        if refine.is_prismatic(joint) || moved.is_empty() {
            return None;
        }
        let points = refine.swept(h, near, &moved);
        if points.len() < MIN_POINTS {
            return None;
        }
        let still = refine.distances(h, &points, |l| !moved.contains(&l));
        Some(Self { refine, h, joint, points, still, moved })
    }

    /// Values that tell all there is over a span, radians.
    pub(crate) fn n_values(&self, span: f64) -> usize {
        let step = (STEP / self.refine.prepared.lever[self.joint]).min(MAX_STEP);
        (span / step).ceil() as usize
    }

    /// The posture with another value of the joint.
    pub(crate) fn at(&self, value: f64) -> Hypothesis {
        let mut other = self.h.clone();
        other.posture[self.joint] = value;
        other
    }

    /// Distances of the points to some of the links where the joint has a value, metres.
    pub(crate) fn distances(&self, value: f64, links: &[usize]) -> Vec<f32> {
        self.refine.distances(&self.at(value), &self.points, |l| links.contains(&l))
    }

    /// Squared distances to the nearest of what stands still and what is turned, m².
    pub(crate) fn squares(&self, turned: &[&[f32]]) -> impl Iterator<Item = f64> {
        let least = |i: usize| turned.iter().map(|d| d[i]).fold(self.still[i], f32::min);
        (0..self.points.len()).map(move |i| f64::from(least(i)).powi(2))
    }

    /// Their sum, m².
    pub(crate) fn cost(&self, turned: &[&[f32]]) -> f64 {
        self.squares(turned).sum()
    }

    /// How clearly a value of the joint is worse than one whose distances are given: what its
    /// squares exceed the other's by, over what that would be if each point's excess were
    /// chance: a few strays say nothing, many points that agree much.
    pub(crate) fn clearly_worse(&self, value: f64, than: &[f32]) -> f64 {
        let own = self.distances(value, &self.moved);
        let (other, best) = ([own.as_slice()], [than]);
        let excess = self.squares(&other).zip(self.squares(&best)).map(|(o, b)| o - b);
        let [sum, squares] = excess.fold([0.0, 0.0], |s, d| [s[0] + d, s[1] + d * d]);
        if squares > 0.0 { sum / squares.sqrt() } else { 0.0 }
    }

    /// The same where the joint has a value, and something may hang on the flange.
    pub(crate) fn cost_held(&self, value: f64) -> f64 {
        let own = self.distances(value, &self.moved);
        self.refine.squares(&self.at(value), &self.points, &[&own, &self.still])
    }
}

impl Refine<'_> {
    /// How much worse another posture explains the points on the links that stand differently in
    /// it: the part of its squared distances that the best one does without; about 0 for
    /// equals, negative where the other is better.
    pub(crate) fn worsening(&self, best: &Hypothesis, other: &Hypothesis, near: &[u32]) -> f64 {
        let moved = crate::judge::moved([self.prepared; 2], [best, other]);
        self.worsening_in(self, [best, other], &moved, near)
    }

    /// Links that another model of the same robot places otherwise.
    pub(crate) fn apart(&self, other: &Self, h: &Hypothesis) -> Vec<usize> {
        crate::judge::moved([self.prepared, other.prepared], [h, h])
    }

    /// The same for a posture here and one of another model of the same robot; `moved` are the
    /// links that stand differently.
    pub(crate) fn worsening_in(
        &self,
        there: &Self,
        [best, other]: [&Hypothesis; 2],
        moved: &[usize],
        near: &[u32],
    ) -> f64 {
        let mut points = self.swept(best, near, moved);
        points.extend(there.swept(other, near, moved));
        points.sort_unstable();
        points.dedup();
        if points.len() < MIN_POINTS {
            return 0.0;
        }
        let squares = |refine: &Self, h: &Hypothesis| {
            refine.squares(h, &points, &[&refine.distances(h, &points, |_| true)])
        };
        let (a, b) = (squares(self, best), squares(there, other));
        (b - a) / b.max(a).max(points.len() as f64 * self.scene.noise * self.scene.noise)
    }

    /// Sum of the squared distances of points, each the least of its own; those in front of the
    /// flange's face count less: something may hang there.
    pub(crate) fn squares(&self, h: &Hypothesis, points: &[u32], distances: &[&[f32]]) -> f64 {
        let held = self.held(h, points);
        let of = |i: usize| {
            let most = if held[i] { HELD } else { CAP };
            f64::from(distances.iter().map(|d| d[i]).fold(most, f32::min)).powi(2)
        };
        (0..points.len()).map(of).sum()
    }

    /// Which points may be of what hangs on the flange.
    fn held(&self, h: &Hypothesis, points: &[u32]) -> Vec<bool> {
        let face = self.prepared.face.and_then(|face| {
            let frames = self.prepared.frames(h);
            frames.into_iter().find(|(l, _)| *l == face.link).map(|(_, frame)| (face, frame))
        });
        let Some((face, frame)) = face else { return vec![false; points.len()] };
        let at = |i: &u32| geometry::depth::transform(&frame, self.scene.points[*i as usize].p);
        points.iter().map(|i| face.is_held(at(i))).collect()
    }

    /// Points near the links whatever their joint's value: within their sphere about the joint's
    /// axis, thinned.
    pub(crate) fn swept(&self, h: &Hypothesis, near: &[u32], moved: &[usize]) -> Vec<u32> {
        let spheres = self.spheres(h, moved);
        let inside = |i: &u32| {
            let p = Point::from(self.scene.points[*i as usize].p.map(f64::from));
            spheres.iter().any(|(c, r)| (p - c).norm() < *r)
        };
        let all: Vec<u32> = near.iter().copied().filter(inside).collect();
        let n = all.len().min(MAX_POINTS);
        (0..n).map(|k| all[k * all.len() / n]).collect()
    }

    /// Middles and radii of spheres about links, with room for what lies near them, local frame.
    pub(crate) fn spheres(&self, h: &Hypothesis, links: &[usize]) -> Vec<(Point, f64)> {
        let poses = self.local_from_links(h);
        let sphere = |&l: &usize| {
            let bounds = &self.prepared.model.links[l].bounds;
            let radius = 0.5 * bounds.size().iter().map(|s| s * s).sum::<f64>().sqrt() + NEAR;
            let middle: Point = bounds.center();
            (poses[l] * middle, radius)
        };
        links.iter().map(sphere).collect()
    }

    /// Distance of each point from the surface of the chosen links along their normals, at most the
    /// cap, metres.
    pub(crate) fn distances(
        &self,
        h: &Hypothesis,
        points: &[u32],
        chosen: impl Fn(usize) -> bool,
    ) -> Vec<f32> {
        let places: Vec<_> = points.iter().map(|&i| self.scene.points[i as usize].p).collect();
        let mut least = vec![CAP; places.len()];
        // Link by link: a sweep asks one or two of them about the same points again and again.
        for (link, frame) in self.prepared.frames(h).into_iter().filter(|(l, _)| chosen(*l)) {
            let fields = &self.prepared.links[link].fields;
            // Beyond the edge of a facet its plane means nothing.
            let beside = 2.0 * self.prepared.model.links[link].cad.spacing + CAP;
            for (p, least) in places.iter().zip(&mut least) {
                let q = transform(&frame, *p);
                let Some(at) = fields.fine.nearest(q) else { continue };
                let Facet { x, n } = fields.facets[at];
                let apart = [0, 1, 2].map(|k| q[k] - x[k]);
                if apart.iter().map(|v| v * v).sum::<f32>() <= beside * beside {
                    let off: f32 = (0..3).map(|k| n[k] * apart[k]).sum();
                    *least = least.min(off.abs());
                }
            }
        }
        least
    }
}
