//! One candidate in, one fit out: search, refine, judge; or nothing, where no posture explains what was measured.

use contract::{Candidate, Fit, JointFit, RunnerUp, Verdict};
use geometry::{Point, Pose};
use nalgebra::{DMatrix, Rotation3, Translation3, UnitQuaternion};

use crate::beam::{Beam, Hypothesis};
use crate::judge::{Judgement, evidence, judge};
use crate::refine::{COARSE_ROUNDS, FINE_ROUNDS, Refine, Refined, Round};
use crate::{Prepared, Scene, Settings, verdict};

/// Bounds of the distance of a judged point, metres: what is left after a fit should be the scans' own noise, not the
/// fit's.
const JUDGE_TOLERANCE: (f64, f64) = (0.012, 0.04);
/// Gate of the last rounds in multiples of the noise found, and its bounds, metres.
const LAST_GATE: (f64, f64, f64) = (4.5, 0.008, 0.025);

/// How far beyond its reach points may still be the robot's, metres: an error of the base.
const NEAR_MARGIN: f64 = 0.15;
/// Points of a link in the coarse rounds: enough to hold its pose to a millimetre.
const COARSE_CAP: usize = 600;
/// Distance from the roughly placed links within which points take part in the fine rounds, metres: just inside the
/// reach of the fine field.
const FINE_GATE: f64 = 0.0255;

/// Fits the candidate's model in the scene; `None` where nothing comes near.
#[must_use]
pub fn fit(
    candidate: &Candidate,
    prepared: &Prepared<'_>,
    scene: &Scene<'_>,
    settings: &Settings,
) -> Option<Fit> {
    let local_from_world = scene.world_from_local().inverse();
    let bases: Vec<Pose> =
        candidate.bases.iter().map(|(pose, _)| local_from_world * pose).collect();
    let beam = Beam { prepared, scene, settings };
    let found = beam.run(&bases);
    let is_seen = candidate.plane.area > 0.0;
    let prior = is_seen.then(|| prior(candidate, &local_from_world));
    let refine = Refine { prepared, scene, settings, prior };
    let base = bases.first().map_or_else(Point::origin, |b| Point::from(b.translation.vector));
    let [near, all] = scene.within(&base, prepared.reach + NEAR_MARGIN);
    let refined = rough(&beam, &refine, found, &near);
    let mut polished: Vec<(Refined, Judgement)> = Vec::new();
    for h in refined.iter().take(settings.n_polish) {
        polished.push(polish(&refine, h, &all));
    }
    if let Some((best, _)) = polished.first() {
        for h in beam.alternatives(&best.hypothesis) {
            let h = roughly(&refine, &h, &near, &COARSE_ROUNDS[3..]);
            polished.push(polish(&refine, &h, &all));
        }
    }
    polished.sort_by(|a, b| b.1.explained.total_cmp(&a.1.explained));
    let (best, judgement) = polished.first()?;
    if judgement.score < settings.min_score || judgement.violation > settings.max_violation {
        return None;
    }
    let free = undetermined(&polished);
    let runner_up = polished[1..].iter().find(|(r, _)| differs(r, best, &free));
    Some(report(&refine, &free, best, judgement, runner_up))
}

/// Coarse rounds for the best of the beam; near twins are dropped.
fn rough(
    beam: &Beam<'_>,
    refine: &Refine<'_>,
    found: Vec<Hypothesis>,
    near: &[u32],
) -> Vec<Hypothesis> {
    let settings = refine.settings;
    let mut out: Vec<(Hypothesis, f64)> = Vec::new();
    let last = found.first().map_or(0, |h| h.posture.len().saturating_sub(1));
    for h in found.into_iter().take(settings.n_refine) {
        let h = roughly(refine, &h, near, &COARSE_ROUNDS);
        if out.iter().any(|(k, _)| beam.alike(k, &h, last, 0.7)) {
            continue;
        }
        let judgement = judge(refine.prepared, refine.scene, settings, &h, 0.03);
        out.push((h, judgement.explained));
    }
    out.sort_by(|a, b| b.1.total_cmp(&a.1));
    out.into_iter().map(|(h, _)| h).collect()
}

/// Coarse rounds on few points of each link.
fn roughly(refine: &Refine<'_>, h: &Hypothesis, near: &[u32], rounds: &[Round]) -> Hypothesis {
    let few = refine.stratified(h, near.iter().copied(), rounds[0].gate, COARSE_CAP);
    refine.run(h, &few, rounds)
}

/// Fine rounds on all points, with the gate that the noise asks for; then the judgement.
fn polish(refine: &Refine<'_>, h: &Hypothesis, near: &[u32]) -> (Refined, Judgement) {
    let scene = refine.scene;
    let cap = refine.settings.max_points / refine.prepared.model.links.len().max(1);
    let all = refine.stratified(h, near.iter().copied(), FINE_GATE, cap.max(2000));
    let h = refine.run(h, &all, &FINE_ROUNDS[..3]);
    let first = refine.finish(h, &all, 0.022);
    let gate = (LAST_GATE.0 * first.noise).clamp(LAST_GATE.1, LAST_GATE.2);
    let rounds: Vec<_> = FINE_ROUNDS[3..].iter().map(|r| Round { gate, ..*r }).collect();
    let h = refine.run(&first.hypothesis, &all, &rounds);
    let done = refine.finish(h, &all, gate);
    let tolerance = (4.0 * scene.noise).clamp(JUDGE_TOLERANCE.0, JUDGE_TOLERANCE.1);
    let judgement = judge(refine.prepared, scene, refine.settings, &done.hypothesis, tolerance);
    (done, judgement)
}

/// Share of the best's explained surface from which on another posture counts as equally good.
const EQUAL: f64 = 0.98;

/// Standard deviation from which on a joint is open: any value within degrees would do, radians.
const OPEN_SIGMA: f64 = 0.02;

/// For each joint, whether the points leave it open: by its standard deviation, or because a posture that differs in
/// this joint and few others explains the points as well (a flange with six bolts, a wrist seen from nowhere).
fn undetermined(polished: &[(Refined, Judgement)]) -> Vec<bool> {
    let (best, judgement) = &polished[0];
    let n = best.hypothesis.posture.len();
    let mut free: Vec<bool> =
        (0..n).map(|j| best.covariance[(6 + j, 6 + j)] >= OPEN_SIGMA.powi(2)).collect();
    for (other, _) in
        polished[1..].iter().filter(|(_, k)| k.explained > EQUAL * judgement.explained)
    {
        let apart: Vec<bool> = (0..n).map(|j| turn(best, other, j) > 0.035).collect();
        // Only the tail of the chain can be open by symmetry; a flip further up is another answer.
        let first = apart.iter().position(|a| *a).unwrap_or(n);
        if first + 1 >= n || (first..n).all(|j| free[j] || j + 1 == n) {
            (0..n).for_each(|j| free[j] |= apart[j]);
        }
    }
    free
}

/// Difference of a joint between two postures, whole turns taken out, radians.
fn turn(a: &Refined, b: &Refined, joint: usize) -> f64 {
    let d = a.hypothesis.posture[joint] - b.hypothesis.posture[joint];
    let d = d.rem_euclid(std::f64::consts::TAU);
    d.min(std::f64::consts::TAU - d)
}

/// Whether two postures are different answers: more than 2° in a joint that the points determine, or 3 cm at the base.
fn differs(a: &Refined, b: &Refined, free: &[bool]) -> bool {
    let (p, q) = (&a.hypothesis.local_from_base, &b.hypothesis.local_from_base);
    let shift = (p.translation.vector - q.translation.vector).norm();
    shift > 0.03 || (0..free.len()).any(|j| !free[j] && turn(a, b, j) > 0.035)
}

/// Frame on the installation plane with z along its normal, at the height of the base's origin.
fn prior(candidate: &Candidate, local_from_world: &Pose) -> Pose {
    // The candidate's bases already stand on the plane: the first one tells the height of the origin above it.
    let base = candidate.bases.first().map_or_else(Pose::identity, |b| local_from_world * b.0);
    let n = candidate.plane.plane.normal;
    let tilt =
        Rotation3::rotation_between(&geometry::Vector::z(), &n).unwrap_or_else(Rotation3::identity);
    Pose::from_parts(
        Translation3::from(base.translation.vector),
        UnitQuaternion::from_rotation_matrix(&tilt),
    )
}

/// The covariance with the base's twist turned from base axes to world axes.
fn in_world_axes(covariance: &DMatrix<f64>, local_from_base: &Pose) -> DMatrix<f64> {
    let turn = local_from_base.rotation.to_rotation_matrix();
    let mut world_from_base = DMatrix::identity(covariance.nrows(), covariance.ncols());
    for block in [0, 3] {
        world_from_base.fixed_view_mut::<3, 3>(block, block).copy_from(turn.matrix());
    }
    &world_from_base * covariance * world_from_base.transpose()
}

fn report(
    refine: &Refine<'_>,
    free: &[bool],
    best: &Refined,
    judgement: &Judgement,
    runner_up: Option<&(Refined, Judgement)>,
) -> Fit {
    let Refine { prepared, scene, settings, .. } = *refine;
    let model = prepared.model;
    let h = &best.hypothesis;
    let n = 6 + h.posture.len();
    let covariance = in_world_axes(&best.covariance, &h.local_from_base);
    let sigma = |i: usize| covariance[(i, i)].max(0.0).sqrt();
    let joints = (0..h.posture.len())
        .map(|j| JointFit {
            name: model.joints[model.free[j]].name.clone(),
            value: h.posture[j],
            sigma: sigma(6 + j),
            determined: !free[j] && sigma(6 + j) < settings.determined_sigma,
        })
        .collect();
    let total: usize = best.n_points.iter().sum();
    let rms =
        (best.n_points.iter().zip(&best.link_rms).map(|(n, r)| *n as f64 * r * r).sum::<f64>()
            / total.max(1) as f64)
            .sqrt();
    let mut fit = Fit {
        model: prepared.index,
        model_name: model.name.clone(),
        world_from_base: scene.world_from_local() * h.local_from_base,
        base_sigma: std::array::from_fn(sigma),
        joints,
        covariance: (0..n * n).map(|i| covariance[(i / n, i % n)]).collect(),
        score: judgement.score,
        explained: judgement.explained,
        rms,
        links: evidence(prepared, judgement, &best.n_points, &best.link_rms),
        runner_up: runner_up.map(|(_, j)| RunnerUp {
            model: model.name.clone(),
            score: j.explained / judgement.explained * judgement.score,
            same_model: true,
        }),
        alike: Vec::new(),
        verdict: Verdict::Doubtful,
        reasons: Vec::new(),
    };
    verdict::pass(&mut fit, prepared, scene, judgement);
    fit
}
