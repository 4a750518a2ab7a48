//! Adds what is known before any point is looked at to normal equations: the plane that the base
//! stands on, joint limits, and how well scans are registered (METHOD.md §5, §11.5).

use geometry::Vector;
use nalgebra::{DMatrix, DVector};
use robot::JointKind;

use super::base_prior::Prior;
use super::context::Problem;
use crate::state::{Hypothesis, N_SCAN};
use crate::{Prepared, Settings};

/// The prior of a step, one sigma: 40° or 0.7 m. It damps what the points do not tell.
const STEP_SIGMA: f64 = 0.7;
/// How far a joint may stand beyond its limit, radians, one sigma (0.5°): hard stops have play.
const LIMIT_SIGMA: f64 = 0.0087;
/// Standard deviations from the installation plane from which on the base is likely to stand on
/// another one.
const OFF_PLANE_SIGMAS: f64 = 3.0;
/// How far a sliding joint may stand beyond its limits, metres: what models and stops may be off.
const SLIDE_PLAY: f64 = 0.004;

/// Adds joint limits, the installation plane, and a weak pull to stay where the points say nothing
/// to normal equations of base twist (base axes) and joints.
pub(crate) fn add_priors(
    problem: &Problem<'_>,
    h: &Hypothesis,
    hessian: &mut DMatrix<f64>,
    gradient: &mut DVector<f64>,
) {
    const STAY: f64 = 1.0 / (STEP_SIGMA * STEP_SIGMA);
    for a in 0..hessian.nrows() {
        hessian[(a, a)] += STAY;
    }
    let model = problem.prepared.model;
    for (j, q) in h.posture.iter().enumerate() {
        let [low, high] = model.limits(j);
        let continuous = model.joints[model.free[j]].kind == JointKind::Continuous;
        let over = if continuous { 0.0 } else { (q - high).max(0.0) + (q - low).min(0.0) };
        if over != 0.0 {
            let w = 1.0 / (LIMIT_SIGMA * LIMIT_SIGMA);
            hessian[(6 + j, 6 + j)] += w;
            gradient[6 + j] += w * over;
        }
    }
    if let Some(prior) = &problem.prior {
        add_plane(prior, h, hessian, gradient);
    }
}

/// Height over the plane and tilt against it, of the base as it stands, in base axes.
fn add_plane(
    prior: &Prior,
    h: &Hypothesis,
    hessian: &mut DMatrix<f64>,
    gradient: &mut DVector<f64>,
) {
    let plane_from_base = prior.local_from_plane.inverse() * h.local_from_base;
    let up = plane_from_base.rotation.inverse() * Vector::z();
    let [ws, wt] = prior.sigma.map(|s| 1.0 / (s * s));
    let height = plane_from_base.translation.z;
    // A base that by its points stands on a plate before the plane is not pulled back to it
    // (METHOD.md §5).
    let far = height / (OFF_PLANE_SIGMAS * prior.sigma[0]);
    let ws = ws / (1.0 + far * far).powi(2);
    for a in 0..3 {
        gradient[a] += ws * height * up[a];
        for b in 0..3 {
            hessian[(a, b)] += ws * up[a] * up[b];
        }
    }
    // The plane's normal in base axes is `up`; a small rotation w of the base changes it by
    // −w × up.
    let tilt = Vector::z().cross(&up);
    for a in 0..2 {
        gradient[3 + a] += -wt * tilt[a];
        hessian[(3 + a, 3 + a)] += wt;
    }
}

/// Puts sliding joints that left their limits back: points along a rod would pull it past its end.
pub(crate) fn keep_slides(prepared: &Prepared<'_>, h: &mut Hypothesis) {
    for joint in (0..h.posture.len()).filter(|&j| prepared.slides(j)) {
        let [low, high] = prepared.model.limits(joint);
        h.posture[joint] = h.posture[joint].clamp(low - SLIDE_PLAY, high + SLIDE_PLAY);
    }
}

/// Weights of what is known of a scan's errors beforehand, m⁻² and rad⁻².
pub(crate) fn scan_priors(settings: &Settings) -> [f64; N_SCAN] {
    let [shift, turn, bias] = settings.scan_sigma.map(|sigma| 1.0 / (sigma * sigma));
    [shift, shift, shift, turn, turn, turn, bias]
}
