//! Picks points near a robot link by link, so that large links do not outvote the wrist (METHOD.md
//! §11.7).

use geometry::Aabb;
use geometry::depth::{Rows, transform};
use std::borrow::Cow;

use super::placed::{FINE_REACH, NearFacet, Placed};
use super::sampled::{AdjustPoints, chunk};
use crate::problem::Problem;
use crate::state::Hypothesis;

/// One point of so many is looked at first, to see of which links there are more than enough.
const FIRST_LOOK: usize = 4;
/// Quarters of the points wanted of a link that are as good as all of them: a deviation grows by a
/// seventh at most.
const ENOUGH: usize = 3;

/// Points that are wanted of each link.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PerLink {
    /// Farthest distance from the link, metres.
    pub(crate) gate: f64,
    /// Most points.
    pub(crate) cap: usize,
}

/// Of `points`, as many as are wanted of each link that is nearest to them, evenly picked, and
/// as many again of those that lie near the robot but within no link's field. Sorted.
pub(crate) fn stratified(
    problem: &Problem<'_>,
    h: &Hypothesis,
    points: &[u32],
    PerLink { gate, cap }: PerLink,
) -> Vec<u32> {
    let strata = Strata::new(problem, h, gate);
    let some: Vec<u32> = points.iter().copied().step_by(FIRST_LOOK).collect();
    let mut sorted = strata.sort(&some, None);
    // Of most links these are enough; the others are looked for among the rest.
    let is_open: Vec<bool> = sorted.iter().map(|own| own.len() < ENOUGH * cap / 4).collect();
    let wanted = Placed::new(problem.prepared, h, gate, |l| is_open[l]);
    let beside = is_open[strata.beside()] && gate > FINE_REACH;
    // Where most points are theirs, to ask them first would be to ask twice.
    let n_of = |open: bool| -> usize {
        sorted.iter().zip(&is_open).filter(|of| *of.1 == open).map(|of| of.0.len()).sum()
    };
    let is_most = n_of(true) > n_of(false);
    let rest = (0..points.len()).filter(|i| i % FIRST_LOOK != 0).map(|i| points[i]);
    let wanted = (!beside && !is_most).then_some(&wanted);
    let rest = strata.sort(&rest.collect::<Vec<_>>(), wanted);
    let mut out = Vec::new();
    for (at, (own, more)) in sorted.iter_mut().zip(rest).enumerate() {
        if is_open[at] {
            own.extend(more);
            // Two runs in order, which the stable sort merges.
            own.sort();
        }
        let n = own.len();
        let kept = n.min(cap);
        out.extend((0..kept).map(|k| own[k * n / kept]));
    }
    out.sort();
    out
}

/// Points that an adjustment is made of: about so many, of all.
pub(crate) fn adjusted_points(problem: &Problem<'_>, h: &Hypothesis, n: usize) -> AdjustPoints {
    let n_links = problem.prepared.model.links.len().max(1);
    let cap = (n / n_links).max(MIN_CAP);
    let gate =
        (ADJUST_GATE.sigmas * problem.scene.noise).clamp(ADJUST_GATE.least, ADJUST_GATE.most);
    let some = some(problem.all, n.max(n_links * MIN_CAP).saturating_mul(LOOKED_AT));
    AdjustPoints::new(stratified(problem, h, &some, PerLink { gate, cap }), gate)
}

/// Least points of a link that are taken, if it has as many.
const MIN_CAP: usize = 2000;
/// Most points that are looked at for each that is wanted: a small link has a twentieth of all.
const LOOKED_AT: usize = 10;

/// About `n` of the points at most, thinned evenly.
pub(crate) fn some(points: &[u32], n: usize) -> Cow<'_, [u32]> {
    match points.len().div_ceil(n.max(1)) {
        0 | 1 => Cow::Borrowed(points),
        step => points.iter().copied().step_by(step).collect(),
    }
}

/// No point farther than this from the surface takes part in the adjustment.
struct AdjustGate {
    /// In standard deviations of the scans' noise.
    sigmas: f64,
    /// Bounds, metres: what robots differ from their models by and more, within the reach of the
    /// fine field.
    least: f64,
    most: f64,
}

const ADJUST_GATE: AdjustGate = AdjustGate { sigmas: 3.0, least: 0.02, most: 0.03 };

/// Room about a link within which points count as beside the robot.
struct BesideRoom {
    gates: f64,
    /// Least gate, metres.
    least_gate: f64,
}

const BESIDE: BesideRoom = BesideRoom { gates: 1.7, least_gate: 0.05 };

/// Links of a robot as it stands, with what lies about it: points are sorted by them.
struct Strata<'a> {
    problem: &'a Problem<'a>,
    placed: Placed<'a>,
    /// Bounds about each link, and its frame.
    about: Vec<(Rows, Aabb)>,
    gate: f64,
}

impl<'a> Strata<'a> {
    fn new(problem: &'a Problem<'a>, h: &Hypothesis, gate: f64) -> Self {
        let room = gate.max(BESIDE.least_gate) * BESIDE.gates;
        let links = problem.prepared.frames(h).into_iter();
        let about =
            links.map(|(l, frame)| (frame, problem.prepared.model.links[l].bounds.grown(room)));
        let placed = Placed::all(problem.prepared, h, gate);
        Self { problem, placed, about: about.collect(), gate }
    }

    /// The stratum of what lies about the robot, on none of its links: after those of the links.
    fn beside(&self) -> usize {
        self.problem.prepared.links.len()
    }

    /// The stratum of a place, local frame, and of what is nearest to it.
    fn of(&self, p: [f32; 3], near: Option<NearFacet>) -> Option<usize> {
        let is_about = || {
            let holds = |(frame, bounds): &(Rows, Aabb)| {
                bounds.contains(transform(frame, p).map(f64::from))
            };
            self.about.iter().any(holds)
        };
        match near {
            Some(near) if near.distance <= self.gate => Some(near.link),
            _ => (self.gate > FINE_REACH && is_about()).then(|| self.beside()),
        }
    }

    /// The points by stratum; only those near the wanted links, where some are told.
    fn sort(&self, points: &[u32], wanted: Option<&Placed<'_>>) -> Vec<Vec<u32>> {
        let n_strata = self.beside() + 1;
        let sorted = self.problem.fan.fan(
            points.chunks(chunk(points.len())).collect(),
            |chunk: &[u32]| {
                let mut strata: Vec<Vec<u32>> = vec![Vec::new(); n_strata];
                let mut sort = |chunk: &[u32]| {
                    self.placed.nearest_each(self.problem.scene, chunk, |i, p, near| {
                        self.of(p, near).iter().for_each(|at| strata[*at].push(i));
                    });
                };
                match wanted {
                    Some(wanted) => {
                        let mut kept = Vec::new();
                        wanted.nearest_each(self.problem.scene, chunk, |i, _, near| {
                            kept.extend(near.filter(|near| near.distance <= self.gate).map(|_| i));
                        });
                        sort(&kept);
                    }
                    None => sort(chunk),
                }
                strata
            },
        );
        let whole =
            |at: usize| sorted.iter().flat_map(|strata| strata[at].iter().copied()).collect();
        (0..n_strata).map(whole).collect()
    }
}
