//! A refined fit in; out comes what the beams say of each of its links, and one score for the whole.

use contract::LinkEvidence;
use geometry::Probe;

use crate::beam::Hypothesis;
use crate::{Prepared, Scene, Settings};

/// Judgement of a posture.
#[derive(Debug, Clone)]
pub(crate) struct Judgement {
    /// One for each link.
    pub(crate) probes: Vec<Probe>,
    /// Share explained less share contradicted over the judged surface, −1.5..1.
    pub(crate) score: f64,
    /// Surface explained less 1.5 × surface contradicted, m²: compares models of different size.
    pub(crate) explained: f64,
    /// Share of judged samples that a beam went through.
    pub(crate) violation: f64,
    /// Share of all samples that could be judged, weighted by area.
    pub(crate) seen: f64,
}

/// Judges a posture to within `tolerance` metres.
pub(crate) fn judge(
    prepared: &Prepared<'_>,
    scene: &Scene<'_>,
    settings: &Settings,
    h: &Hypothesis,
    tolerance: f64,
) -> Judgement {
    let poses = prepared.model.poses(&h.posture);
    let mut out = Judgement {
        probes: Vec::with_capacity(poses.len()),
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
            continue;
        }
        let probe =
            scene.evidence.probe(points, normals, &(h.local_from_base * pose), tolerance as f32);
        let each = prepared.links[l].area / f64::from(probe.n.max(1));
        let hidden = f64::from(probe.n - probe.n_seen);
        // Hidden samples vote for nothing here: take their small price back.
        let net = f64::from(probe.score)
            + if scene.evidence.has_beams() {
                f64::from(geometry::depth::HIDDEN_PRICE) * hidden
            } else {
                0.0
            };
        out.explained += each * net;
        judged += each * f64::from(probe.n_seen);
        through += each * f64::from(probe.n_through);
        area += prepared.links[l].area;
        out.probes.push(probe);
    }
    if judged > 0.0 {
        out.score = out.explained / judged;
        out.violation = through / judged;
        out.seen = judged / area;
    }
    out
}

/// What is reported of each link.
pub(crate) fn evidence(
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
