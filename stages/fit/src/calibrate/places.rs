//! Estimates where a robot's joints are on its links, as far as the points of one fit tell, and
//! whether that is where the model has them (METHOD.md §17).
//!
//! Each free joint gets a shift and a turn of its frame with a prior beside base, posture and scans
//! in one adjustment. About (or along) its own axis it gets none, since the joint itself moves
//! there: scans of one posture cannot tell the offset of a controller's zero.

use contract::JointFrame;
use nalgebra::{DMatrix, DVector};
use robot::{JointKind, Model};
use std::f64::consts::PI;

use crate::adjust::{Adjust, Adjusted, Normal};
use crate::correspond::adjusted_points;
use crate::modes::{JointModes, Settled};
use crate::problem::{AdjustState, Problem};
use crate::state::{Hypothesis, pose_of};

/// Steps of the joints' places: each after an adjustment of all the rest.
const N_STEPS: usize = 4;
/// Standard deviation of what is not asked, relative to that of the prior.
const FIXED: f64 = 1e-3;

/// A joint that is clearly not where its model has it.
struct ClearlyElsewhere {
    /// Least lean of its axis, radians.
    swing: f64,
    /// Least distance of its axis, metres (METHOD.md §17).
    offset: f64,
    /// Either in standard deviations of its own, at least.
    sigmas: f64,
}

const CLEAR: ClearlyElsewhere =
    ClearlyElsewhere { swing: 0.1_f64.to_radians(), offset: 0.002, sigmas: 3.0 };

/// A surface that is off by less over its patches is that of its model, joints and all: the larger
/// of both counts. Of robots that are their models it was 0 at a noise of 2 mm, up to 0.5 mm at 10
/// mm; with joints off by 2 mm and 0.1° 0.4 mm and more.
struct SmoothSurface {
    /// Metres.
    least: f64,
    /// In standard deviations of the scans' noise.
    sigmas: f64,
}

const SMOOTH: SmoothSurface = SmoothSurface { least: 0.000_25, sigmas: 0.05 };
/// One point of so many is asked about the places of joints.
const DOUBT_PART: usize = 4;

/// A model whose joints stand where the points have them.
pub(super) struct OwnModel {
    pub(super) model: Model,
    /// The adjustment of base and posture on it.
    pub(super) adjusted: Adjusted,
    /// Where its joints are against the nominal model.
    pub(super) frames: Vec<JointFrame>,
}

/// The model with its joints where the points have them, from one point of `every`.
pub(super) fn estimate(problem: &Problem<'_>, start: &Hypothesis, every: usize) -> OwnModel {
    let nominal = problem.prepared.model;
    let mut model = nominal.clone();
    let mut h = start.clone();
    let mut step = 0;
    loop {
        let own = problem.prepared.moved(&model);
        let problem = Problem { prepared: &own, ..*problem };
        let settings = problem.settings;
        let mut points = adjusted_points(&problem, &h, settings.part()).every(every);
        let start = AdjustState::at(&h, problem.scene).with_open_smoothness();
        let mut done = Adjust::new(&problem).run_from(start, &mut points);
        h = done.hypothesis.clone();
        let state = done.state();
        let with_places = Adjust { places: &nominal.free, ..Adjust::new(&problem) };
        let mut normal = with_places.at(&state, &mut points);
        let frames = frames(nominal, &model);
        add_frame_priors(&mut normal, &frames, settings.frame_sigma);
        let solved = if step < N_STEPS { normal.solve() } else { None };
        let Some(change) = solved else {
            let covariance = normal.covariance(&own.patches);
            let n = 6 + h.posture.len();
            done.covariance = covariance.view((0, 0), (n, n)).into_owned();
            let frames = with_sigmas(frames, &covariance);
            return OwnModel { model, adjusted: done, frames };
        };
        apply(&mut model, &mut h, &change);
        step += 1;
    }
}

/// Whether the robot's joints are where its model has them, from a part of its points. Where they
/// are not, base and joints may be off by what they would move if the places of the joints were
/// free: their covariance is widened by that, and it is said.
pub(crate) fn doubt_places(
    problem: &Problem<'_>,
    Settled { adjusted: best, leaves, .. }: &mut Settled,
) -> Vec<String> {
    if best.patch_sigma < SMOOTH.least.max(SMOOTH.sigmas * problem.scene.noise) {
        return Vec::new();
    }
    let OwnModel { adjusted: moved, frames, .. } = estimate(problem, &best.hypothesis, DOUBT_PART);
    open_beside(problem, &frames, leaves);
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

/// Whether a joint's axis is clearly not where its model has it.
fn is_beside(frame: &JointFrame) -> bool {
    let [offset, sigma] = frame.offset();
    offset > CLEAR.offset && offset > CLEAR.sigmas * sigma
}

/// A bare flange that is clearly elsewhere fits its bolts at a wrong turn as well as at its own,
/// and a wrong turn puts it elsewhere: any value may be right.
pub(super) fn open_beside(problem: &Problem<'_>, frames: &[JointFrame], leaves: &mut [JointModes]) {
    let prepared = problem.prepared;
    let is_bare = |j: usize| prepared.carried(j).len() == prepared.placed_by[j].len();
    for leaf in leaves.iter_mut().filter(|s| is_bare(s.joint) && is_beside(&frames[s.joint])) {
        leaf.extent = PI;
    }
}

/// Joints that are clearly elsewhere than their model has them.
pub(super) fn words(frames: &[JointFrame]) -> Vec<String> {
    let mut out = Vec::new();
    for frame in frames {
        let ([swing, swing_sigma], [offset, offset_sigma]) = (frame.swing(), frame.offset());
        if swing > CLEAR.swing && swing > CLEAR.sigmas * swing_sigma {
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
pub(super) fn prior(frame: &JointFrame, [shift, turn]: [f64; 2]) -> [f64; 6] {
    let along = frame.axis.map(f64::abs);
    let along = (0..3).max_by(|a, b| along[*a].total_cmp(&along[*b])).unwrap_or(0);
    std::array::from_fn(|i| {
        // Axes of real robots run along an axis of their frame; of others the nearest is taken.
        let is_own = i % 3 == along && (i < 3) == frame.slides;
        let sigma = if i < 3 { shift } else { turn };
        sigma * if is_own { FIXED } else { 1.0 }
    })
}

/// Frames are where the model has them, as well as the priors say.
fn add_frame_priors(normal: &mut Normal, frames: &[JointFrame], sigmas: [f64; 2]) {
    let first = normal.n_robot() - 6 * frames.len();
    for (f, frame) in frames.iter().enumerate() {
        let values = frame.shift.into_iter().chain(frame.turn);
        for (i, (value, sigma)) in values.zip(prior(frame, sigmas)).enumerate() {
            normal.add_prior(first + 6 * f + i, value, sigma);
        }
    }
}

/// Takes a step of base, posture and frames.
fn apply(model: &mut Model, h: &mut Hypothesis, change: &DVector<f64>) {
    h.take(change.as_slice());
    let first = 6 + h.posture.len();
    for (f, &j) in model.free.iter().enumerate() {
        let at = first + 6 * f;
        model.joints[j].parent_from_joint *= pose_of(&change.as_slice()[at..at + 6]);
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
