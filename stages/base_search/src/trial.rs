//! Trials, which are base poses under test, their scores, and how they are thinned out. Also the
//! parts of a model that trials are scored by.

use geometry::probe::HIDDEN_PRICE;
use geometry::{Evidence, Pose, Probe};
use robot::Model;
use std::collections::HashMap;
use std::f64::consts::TAU;

/// Price of a sample of a base that no beam could judge. Scanned from two sides, under an arm, nine
/// samples in ten are hidden.
pub(crate) const HIDDEN: f32 = 0.03;

/// Radius of a place of which the number of base poses is limited, metres. It is the same at all
/// levels, since a place would split into many at the finest.
const PLACE: f64 = 0.2;

/// Difference from the best quick score (on a quarter of the samples) up to which a pose is scored
/// with all samples.
pub(crate) const MAX_LAG: f64 = 0.15;

/// A base pose under test.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BaseTrial {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) yaw: f64,
    pub(crate) plane: usize,
    /// Score of the base, combined with that of the first moving link once that is known.
    pub(crate) rating: SampleScore,
    /// Score of the first moving link alone, at the trial that this one was refined from; zero
    /// before.
    pub(crate) first: SampleScore,
}

/// The score of the samples of a body at a pose.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct SampleScore {
    /// Mean score of all samples, with the price of a hidden sample for those that no beam could
    /// judge.
    pub(crate) score: f64,
    /// Share of the samples that beams could judge, 0 to 1.
    pub(crate) seen: f64,
}

impl SampleScore {
    /// The score of a probe whose mean score is known.
    pub(crate) fn of(probe: &Probe, score: f64) -> Self {
        Self { score, seen: f64::from(probe.seen()) }
    }

    /// Mean score of the judged samples, 1 at best; 0 where none was judged.
    pub(crate) fn judged(&self) -> f64 {
        if self.seen <= 0.0 {
            return 0.0;
        }
        (self.score + f64::from(HIDDEN) * (1.0 - self.seen)) / self.seen
    }

    /// The value that trials are sorted by. It lies between the mean score of all samples, which
    /// favours a cabinet that all scans see over a robot that one scan sees, and the mean score of
    /// the judged samples, which favours a corner of anything.
    pub(crate) fn rank(&self) -> f64 {
        self.score / self.seen.max(LEAST_SEEN).sqrt()
    }
}

/// Share of judged samples below which the rank falls with the share.
const LEAST_SEEN: f64 = 0.1;

/// Mean score of the samples that could be judged.
pub(crate) fn judged_score(probe: &Probe) -> f64 {
    let back = HIDDEN_PRICE * (probe.n - probe.n_seen) as f32;
    f64::from((probe.score + back) / probe.n_seen.max(1) as f32)
}

pub(crate) fn coarse_yaw() -> f64 {
    TAU / 24.0
}

/// The first link in tree order that has a surface and is rigidly connected to the root.
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

/// The first free joint and the link that it moves directly, if that link has a surface.
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

    /// Probes the samples against beams and points, with the body at a pose; `tolerance` in metres.
    pub(crate) fn probe(
        &self,
        evidence: &Evidence<'_>,
        local_from_body: &Pose,
        tolerance: f32,
    ) -> Probe {
        evidence.probe(self.points, self.normals, local_from_body, tolerance)
    }
}

/// Limits of the trials that are kept, and the differences between them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Thinning {
    /// Limit of all trials.
    pub(crate) keep: usize,
    /// Limit of the trials of one place.
    pub(crate) quota: usize,
    /// A trial is dropped if it is nearer to a better one than this in both coordinates, metres …
    pub(crate) step: f64,
    /// … and its yaw differs from that one by less than this, radians.
    pub(crate) yaw_step: f64,
}

/// Sorts the trials by descending rank and keeps those that differ from every better one.
pub(crate) fn best(trials: &mut Vec<BaseTrial>, thinning: Thinning) {
    let Thinning { keep, quota, step, yaw_step } = thinning;
    let mut sorted: Vec<(f64, BaseTrial)> = trials.iter().map(|t| (t.rating.rank(), *t)).collect();
    sorted.sort_unstable_by(|(a_rank, a), (b_rank, b)| {
        b_rank
            .total_cmp(a_rank)
            .then(a.plane.cmp(&b.plane))
            .then(a.x.total_cmp(&b.x))
            .then(a.y.total_cmp(&b.y))
            .then(a.yaw.total_cmp(&b.yaw))
    });
    let mut kept: Vec<BaseTrial> = Vec::new();
    // Trials within the radius of a place lie in the same cell or a neighbouring one.
    let edge = PLACE.max(step);
    let cell = |t: &BaseTrial| [t.x, t.y].map(|v| (v / edge).floor() as i32);
    let mut cells: HashMap<(usize, [i32; 2]), Vec<usize>> = HashMap::new();
    for (_, trial) in &sorted {
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
