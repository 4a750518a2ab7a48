//! What the beams say of a posture: of each of its links, and one score for the whole (METHOD.md
//! §8.3).

use contract::LinkEvidence;
use geometry::{Point, Probe};

use super::context::Problem;
use crate::state::Hypothesis;
use crate::{MeasuredScene, Prepared, Settings};

/// How far a sample may be from what a beam met and still count as explained.
struct JudgeTolerance {
    /// In standard deviations of the scans' noise.
    sigmas: f64,
    /// Least, metres: what is left after a fit should be the scans' own noise, not the fit's.
    least: f64,
    /// Most, metres.
    most: f64,
}

const TOLERANCE: JudgeTolerance = JudgeTolerance { sigmas: 4.0, least: 0.012, most: 0.04 };

/// Judgement of a posture.
#[derive(Debug, Clone)]
pub(crate) struct Judgement {
    /// One for each link.
    pub(crate) probes: Vec<Probe>,
    /// Surface explained less 1.5 × surface contradicted, and surface judged, of each link, m².
    pub(crate) links: Vec<[f64; 2]>,
    /// Share explained less share contradicted over the judged surface, −1.5..1.
    pub(crate) score: f64,
    /// Surface explained less 1.5 × surface contradicted, m²: compares models of different size.
    pub(crate) explained: f64,
    /// Share of judged samples that a beam went through.
    pub(crate) violation: f64,
    /// Share of all samples that could be judged, weighted by area.
    pub(crate) seen: f64,
}

/// The judgement with the tolerance that the scans' noise asks for.
pub(crate) fn judged(problem: &Problem<'_>, h: &Hypothesis) -> Judgement {
    let tolerance = (TOLERANCE.sigmas * problem.scene.noise).clamp(TOLERANCE.least, TOLERANCE.most);
    judge(problem.prepared, problem.scene, problem.settings, h, tolerance)
}

/// Judges a posture to within `tolerance` metres.
pub(crate) fn judge(
    prepared: &Prepared<'_>,
    scene: &MeasuredScene<'_>,
    settings: &Settings,
    h: &Hypothesis,
    tolerance: f64,
) -> Judgement {
    let poses = prepared.model.poses(&h.posture);
    let mut out = Judgement {
        probes: Vec::with_capacity(poses.len()),
        links: Vec::with_capacity(poses.len()),
        score: 0.0,
        explained: 0.0,
        violation: 0.0,
        seen: 0.0,
    };
    let (mut judged, mut through, mut area) = (0.0, 0.0, 0.0);
    for (l, pose) in poses.iter().enumerate() {
        let (points, normals) = prepared.samples(l, settings.n_judge);
        if points.is_empty() {
            out.probes.push(Probe::default());
            out.links.push([0.0; 2]);
            continue;
        }
        let probe =
            scene.evidence.probe(points, normals, &(h.local_from_base * pose), tolerance as f32);
        let each = prepared.links[l].area / f64::from(probe.n.max(1));
        let hidden = f64::from(probe.n - probe.n_seen);
        // Hidden samples vote for nothing here: take their small price back.
        let net = f64::from(probe.score)
            + if scene.evidence.has_beams() {
                f64::from(geometry::probe::HIDDEN_PRICE) * hidden
            } else {
                0.0
            };
        out.explained += each * net;
        judged += each * f64::from(probe.n_seen);
        through += each * f64::from(probe.n_through);
        area += prepared.links[l].area;
        out.links.push([each * net, each * f64::from(probe.n_seen)]);
        out.probes.push(probe);
    }
    if judged > 0.0 {
        out.score = out.explained / judged;
        out.violation = through / judged;
        out.seen = judged / area;
    }
    out
}

/// A posture, and what the beams say of it.
#[derive(Clone, Copy)]
pub(crate) struct JudgedPosture<'a> {
    pub(crate) hypothesis: &'a Hypothesis,
    pub(crate) judgement: &'a Judgement,
}

/// A link that moves less than this between two postures stands the same in both, metres: a beam's
/// width and noise.
const MOVED: f64 = 0.02;

/// How clearly the beams prefer one posture to another: difference of the share explained on the
/// links that stand differently, about 0 for equals, 1 for right against nothing.
pub(crate) fn margin(
    prepared: &Prepared<'_>,
    best: JudgedPosture<'_>,
    other: JudgedPosture<'_>,
) -> f64 {
    let (mut ahead, mut judged) = (0.0, 0.0);
    for l in links_apart([prepared; 2], [best.hypothesis, other.hypothesis]) {
        let (p, q) = (best.judgement.links[l], other.judgement.links[l]);
        ahead += p[0] - q[0];
        judged += p[1].max(q[1]);
    }
    if judged > 0.0 { ahead / judged } else { 0.0 }
}

/// Links that stand differently in two postures of two models of one robot.
pub(crate) fn links_apart(prepared: [&Prepared<'_>; 2], [a, b]: [&Hypothesis; 2]) -> Vec<usize> {
    let pose = |prepared: &Prepared<'_>, h: &Hypothesis| {
        let poses = prepared.model.poses(&h.posture);
        poses.iter().map(|p| h.local_from_base * p).collect::<Vec<_>>()
    };
    let (a, b) = (pose(prepared[0], a), pose(prepared[1], b));
    let links = prepared[0].model.links.iter().enumerate().filter(|(_, l)| !l.bounds.is_empty());
    let stands_apart = |(l, link): &(usize, &robot::Link)| {
        let apart = |c: [f64; 3]| (a[*l] * Point::from(c) - b[*l] * Point::from(c)).norm();
        link.bounds.corners().into_iter().map(apart).fold(0.0, f64::max) > MOVED
    };
    links.filter(stands_apart).map(|(l, _)| l).collect()
}

/// What is reported of each link.
pub(crate) fn link_evidence(
    prepared: &Prepared<'_>,
    judgement: &Judgement,
    n_points: &[usize],
    link_rms: &[f64],
) -> Vec<LinkEvidence> {
    let links = &prepared.model.links;
    links
        .iter()
        .enumerate()
        .map(|(l, link)| {
            let p = &judgement.probes[l];
            let seen = f64::from(p.n_seen.max(1));
            LinkEvidence {
                name: link.name.clone(),
                seen: f64::from(p.seen()),
                matched: f64::from(p.n_on) / seen,
                violated: f64::from(p.n_through) / seen,
                n_points: n_points[l],
                rms: link_rms[l],
            }
        })
        .collect()
}
