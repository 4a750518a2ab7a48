//! A fit and its points in; out come where the robot's joints really are on their links, as far as the points tell, and
//! the fit of the robot so corrected (fit.md §4f: swing and offset of axes; §7: link lengths).
//!
//! Each free joint gets a shift and a turn of its frame with a prior beside base, posture and scans in one adjustment;
//! about (or along) its own axis it gets none, since the joint itself moves there: what a controller's zero is off by
//! no scan of one posture can tell.

use contract::{Calibration, Fan, Fit, JointFrame};
use geometry::{Pose, Vector};
use nalgebra::{DMatrix, DVector, Translation3, UnitQuaternion};
use robot::{JointKind, Kinematics, Model};

use crate::adjust::{Adjust, State};
use crate::beam::Hypothesis;
use crate::refine::Refine;
use crate::solve::{NEAR_MARGIN, adjusted_points, judged};
use crate::{Prepared, Scene, Settings, report};

/// Steps of the joints' places: each after an adjustment of all the rest.
const N_STEPS: usize = 4;
/// Standard deviation of what is not asked, relative to that of the prior.
const FIXED: f64 = 1e-3;
/// A joint this far off is worth a word: swing, radians (0.1°), and offset of its axis, metres (fit.md §4f) …
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
    fan: &impl Fan,
) -> (Model, Fit) {
    let nominal = prepared.model;
    let mut model = nominal.clone();
    let mut h = Hypothesis {
        local_from_base: scene.world_from_local().inverse() * fit.world_from_base,
        posture: fit.joints.iter().map(|j| j.value).collect(),
        score: 0.0,
    };
    let base = geometry::Point::from(h.local_from_base.translation.vector);
    let [near, all] = scene.within(&base, prepared.reach + NEAR_MARGIN);
    let mut step = 0;
    loop {
        let own = prepared.moved(&model);
        let refine = Refine { prepared: &own, scene, settings, prior: None };
        let (points, gate) = adjusted_points(&refine, &h, &all, fan);
        let mut done = Adjust { refine: &refine, frames: &[] }.run(&h, &points, gate, fan);
        h = done.hypothesis.clone();
        let state = State {
            hypothesis: h.clone(),
            scans: done.scans.clone(),
            patch_sigma: done.patch_sigma,
        };
        let mut normal =
            Adjust { refine: &refine, frames: &nominal.free }.at(&state, &points, gate, fan);
        let n = 6 + h.posture.len();
        let frames = frames(nominal, &model);
        for (f, frame) in frames.iter().enumerate() {
            let values = frame.shift.into_iter().chain(frame.turn);
            for (i, (value, sigma)) in values.zip(prior(frame, settings.frame_sigma)).enumerate() {
                normal.add_prior(n + 6 * f + i, value, sigma);
            }
        }
        let solved = if step < N_STEPS { normal.solve() } else { None };
        let Some(change) = solved else {
            let covariance = normal.covariance(&own.patch_groups);
            done.covariance = covariance.view((0, 0), (n, n)).into_owned();
            let judgement = judged(&refine, &h);
            let spins = refine.spins(&h, &near, scene.noise * scene.noise);
            let mut out = report::report(&refine, &(done, judgement, spins), &[], &near, fan);
            let found = calibration(frames, &covariance, (fit, &out), settings);
            keep(&mut out, fit, found);
            return (model, out);
        };
        apply(&mut model, &mut h, &change);
        step += 1;
    }
}

/// What the nominal fit knows and the calibrated one keeps; and what the calibration found, in words.
fn keep(out: &mut Fit, fit: &Fit, found: Calibration) {
    out.runner_up.clone_from(&fit.runner_up);
    out.equals.clone_from(&fit.equals);
    out.alike.clone_from(&fit.alike);
    out.tool.clone_from(&fit.tool);
    out.verdict = out.verdict.min(fit.verdict);
    for frame in &found.frames {
        let ([swing, swing_sigma], [offset, offset_sigma]) = (frame.swing(), frame.offset());
        if swing > WORTH.0 && swing > CLEAR * swing_sigma {
            let (a, s) = (swing.to_degrees(), swing_sigma.to_degrees());
            out.reasons.push(format!(
                "the axis of joint '{}' leans {a:.2} ± {s:.2}° from the model's",
                frame.name
            ));
        }
        if offset > WORTH.1 && offset > CLEAR * offset_sigma {
            let (a, s) = (offset * 1e3, offset_sigma * 1e3);
            out.reasons.push(format!(
                "the axis of joint '{}' runs {a:.1} ± {s:.1} mm beside the model's",
                frame.name
            ));
        }
    }
    out.calibration = Some(found);
}

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

/// Standard deviations of shifts and turns of a joint's frame before any point is looked at: what its joint does itself
/// it does not.
fn prior(frame: &JointFrame, [shift, turn]: [f64; 2]) -> [f64; 6] {
    std::array::from_fn(|i| {
        // Axes of real robots run along an axis of their frame; of others the nearest is taken.
        let is_own = frame.axis[i % 3].abs() > 0.8 && (i < 3) == frame.slides;
        let sigma = if i < 3 { shift } else { turn };
        sigma * if is_own { FIXED } else { 1.0 }
    })
}

/// What several postures of one robot, or several robots of one model, say together of the places of its joints; `None`
/// where they are of different models.
#[must_use]
pub fn combine(all: &[&Calibration]) -> Option<Calibration> {
    let first = *all.first()?;
    let n = 6 * first.frames.len();
    let names = |c: &Calibration| c.frames.iter().map(|f| f.name.clone()).collect::<Vec<_>>();
    let alike = |c: &&Calibration| names(c) == names(first) && c.covariance.len() == n * n;
    if !all.iter().all(alike) {
        return None;
    }
    let sigmas = first.frames.iter().flat_map(|f| prior(f, first.prior));
    let own = DMatrix::from_diagonal(&DVector::from_iterator(n, sigmas.map(|s| s.powi(-2))));
    let (mut information, mut pull) = (own.clone(), DVector::zeros(n));
    for c in all {
        let inverse = DMatrix::from_row_slice(n, n, &c.covariance).cholesky()?.inverse();
        let values = c.frames.iter().flat_map(|f| f.shift.into_iter().chain(f.turn));
        pull += &inverse * DVector::from_iterator(n, values);
        // The prior counts once.
        let mut told = (inverse - &own).symmetric_eigen();
        told.eigenvalues.iter_mut().for_each(|v| *v = v.max(0.0));
        information += told.recompose();
    }
    let covariance = information.cholesky()?.inverse();
    let values = &covariance * pull;
    let mut out = first.clone();
    for (f, frame) in out.frames.iter_mut().enumerate() {
        frame.shift = [0, 1, 2].map(|i| values[6 * f + i]);
        frame.turn = [3, 4, 5].map(|i| values[6 * f + i]);
        frame.sigma = std::array::from_fn(|i| covariance[(6 * f + i, 6 * f + i)].sqrt());
    }
    out.covariance = (0..n * n).map(|i| covariance[(i / n, i % n)]).collect();
    out.link_rms = Vec::new();
    Some(out)
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

fn calibration(
    mut frames: Vec<JointFrame>,
    covariance: &DMatrix<f64>,
    (before, after): (&Fit, &Fit),
    settings: &Settings,
) -> Calibration {
    let n = 6 * frames.len();
    let first = covariance.nrows() - n;
    for (f, frame) in frames.iter_mut().enumerate() {
        frame.sigma = std::array::from_fn(|i| {
            let at = first + 6 * f + i;
            covariance[(at, at)].max(0.0).sqrt()
        });
    }
    Calibration {
        frames,
        covariance: (0..n * n).map(|i| covariance[(first + i / n, first + i % n)]).collect(),
        prior: settings.frame_sigma,
        link_rms: before.links.iter().zip(&after.links).map(|(b, a)| [b.rms, a.rms]).collect(),
    }
}

/// How links move with the places of joints.
pub(crate) struct Frames {
    /// For each joint: twists `[v, w]` in the base frame for unit shifts and turns along its frame's axes.
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

    /// Derivatives of a residual at a point with a facet's normal (base frame) by the places of the joints.
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
