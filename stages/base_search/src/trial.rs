//! Base poses under test in; the best of them, few of each place, out; and the parts of a model
//! that they are tested by.

use geometry::probe::HIDDEN_PRICE;
use geometry::{Evidence, Pose, Probe};
use robot::Model;
use std::collections::HashMap;
use std::f64::consts::TAU;

/// Most base poses that are kept of one place: a cabinet that looks like a foot whatever its yaw
/// leaves room for others, which fewer scans see.
pub(crate) const QUOTA: usize = 16;
/// Radius of such a place, metres: the same at all levels, else a place would be many at the
/// finest.
const PLACE: f64 = 0.2;

/// Mean score on a quarter of the samples by which a pose may lag behind the best and still be
/// looked at closely.
pub(crate) const LAG: f64 = 0.15;

/// A base pose under test.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BaseTrial {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) yaw: f64,
    pub(crate) plane: usize,
    /// Of the base, joined with that of the first moving link once it was looked at.
    pub(crate) said: SampleScore,
    /// Of the first moving link alone, at the place that this one was refined from; nothing
    /// before.
    pub(crate) first: SampleScore,
}

/// What samples of a body at a pose say.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct SampleScore {
    /// Mean score of all, those that no beam could judge at their price.
    pub(crate) score: f64,
    /// Share of them that beams could judge.
    pub(crate) seen: f64,
}

impl SampleScore {
    /// Of a probe whose mean score is known.
    pub(crate) fn of(probe: &Probe, score: f64) -> Self {
        Self { score, seen: f64::from(probe.seen()) }
    }

    /// By which poses are told better from worse until few are left: between the mean score of all
    /// samples, by which what all scans see of a cabinet outdoes what one of them sees of a
    /// robot, and that of the judged, by which a corner of anything does.
    pub(crate) fn rank(&self) -> f64 {
        self.score / self.seen.max(LEAST_SEEN).sqrt()
    }
}

/// Share of samples below which ever fewer count for ever less.
const LEAST_SEEN: f64 = 0.1;

/// Mean score of the samples that could be judged.
pub(crate) fn of_judged(probe: &Probe) -> f64 {
    let back = HIDDEN_PRICE * (probe.n - probe.n_seen) as f32;
    f64::from((probe.score + back) / probe.n_seen.max(1) as f32)
}

pub(crate) fn coarse_yaw() -> f64 {
    TAU / 24.0
}

/// The first link in tree order that has a surface and hangs rigidly on the root.
pub(crate) fn base_link(model: &Model) -> Option<usize> {
    (0..model.links.len()).find(|&l| {
        let mut at = l;
        let mut fixed = true;
        while let Some(j) = model.links[at].parent_joint {
            fixed &= model.joints[j].kind == robot::JointKind::Fixed;
            at = model.joints[j].parent;
        }
        fixed && !model.links[l].cad.points.is_empty()
    })
}

/// The first free joint and the first link with a surface that it carries directly.
pub(crate) fn first_moving(model: &Model) -> Option<(usize, usize)> {
    let joint = *model.free.first()?;
    let child = model.joints[joint].child;
    (!model.links[child].cad.points.is_empty()).then_some((0, child))
}

/// Samples of a body's surface, frame of the body.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Samples<'a> {
    /// Places, metres.
    pub(crate) points: &'a [[f32; 3]],
    /// Unit outward normals.
    pub(crate) normals: &'a [[f32; 3]],
}

impl<'a> Samples<'a> {
    /// The first `n` samples of a link.
    pub(crate) fn first(model: &'a Model, link: usize, n: usize) -> Self {
        let cad = &model.links[link].cad;
        let n = n.min(cad.points.len());
        Self { points: &cad.points[..n], normals: &cad.normals[..n] }
    }

    /// What beams and points say of the samples of a body at a pose, `tolerance` in metres.
    pub(crate) fn probe(
        &self,
        evidence: &Evidence<'_>,
        local_from_body: &Pose,
        tolerance: f32,
    ) -> Probe {
        evidence.probe(self.points, self.normals, local_from_body, tolerance)
    }
}

/// How many trials are kept, and how much they differ.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Thinning {
    /// Most trials in all.
    pub(crate) keep: usize,
    /// Most trials of one place.
    pub(crate) quota: usize,
    /// Trials nearer to a better one than this are left out, metres …
    pub(crate) step: f64,
    /// … if they are turned from it by less than this, radians.
    pub(crate) yaw_step: f64,
}

/// Sorts best first and keeps those that differ from every better one by a step in place or yaw.
pub(crate) fn best(trials: &mut Vec<BaseTrial>, thinning: Thinning) {
    let Thinning { keep, quota, step, yaw_step } = thinning;
    trials.sort_by(|a, b| {
        b.said
            .rank()
            .total_cmp(&a.said.rank())
            .then(a.plane.cmp(&b.plane))
            .then(a.x.total_cmp(&b.x))
            .then(a.y.total_cmp(&b.y))
            .then(a.yaw.total_cmp(&b.yaw))
    });
    let mut kept: Vec<BaseTrial> = Vec::new();
    // What is near enough to matter lies in the same cell or beside it.
    let edge = PLACE.max(step);
    let cell = |t: &BaseTrial| [t.x, t.y].map(|v| (v / edge).floor() as i32);
    let mut cells: HashMap<(usize, [i32; 2]), Vec<usize>> = HashMap::new();
    for trial in trials.iter() {
        if kept.len() == keep {
            break;
        }
        let [i, j] = cell(trial);
        let about = (-1..=1).flat_map(|a| (-1..=1).map(move |b| [i + a, j + b]));
        let near: Vec<&BaseTrial> = about
            .filter_map(|at| cells.get(&(trial.plane, at)))
            .flat_map(|own| own.iter().map(|k| &kept[*k]))
            .collect();
        let here = |k: &&&BaseTrial| {
            let (dx, dy) = (k.x - trial.x, k.y - trial.y);
            dx * dx + dy * dy < PLACE * PLACE
        };
        if near.iter().filter(here).count() >= quota {
            continue;
        }
        let is_twin = |k: &&BaseTrial| {
            (k.x - trial.x).abs() < step && (k.y - trial.y).abs() < step && {
                let turn = (k.yaw - trial.yaw).rem_euclid(TAU);
                turn.min(TAU - turn) < yaw_step
            }
        };
        if !near.iter().any(is_twin) {
            cells.entry((trial.plane, [i, j])).or_default().push(kept.len());
            kept.push(*trial);
        }
    }
    *trials = kept;
}
