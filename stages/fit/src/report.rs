//! The adjusted posture, the others that were looked at, and what the beams say in; out comes the
//! fit as it is reported: values with their standard deviations, which joints are open, rivals,
//! equals, verdict.

use contract::{Certainty, Equal, Fan, Fit, JointFit, RunnerUp, ScanShare, ScanShift};
use geometry::{Pose, Vector};
use nalgebra::{DMatrix, DVector};
use robot::{Model, Motion};
use std::f64::consts::TAU;

use crate::adjust::Adjusted;
use crate::beam::Hypothesis;
use crate::camera;
use crate::judge::{Judgement, evidence};
use crate::profile;
use crate::refine::Refine;
use crate::rivals::lead;
use crate::sampled::Sampled;
use crate::settle::Settled;
use crate::solve::Polished;
use crate::spin::Spin;
use crate::sway::sway;
use crate::turns;
use crate::verdict::{self, JudgedFit, RIVAL, VerdictEvent};
use crate::wrist::Wrist;

/// Margin up to which another posture counts as equally good.
pub(crate) const EQUAL: f64 = 0.03;
/// Margin up to which another value of the last joint is listed.
const NEARLY_EQUAL: f64 = 0.12;
/// Margin up to which another value of a slide that closes a tool leaves it open: what the tool
/// holds looks like it where little of it is seen. Electrodes in plain view led by 0.6 and more,
/// those in a part by 0.17 to 0.6 where they were right, by 0.18 where not.
const SLIDE_EQUAL: f64 = 0.3;
/// Standard deviation from which on a joint is open: any value within degrees would do, radians.
const OPEN_SIGMA: f64 = 0.02;
/// Standard deviation of an angle of which nothing is known: any value of a whole turn, radians
/// (π/√3).
const ANY_ANGLE: f64 = 1.813_799_364_234_217_8;
/// What beams have against the best, where points speak for it, or points where beams do, counts so
/// many times: a wrist that was 7° off was better by 0.19 for the beams, and worse by 0.03 for the
/// points.
const AGAINST: f64 = 3.0;
/// Joints that differ by more are different answers, radians (2°) or metres.
pub(crate) const OTHER: f64 = 0.035;
/// Bases farther apart are different answers, metres.
const OTHER_BASE: f64 = 0.03;
/// Most equals that are listed.
const N_EQUALS: usize = 4;

/// Another posture, and how clearly the best is better.
type Rival<'a> = (f64, &'a Polished);

/// What is reported of the best, given the others; `points` are those of its adjustment.
pub(crate) fn report(
    refine: &Refine<'_>,
    (best, judgement, spins): &Settled,
    others: &[Polished],
    (near, points): (&[u32], &Sampled),
    wrist: Option<&Wrist>,
    fan: &dyn Fan,
) -> Fit {
    let prepared = refine.prepared;
    let model = prepared.model;
    let h = &best.hypothesis;
    let n = 6 + h.posture.len();
    let rivals = ranked(refine, (h, judgement), others, near, fan);
    // With the base's twist in its own axes.
    let mut in_base = refine.with_foot(h, best.covariance.clone(), near, fan);
    let (mut open, mut spread) = open_joints(refine, &in_base, h, &rivals);
    let several: Vec<&Spin> = spins.iter().filter(|s| s.values.len() > 1).collect();
    widen(refine, (best, wrist), &several, (near, points), (&mut in_base, fan));
    spread_spins(h, (spins, &several), &mut open, &mut spread);
    let held: Vec<f64> = (0..n - 6).map(|j| sigma_of(&in_base, 6 + j)).collect();
    if refine.scene.has_camera() {
        let near_equal = rivals.iter().filter(|(margin, _)| *margin < RIVAL);
        let near_equal = near_equal.map(|(_, (other, _))| other);
        in_base += camera::beyond(refine, best, (near, points), fan);
        camera::spread(h, near_equal, &mut spread);
    }
    let covariance = in_world_axes(&in_base, &h.local_from_base);
    // Where a joint may stand elsewhere, so may the tip.
    for (j, spread) in spread.iter().enumerate() {
        in_base[(6 + j, 6 + j)] = in_base[(6 + j, 6 + j)].max(spread * spread);
    }
    // A flange that may stand otherwise is listed; it makes nobody doubt the robot.
    let passed = |j: usize| (open[j] || prepared.leaf[j]) && !refine.is_prismatic(j);
    let passed: Vec<bool> = (0..open.len()).map(passed).collect();
    let other_answer = rivals.iter().find(|(_, (other, _))| differs(other, h, &passed));
    let mut fit = Fit {
        model: prepared.index,
        model_name: model.name.clone(),
        world_from_base: refine.scene.world_from_local() * h.local_from_base,
        base_sigma: std::array::from_fn(|i| sigma_of(&covariance, i)),
        joints: joints(refine, h, &covariance, (&open, &spread), &rivals),
        covariance: (0..n * n).map(|i| covariance[(i / n, i % n)]).collect(),
        score: judgement.score,
        explained: judgement.explained,
        rms: best.rms(),
        surface_sigma: best.patch_sigma,
        tip_sigma: tip_sigma(model, &h.posture, &in_base),
        scans: scans(refine, best),
        share: share(refine, best),
        links: evidence(prepared, judgement, &best.n_points, &best.link_rms),
        runner_up: other_answer.map(|rival| runner_up(model, judgement, rival)),
        equals: equals(refine, h, &rivals, (&passed, &several)),
        ..Fit::default()
    };
    let scene = refine.scene;
    verdict::decide(&mut fit, &JudgedFit { prepared, scene, judgement, held: Some(&held) });
    fit
}

/// Adds to the covariance of the joints what their valleys, others that may stand elsewhere and the
/// wrist leave open.
fn widen(
    refine: &Refine<'_>,
    (best, wrist): (&Adjusted, Option<&Wrist>),
    several: &[&Spin],
    (near, points): (&[u32], &Sampled),
    (in_base, fan): (&mut DMatrix<f64>, &dyn Fan),
) {
    let n = best.hypothesis.posture.len();
    let mut of_joints = in_base.view_mut((6, 6), (n, n));
    of_joints += sway(refine, best, several, (near, points), fan);
    let beyond = profile::beyond(refine, best, points, fan);
    beyond.into_iter().enumerate().for_each(|(j, variance)| of_joints[(j, j)] += variance);
    if let Some(wrist) = wrist {
        let at = (wrist.joint, wrist.joint);
        of_joints[at] = of_joints[at].max(wrist.variance());
    }
}

/// The others, the one that the best is least better than first.
fn ranked<'o>(
    refine: &Refine<'_>,
    best: (&Hypothesis, &Judgement),
    others: &'o [Polished],
    near: &[u32],
    fan: &dyn Fan,
) -> Vec<Rival<'o>> {
    let mut rivals: Vec<Rival<'o>> = fan.fan(others.iter().collect(), |other| {
        let [by_beams, by_points] = lead(refine, best, other, near);
        // What either of them has against the best counts against it, more than what the other has
        // for it.
        (by_beams.max(by_points) + AGAINST * by_beams.min(by_points).min(0.0), other)
    });
    rivals.sort_by(|a, b| a.0.total_cmp(&b.0));
    rivals
}

/// Joints that may stand at several values are open; how far away the farthest value is, and how
/// wide a run of values, all as good, spread, radians or metres.
fn spread_spins(
    h: &Hypothesis,
    (spins, several): (&[Spin], &[&Spin]),
    open: &mut [bool],
    spread: &mut [f64],
) {
    for s in spins {
        // Any value of the run, each as likely.
        spread[s.joint] = spread[s.joint].max(s.extent / 3.0_f64.sqrt());
    }
    for s in several {
        open[s.joint] = true;
        let value = h.posture[s.joint];
        spread[s.joint] =
            s.values.iter().map(|v| turns::apart(value, *v)).fold(spread[s.joint], f64::max);
    }
}

/// Standard deviation of an entry of the covariance: metres or radians.
fn sigma_of(covariance: &DMatrix<f64>, i: usize) -> f64 {
    covariance[(i, i)].max(0.0).sqrt()
}

/// The joints as they are reported; of each, whether it is open, and how far away the farthest of
/// its other values is.
fn joints(
    refine: &Refine<'_>,
    h: &Hypothesis,
    covariance: &DMatrix<f64>,
    (open, spread): (&[bool], &[f64]),
    rivals: &[Rival<'_>],
) -> Vec<JointFit> {
    let (prepared, model) = (refine.prepared, refine.prepared.model);
    // A wrist that may be flipped is not known, however narrow either answer is.
    let is_elsewhere = |j: usize| {
        let differs = |(m, (other, _)): &Rival<'_>| *m < RIVAL && turn(other, h, j) > OTHER;
        !prepared.leaf[j] && rivals.iter().any(differs)
    };
    let joints = (0..h.posture.len()).map(|j| {
        let (value, equivalents) = whole_turns(model, &h.posture, j);
        // The width of one of several values is not how well the joint is known.
        let sigma = sigma_of(covariance, 6 + j).max(spread[j]).min(ANY_ANGLE);
        JointFit {
            name: model.joints[model.free[j]].name.clone(),
            value,
            sigma,
            certainty: Certainty::of(
                sigma,
                open[j] || is_elsewhere(j),
                refine.settings.determined_sigma,
            ),
            equivalents,
        }
    });
    joints.collect()
}

/// Postures that explain the points as well: the first few of the rivals, and other values of last
/// joints. Joints that are passed over make no rival another answer.
fn equals(
    refine: &Refine<'_>,
    h: &Hypothesis,
    rivals: &[Rival<'_>],
    (passed, several): (&[bool], &[&Spin]),
) -> Vec<Equal> {
    let same = rivals.iter().filter(|(m, (other, _))| {
        let mut apart = (0..passed.len()).filter(|&j| turn(other, h, j) > OTHER);
        let limit = match (apart.next(), apart.next()) {
            (None, _) => return false,
            (Some(j), None) if closes(refine, j) => SLIDE_EQUAL,
            _ if differs(other, h, passed) => EQUAL,
            _ => NEARLY_EQUAL,
        };
        *m < limit
    });
    let equal = |(m, (other, _)): &Rival<'_>| Equal { posture: other.posture.clone(), margin: *m };
    let spun = several.iter().flat_map(|s| {
        s.values[1..].iter().map(|value| {
            let mut posture = h.posture.clone();
            posture[s.joint] = *value;
            Equal { posture, margin: 0.0 }
        })
    });
    same.take(N_EQUALS).map(equal).chain(spun).collect()
}

/// What is said of a posture that is refused before it is worth a report: where it stood, and how
/// much it explained.
pub(crate) fn refused(refine: &Refine<'_>, best: &Adjusted, judgement: &Judgement) -> Fit {
    let (model, h) = (refine.prepared.model, &best.hypothesis);
    let joint = |(free, value): (&usize, &f64)| JointFit {
        name: model.joints[*free].name.clone(),
        value: *value,
        sigma: ANY_ANGLE,
        certainty: Certainty::Undetermined,
        equivalents: Vec::new(),
    };
    let mut fit = Fit {
        model: refine.prepared.index,
        model_name: model.name.clone(),
        world_from_base: refine.scene.world_from_local() * h.local_from_base,
        joints: model.free.iter().zip(&h.posture).map(joint).collect(),
        score: judgement.score,
        explained: judgement.explained,
        rms: best.rms(),
        ..Fit::default()
    };
    verdict::apply(&mut fit, &VerdictEvent::Lost);
    fit
}

fn runner_up(model: &Model, best: &Judgement, (margin, (_, other)): &Rival<'_>) -> RunnerUp {
    RunnerUp {
        model: model.name.clone(),
        score: other.explained / best.explained * best.score,
        same_model: true,
        margin: *margin,
    }
}

/// What each scan is off, where a scanner is known.
fn scans(refine: &Refine<'_>, best: &Adjusted) -> Vec<ScanShift> {
    let views = refine.scene.views.iter().zip(&best.scans);
    let base = best.hypothesis.local_from_base.translation.vector;
    views
        .filter_map(|(view, error)| {
            let scanner = view.scanner?.coords;
            Some(ScanShift {
                scan: view.scan,
                shift: (error.shift + error.turn.cross(&(base - scanner))).into(),
                turn: error.turn.into(),
                range_bias: error.bias,
            })
        })
        .collect()
}

/// The same for others that these scans see.
fn share(refine: &Refine<'_>, best: &Adjusted) -> Option<ScanShare> {
    let views = &refine.scene.views;
    let [gain, information] = best.shared.as_ref()?;
    let is_known = views.iter().all(|view| view.scanner.is_some());
    let turn = world_from_base(gain.nrows(), &best.hypothesis.local_from_base);
    is_known.then(|| ScanShare {
        scans: views.iter().map(|view| view.scan).collect(),
        errors: best.scans.iter().flat_map(|error| error.values()).collect(),
        information: information.transpose().as_slice().to_vec(),
        gain: (turn * gain).transpose().as_slice().to_vec(),
    })
}

/// For each joint, whether the points leave it open: by its standard deviation, or because a
/// posture that differs in this joint and few others explains the points as well (a flange with six
/// bolts, a wrist seen from nowhere); and how far away the farthest such value is, radians.
fn open_joints(
    refine: &Refine<'_>,
    covariance: &DMatrix<f64>,
    h: &Hypothesis,
    rivals: &[Rival<'_>],
) -> (Vec<bool>, Vec<f64>) {
    let n = h.posture.len();
    let mut open: Vec<bool> =
        (0..n).map(|j| covariance[(6 + j, 6 + j)] >= OPEN_SIGMA.powi(2)).collect();
    let mut spread = vec![0.0_f64; n];
    for (margin, (other, _)) in rivals {
        let apart: Vec<bool> = (0..n).map(|j| turn(h, other, j) > OTHER).collect();
        // One joint alone, or the tail of the chain, can be open by symmetry; a flip further up is
        // another answer.
        let first = apart.iter().position(|a| *a).unwrap_or(n);
        let is_alone = apart.iter().filter(|a| **a).count() == 1;
        let is_equal =
            *margin < if is_alone && closes(refine, first) { SLIDE_EQUAL } else { EQUAL };
        if is_equal && (is_alone || (first..n).all(|j| open[j] || j + 1 == n)) {
            for j in (0..n).filter(|&j| apart[j]) {
                open[j] = true;
                spread[j] = spread[j].max(turn(h, other, j));
            }
        }
    }
    (open, spread)
}

/// Whether a joint slides and moves nothing but a part of a tool.
pub(crate) fn closes(refine: &Refine<'_>, joint: usize) -> bool {
    refine.prepared.leaf[joint] && refine.is_prismatic(joint)
}

/// Difference of a joint between two postures, whole turns taken out, radians.
pub(crate) fn turn(a: &Hypothesis, b: &Hypothesis, joint: usize) -> f64 {
    turns::apart(a.posture[joint], b.posture[joint])
}

/// Whether two postures are different answers, some joints passed over.
fn differs(a: &Hypothesis, b: &Hypothesis, passed: &[bool]) -> bool {
    let (p, q) = (&a.local_from_base, &b.local_from_base);
    let shift = (p.translation.vector - q.translation.vector).norm();
    shift > OTHER_BASE || (0..passed.len()).any(|j| !passed[j] && turn(a, b, j) > OTHER)
}

/// The value of a joint within its limits that is nearest to zero, and the others, where a whole
/// turn changes nothing.
fn whole_turns(model: &Model, posture: &[f64], joint: usize) -> (f64, Vec<f64>) {
    let value = posture[joint];
    let index = model.free[joint];
    let [low, high] = model.limits(joint);
    let followed = model
        .joints
        .iter()
        .any(|j| matches!(j.motion, Motion::Mimic { free, .. } if free == joint));
    let slides = model.joints[index].kind == robot::JointKind::Prismatic;
    if slides || followed {
        return (value, Vec::new());
    }
    // A refinement may have come from beyond a stop: a whole turn away the joint stands within its
    // limits.
    let first = ((low - value) / TAU).ceil() as i32;
    let last = ((high - value) / TAU).floor() as i32;
    let mut all: Vec<f64> = (first..=last).map(|k| value + TAU * f64::from(k)).collect();
    all.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    if all.is_empty() {
        return (value, all);
    }
    let nearest = all.remove(0);
    (nearest, all)
}

/// Standard deviation of the tip of the main chain in the base's frame, metres.
pub(crate) fn tip_sigma(model: &Model, posture: &[f64], covariance: &DMatrix<f64>) -> f64 {
    let Some(link) = model.main_chain.last().map(|&j| model.joints[j].child) else { return 0.0 };
    let kinematics = model.kinematics(posture);
    let tip = kinematics.base_from_link[link].translation.vector;
    let n = posture.len();
    let mut moves = DMatrix::zeros(3, n);
    for (j, t) in kinematics.twists[link].iter().enumerate() {
        let v = Vector::new(t[0], t[1], t[2]) + Vector::new(t[3], t[4], t[5]).cross(&tip);
        moves.set_column(j, &DVector::from_column_slice(v.as_slice()));
    }
    let joints = covariance.view((6, 6), (n, n));
    (&moves * joints * moves.transpose()).trace().max(0.0).sqrt()
}

/// The covariance with the base's twist turned from base axes to world axes.
fn in_world_axes(covariance: &DMatrix<f64>, local_from_base: &Pose) -> DMatrix<f64> {
    let turn = world_from_base(covariance.nrows(), local_from_base);
    &turn * covariance * turn.transpose()
}

/// Turns a base twist, with joints behind it, from base axes to world axes.
fn world_from_base(n: usize, local_from_base: &Pose) -> DMatrix<f64> {
    let turn = local_from_base.rotation.to_rotation_matrix();
    let mut out = DMatrix::identity(n, n);
    for block in [0, 3] {
        out.fixed_view_mut::<3, 3>(block, block).copy_from(turn.matrix());
    }
    out
}
