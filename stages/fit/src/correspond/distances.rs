//! Distances of points from the links of a posture, and which of two postures explains the points
//! better on the links that stand differently in them (METHOD.md §9).

use geometry::Point;
use geometry::depth::transform;

use crate::model::Facet;
use crate::problem::{Problem, links_apart};
use crate::state::Hypothesis;

/// Points farther than this from everything count as if they were so far, metres.
pub(crate) const CAP: f32 = 0.015;
/// Points in front of the flange's face count as if they were no farther, metres: something may
/// hang there.
const HELD_CAP: f32 = 0.5 * CAP;
/// Points within this of the links that move take part, metres.
const NEAR: f64 = 0.03;
/// Most points of a comparison.
const MAX_POINTS: usize = 3000;
/// Fewer points tell nothing.
pub(crate) const MIN_POINTS: usize = 30;

/// Two postures to compare, of the same robot.
pub(crate) struct Apart<'h> {
    pub(crate) best: &'h Hypothesis,
    pub(crate) other: &'h Hypothesis,
}

impl Apart<'_> {
    /// How much worse the other posture explains the points on some links, as the problem `there`
    /// has the robot's model, than the best one as `here` has it: the part of its squared
    /// distances that the best one does without. About 0 for equals, negative where the other is
    /// better.
    pub(crate) fn worsening(
        &self,
        here: &Problem<'_>,
        there: &Problem<'_>,
        links: &[usize],
    ) -> f64 {
        let Self { best, other } = *self;
        let mut points = swept(here, best, links);
        points.extend(swept(there, other, links));
        points.sort_unstable();
        points.dedup();
        if points.len() < MIN_POINTS {
            return 0.0;
        }
        let of = |problem: &Problem<'_>, h: &Hypothesis| {
            squares(problem, h, &points, &[&distances(problem, h, &points, |_| true)])
        };
        let (a, b) = (of(here, best), of(there, other));
        (b - a) / b.max(a).max(points.len() as f64 * here.scene.noise * here.scene.noise)
    }
}

/// How much worse another posture explains the points on the links that stand differently in it,
/// see [`Apart::worsening`].
pub(crate) fn worsening(problem: &Problem<'_>, best: &Hypothesis, other: &Hypothesis) -> f64 {
    let links = links_apart([problem.prepared; 2], [best, other]);
    Apart { best, other }.worsening(problem, problem, &links)
}

/// Sum of the squared distances of points, each the least of its own, m²; those in front of the
/// flange's face count less: something may hang there.
pub(crate) fn squares(
    problem: &Problem<'_>,
    h: &Hypothesis,
    points: &[u32],
    distances: &[&[f32]],
) -> f64 {
    let held = held(problem, h, points);
    let of = |i: usize| {
        let most = if held[i] { HELD_CAP } else { CAP };
        f64::from(distances.iter().map(|d| d[i]).fold(most, f32::min)).powi(2)
    };
    (0..points.len()).map(of).sum()
}

/// Which points may be of what hangs on the flange.
fn held(problem: &Problem<'_>, h: &Hypothesis, points: &[u32]) -> Vec<bool> {
    let prepared = problem.prepared;
    let face = prepared.face.and_then(|face| {
        let frames = prepared.frames(h);
        frames.into_iter().find(|(l, _)| *l == face.link).map(|(_, frame)| (face, frame))
    });
    let Some((face, frame)) = face else { return vec![false; points.len()] };
    let at = |i: &u32| transform(&frame, problem.scene.points[*i as usize].p);
    points.iter().map(|i| face.is_held(at(i))).collect()
}

/// Thinned points within the spheres about some links, wherever those turn in them; a limited
/// number, picked evenly.
pub(crate) fn swept(problem: &Problem<'_>, h: &Hypothesis, links: &[usize]) -> Vec<u32> {
    let spheres = spheres(problem, h, links);
    let inside = |i: &u32| {
        let p = Point::from(problem.scene.points[*i as usize].p.map(f64::from));
        spheres.iter().any(|(c, r)| (p - c).norm() < *r)
    };
    let all: Vec<u32> = problem.thin.iter().copied().filter(inside).collect();
    let n = all.len().min(MAX_POINTS);
    (0..n).map(|k| all[k * all.len() / n]).collect()
}

/// Middles and radii of spheres about links, with room for what lies near them, local frame.
pub(crate) fn spheres(problem: &Problem<'_>, h: &Hypothesis, links: &[usize]) -> Vec<(Point, f64)> {
    let poses = problem.prepared.local_from_links(h);
    let sphere = |&l: &usize| {
        let bounds = &problem.prepared.model.links[l].bounds;
        let radius = 0.5 * bounds.size().iter().map(|s| s * s).sum::<f64>().sqrt() + NEAR;
        let middle: Point = bounds.center();
        (poses[l] * middle, radius)
    };
    links.iter().map(sphere).collect()
}

/// Distance of each point from the surface of the chosen links along their normals, at most the
/// cap, metres.
pub(crate) fn distances(
    problem: &Problem<'_>,
    h: &Hypothesis,
    points: &[u32],
    chosen: impl Fn(usize) -> bool,
) -> Vec<f32> {
    let prepared = problem.prepared;
    let places: Vec<_> = points.iter().map(|&i| problem.scene.points[i as usize].p).collect();
    let mut least = vec![CAP; places.len()];
    // Link by link: a sweep asks one or two of them about the same points again and again.
    for (link, frame) in prepared.frames(h).into_iter().filter(|(l, _)| chosen(*l)) {
        let fields = &prepared.links[link].fields;
        // Beyond the edge of a facet its plane means nothing.
        let beside = 2.0 * prepared.model.links[link].cad.spacing + CAP;
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
