//! A fit and its points in; out come where the robot's joints really are on their links, as far as
//! the points tell, and the fit of the robot so corrected (METHOD.md §17).
//!
//! Each free joint gets a shift and a turn of its frame with a prior beside base, posture and scans
//! in one adjustment; about (or along) its own axis it gets none, since the joint itself moves
//! there: what a controller's zero is off by no scan of one posture can tell.

use contract::{Calibration, Fan, Fit, JointFrame, Verdict};
use geometry::{Pose, Vector, robust};
use nalgebra::{DMatrix, DVector, Translation3, UnitQuaternion};
use robot::{JointKind, Kinematics, Model};
use std::f64::consts::PI;

use crate::adjust::{Adjust, Adjusted, State};
use crate::beam::Hypothesis;
use crate::judge::judged;
use crate::normal::Normal;
use crate::refine::Refine;
use crate::settle::better;
use crate::solve::NEAR_MARGIN;
use crate::spin::Spin;
use crate::strata::adjusted_points;
use crate::verdict::{self, JudgedFit, VerdictEvent};
use crate::wrist::Wrist;
use crate::{Prepared, Scene, Settings, report};

/// Steps of the joints' places: each after an adjustment of all the rest.
const N_STEPS: usize = 4;
/// Standard deviation of what is not asked, relative to that of the prior.
const FIXED: f64 = 1e-3;
/// A joint this far off is worth a word: swing, radians (0.1°), and offset of its axis, metres
/// (METHOD.md §17) …
const WORTH: (f64, f64) = (0.001_75, 0.002);
/// … if it is so many standard deviations.
const CLEAR: f64 = 3.0;

/// The robot's own model and its fit.
#[must_use]
pub fn calibrate(
    fit: &Fit,
    prepared: &Prepared<'_>,
    scene: &Scene<'_>,
    settings: &Settings,
    fan: &dyn Fan,
) -> (Model, Fit) {
    let h = Hypothesis {
        local_from_base: scene.world_from_local().inverse() * fit.world_from_base,
        posture: fit.joints.iter().map(|j| j.value).collect(),
        score: 0.0,
    };
    let base = geometry::Point::from(h.local_from_base.translation.vector);
    let [near, all] = scene.within(&base, prepared.reach + NEAR_MARGIN);
    let refine = Refine { prepared, scene, settings, prior: None };
    let spins = |model: &Model, h: &Hypothesis| {
        let refine = Refine { prepared: &prepared.moved(model), ..refine };
        refine.spins(h, &near, fan)
    };
    let (mut model, mut done, mut frames) = estimate(&refine, &h, &all, 1, fan);
    let mut turns = spins(&model, &done.hypothesis);
    // On joints that are where they are the flange may fit at another turn than on the model's.
    if let Some(posture) = better(&done.hypothesis.posture, &turns) {
        let h = Hypothesis { posture, ..done.hypothesis };
        (model, done, frames) = estimate(&refine, &h, &all, 1, fan);
        turns = spins(&model, &done.hypothesis);
    }
    open_beside(&refine, &frames, &mut turns);
    let own = prepared.moved(&model);
    let refine = Refine { prepared: &own, ..refine };
    let judgement = judged(&refine, &done.hypothesis);
    let mut points = adjusted_points(&refine, &done.hypothesis, (&all, settings.part()), fan);
    Adjust::new(&refine).sums(&done.state(), &mut points, fan);
    let wrist = Wrist::of(&refine, (&done, &turns), &points, fan);
    let done = (done, judgement, turns);
    let mut out = report::report(&refine, &done, &[], (&near, &points), wrist.as_ref(), fan);
    let nominal = as_known(&Refine { prepared, ..refine }, fit, &h, &out);
    verdict::apply(&mut out, &VerdictEvent::Calibrated(nominal));
    let link_rms = fit.links.iter().zip(&out.links).map(|(b, a)| [b.rms, a.rms]).collect();
    keep(&mut out, fit, Calibration { frames, prior: settings.frame_sigma, link_rms });
    (model, out)
}

/// The model with its joints where the points have them, the adjustment of its base and posture,
/// and where they are; from one point of `every`.
fn estimate(
    refine: &Refine<'_>,
    start: &Hypothesis,
    all: &[u32],
    every: usize,
    fan: &dyn Fan,
) -> (Model, Adjusted, Vec<JointFrame>) {
    let nominal = refine.prepared.model;
    let mut model = nominal.clone();
    let mut h = start.clone();
    let mut step = 0;
    loop {
        let own = refine.prepared.moved(&model);
        let refine = Refine { prepared: &own, prior: refine.prior, ..*refine };
        let mut points =
            adjusted_points(&refine, &h, (all, refine.settings.part()), fan).every(every);
        let start = State::at(&h, refine.scene).open();
        let mut done = Adjust::new(&refine).run_from(start, &mut points, fan);
        h = done.hypothesis.clone();
        let state = done.state();
        let with_frames = Adjust { frames: &nominal.free, ..Adjust::new(&refine) };
        let mut normal = with_frames.at(&state, &mut points, fan);
        let frames = frames(nominal, &model);
        normal.add_frame_priors(&frames, refine.settings.frame_sigma);
        let solved = if step < N_STEPS { normal.solve() } else { None };
        let Some(change) = solved else {
            let covariance = normal.covariance(&own.patches);
            let n = 6 + h.posture.len();
            done.covariance = covariance.view((0, 0), (n, n)).into_owned();
            let frames = with_sigmas(frames, &covariance);
            return (model, done, frames);
        };
        apply(&mut model, &mut h, &change);
        step += 1;
    }
}

/// The verdict on the nominal fit, had its joints been known as well as the calibrated ones are:
/// that they are elsewhere is what it did not know.
fn as_known(nominal: &Refine<'_>, fit: &Fit, h: &Hypothesis, calibrated: &Fit) -> Verdict {
    let judgement = judged(nominal, h);
    let (prepared, scene) = (nominal.prepared, nominal.scene);
    let judged = JudgedFit { prepared, scene, judgement: &judgement, held: None };
    // Others than the points may have made it doubtful.
    if fit.verdict < verdict::by_rules(fit, &judged) {
        return fit.verdict;
    }
    let (joints, covariance) = (calibrated.joints.clone(), calibrated.covariance.clone());
    verdict::by_rules(&Fit { joints, covariance, ..fit.clone() }, &judged)
}

/// What the nominal fit knows and the calibrated one keeps; and what the calibration found, in
/// words.
fn keep(out: &mut Fit, fit: &Fit, found: Calibration) {
    out.runner_up.clone_from(&fit.runner_up);
    out.equals.clone_from(&fit.equals);
    out.alike.clone_from(&fit.alike);
    out.tool.clone_from(&fit.tool);
    out.other_branches.clone_from(&fit.other_branches);
    verdict::note(out, words(&found.frames));
    out.calibration = Some(found);
}

/// Whether a joint's axis is clearly not where its model has it.
fn is_beside(frame: &JointFrame) -> bool {
    let [offset, sigma] = frame.offset();
    offset > WORTH.1 && offset > CLEAR * sigma
}

/// A bare flange that is clearly elsewhere fits its bolts at a wrong turn as well as at its own,
/// and a wrong turn puts it elsewhere: any value may be right.
fn open_beside(refine: &Refine<'_>, frames: &[JointFrame], spins: &mut [Spin]) {
    let is_bare = |j: usize| refine.prepared.carried(j).len() == refine.prepared.placed_by[j].len();
    for spin in spins.iter_mut().filter(|s| is_bare(s.joint) && is_beside(&frames[s.joint])) {
        spin.extent = PI;
    }
}

/// Joints that are clearly elsewhere than their model has them.
fn words(frames: &[JointFrame]) -> Vec<String> {
    let mut out = Vec::new();
    for frame in frames {
        let ([swing, swing_sigma], [offset, offset_sigma]) = (frame.swing(), frame.offset());
        if swing > WORTH.0 && swing > CLEAR * swing_sigma {
            let (a, s) = (swing.to_degrees(), swing_sigma.to_degrees());
            out.push(format!(
                "the axis of joint '{}' leans {a:.2} ± {s:.2}° from the model's",
                frame.name
            ));
        }
        if is_beside(frame) {
            let (a, s) = (offset * 1e3, offset_sigma * 1e3);
            out.push(format!(
                "the axis of joint '{}' runs {a:.1} ± {s:.1} mm beside the model's",
                frame.name
            ));
        }
    }
    out
}

/// Whether the robot's joints are where its model has them, from a part of its points. Where they
/// are not, base and joints may be off by what they would move if the places of the joints were
/// free: their covariance is widened by that, and it is said.
pub(crate) fn doubt(
    refine: &Refine<'_>,
    (best, spins): (&mut Adjusted, &mut [Spin]),
    all: &[u32],
    fan: &dyn Fan,
) -> Vec<String> {
    if best.patch_sigma < SMOOTH.0.max(SMOOTH.1 * refine.scene.noise) {
        return Vec::new();
    }
    let (_, moved, frames) = estimate(refine, &best.hypothesis, all, EVERY, fan);
    open_beside(refine, &frames, spins);
    let words = words(&frames);
    if !words.is_empty() {
        let (was, is) = (&best.hypothesis, &moved.hypothesis);
        let off = was.local_from_base.inverse() * is.local_from_base;
        let (shift, turn) = (off.translation.vector, off.rotation.scaled_axis());
        let joints = was.posture.iter().zip(&is.posture).map(|(a, b)| b - a);
        let change = shift.iter().chain(&turn).copied().chain(joints);
        for (i, change) in change.enumerate() {
            best.covariance[(i, i)] += change * change;
        }
    }
    words
}

/// A surface that is off by less over its patches is that of its model, joints and all: metres, and
/// in multiples of the scans' noise. Of robots that are their models it was 0 at 2 mm, up to 0.5 mm
/// at 10 mm; with joints off by 2 mm and 0.1° 0.4 mm and more.
const SMOOTH: (f64, f64) = (0.000_25, 0.05);
/// One point of so many is asked about the places of joints.
const EVERY: usize = 4;

/// Shift and turn of each free joint's frame between two models, in the first one's joint frame.
fn frames(nominal: &Model, model: &Model) -> Vec<JointFrame> {
    let of = |&j: &usize| {
        let moved =
            nominal.joints[j].parent_from_joint.inverse() * model.joints[j].parent_from_joint;
        JointFrame {
            name: nominal.joints[j].name.clone(),
            axis: nominal.joints[j].axis.into_inner().into(),
            slides: nominal.joints[j].kind == JointKind::Prismatic,
            shift: moved.translation.vector.into(),
            turn: moved.rotation.scaled_axis().into(),
            sigma: [0.0; 6],
        }
    };
    nominal.free.iter().map(of).collect()
}

/// Standard deviations of shifts and turns of a joint's frame before any point is looked at: what
/// its joint does itself it does not.
fn prior(frame: &JointFrame, [shift, turn]: [f64; 2]) -> [f64; 6] {
    let along = frame.axis.map(f64::abs);
    let along = (0..3).max_by(|a, b| along[*a].total_cmp(&along[*b])).unwrap_or(0);
    std::array::from_fn(|i| {
        // Axes of real robots run along an axis of their frame; of others the nearest is taken.
        let is_own = i % 3 == along && (i < 3) == frame.slides;
        let sigma = if i < 3 { shift } else { turn };
        sigma * if is_own { FIXED } else { 1.0 }
    })
}

impl Normal {
    /// Frames are where the model has them, give or take.
    fn add_frame_priors(&mut self, frames: &[JointFrame], sigmas: [f64; 2]) {
        let first = self.n_robot() - 6 * frames.len();
        for (f, frame) in frames.iter().enumerate() {
            let values = frame.shift.into_iter().chain(frame.turn);
            for (i, (value, sigma)) in values.zip(prior(frame, sigmas)).enumerate() {
                self.add_prior(first + 6 * f + i, value, sigma);
            }
        }
    }
}

/// What several postures of one robot, or several robots of one model, say together of the places
/// of its joints; `None` where they are of different models.
///
/// Value by value, not by their covariance: one wrist that stands wrong must not pull at joints
/// that are right, and counts less the farther it is off.
#[must_use]
pub fn combine(all: &[&Calibration]) -> Option<Calibration> {
    let first = *all.first()?;
    let names = |c: &Calibration| c.frames.iter().map(|f| f.name.clone()).collect::<Vec<_>>();
    if !all.iter().all(|c| names(c) == names(first)) {
        return None;
    }
    let mut out = Calibration { link_rms: Vec::new(), ..first.clone() };
    for (f, frame) in out.frames.iter_mut().enumerate() {
        let before = prior(frame, first.prior);
        for i in 0..6 {
            let value = |c: &&Calibration| {
                let f = &c.frames[f];
                let v = if i < 3 { f.shift[i] } else { f.turn[i - 3] };
                told(v, f.sigma[i], before[i])
            };
            let values: Vec<[f64; 2]> = all.iter().filter_map(value).collect();
            let [v, sigma] = mean(&values, before[i]);
            frame.sigma[i] = sigma;
            if i < 3 { frame.shift[i] = v } else { frame.turn[i - 3] = v }
        }
    }
    Some(out)
}

/// What the points alone say of a value that was found with a prior: value and weight; `None` where
/// they say nothing.
fn told(value: f64, sigma: f64, prior: f64) -> Option<[f64; 2]> {
    let (whole, own) = (sigma.powi(-2), prior.powi(-2));
    let weight = whole - own;
    (weight > 0.05 * own).then(|| [value * whole / weight, weight])
}

/// Robust weighted mean with the prior, and its standard deviation.
fn mean(values: &[[f64; 2]], prior: f64) -> [f64; 2] {
    const N_ROUNDS: usize = 10;
    // So many standard deviations off a value counts fully; beyond less (Huber).
    const FULLY: f64 = 1.5;
    let mut at: Vec<f64> = values.iter().map(|v| v[0]).collect();
    let mut middle = robust::median(&mut at).unwrap_or(0.0);
    let mut total = prior.powi(-2);
    for _ in 0..N_ROUNDS {
        let mut sum = 0.0;
        total = prior.powi(-2);
        for [value, weight] in values {
            let off = (value - middle).abs() * weight.sqrt();
            let weight = weight * (FULLY / off.max(FULLY)).powi(2);
            sum += weight * value;
            total += weight;
        }
        middle = sum / total;
    }
    [middle, total.sqrt().recip()]
}

/// A step of base, posture and frames.
fn apply(model: &mut Model, h: &mut Hypothesis, change: &DVector<f64>) {
    let pose = |at: usize| {
        let v = |k: usize| Vector::new(change[at + k], change[at + k + 1], change[at + k + 2]);
        Pose::from_parts(Translation3::from(v(0)), UnitQuaternion::from_scaled_axis(v(3)))
    };
    h.local_from_base *= pose(0);
    for (j, q) in h.posture.iter_mut().enumerate() {
        *q += change[6 + j];
    }
    let first = 6 + h.posture.len();
    for (f, &j) in model.free.iter().enumerate() {
        model.joints[j].parent_from_joint *= pose(first + 6 * f);
    }
}

/// Standard deviations of the frames from the covariance, whose last rows are theirs.
fn with_sigmas(mut frames: Vec<JointFrame>, covariance: &DMatrix<f64>) -> Vec<JointFrame> {
    let first = covariance.nrows() - 6 * frames.len();
    for (f, frame) in frames.iter_mut().enumerate() {
        frame.sigma = std::array::from_fn(|i| {
            let at = first + 6 * f + i;
            covariance[(at, at)].max(0.0).sqrt()
        });
    }
    frames
}

/// How links move with the places of joints.
pub(crate) struct Frames {
    /// For each joint: twists `[v, w]` in the base frame for unit shifts and turns along its
    /// frame's axes.
    twists: Vec<[[f64; 6]; 6]>,
    /// For each link, for each joint: whether the joint carries it.
    carries: Vec<Vec<bool>>,
}

impl Frames {
    pub(crate) fn new(model: &Model, kinematics: &Kinematics, joints: &[usize]) -> Self {
        let twists = joints.iter().map(|&j| {
            let joint = &model.joints[j];
            let frame = kinematics.base_from_link[joint.parent] * joint.parent_from_joint;
            let at = frame.translation.vector;
            std::array::from_fn(|i| {
                let axis = frame.rotation * Vector::ith(i % 3, 1.0);
                let v = if i < 3 { axis } else { at.cross(&axis) };
                let w = if i < 3 { Vector::zeros() } else { axis };
                [v.x, v.y, v.z, w.x, w.y, w.z]
            })
        });
        let twists = twists.collect();
        let carries = (0..if joints.is_empty() { 0 } else { model.links.len() })
            .map(|l| joints.iter().map(|&j| model.hangs_on(l, j)).collect())
            .collect();
        Self { twists, carries }
    }

    /// Derivatives of a residual at a point with a facet's normal (base frame) by the places of the
    /// joints.
    pub(crate) fn row(&self, link: usize, q: &Vector, n: &Vector, out: &mut [f64]) {
        let qxn = q.cross(n);
        for (f, twists) in self.twists.iter().enumerate() {
            for (i, t) in twists.iter().enumerate() {
                out[6 * f + i] = if self.carries[link][f] {
                    -(n.x * t[0]
                        + n.y * t[1]
                        + n.z * t[2]
                        + qxn.x * t[3]
                        + qxn.y * t[4]
                        + qxn.z * t[5])
                } else {
                    0.0
                };
            }
        }
    }
}
