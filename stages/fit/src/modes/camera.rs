//! How far base and joints may be off where depth cameras measured them, beyond what the scatter of
//! the points says (METHOD.md §14.2).
//!
//! A camera shifts whole links, each by an amount of its own: up to 15 mm where its neighbour is
//! not shifted, with hundreds of points and more on each (`scripts/camera_residuals.py`). Such
//! errors leave no residuals, since the joints between the links follow them. Here they are laid on
//! the links, and the answer of the adjustment to them is computed.

use geometry::{Point, Vector, robust};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::PI;

use super::foot::Foot;
use super::settings::{CameraLimits, MODES};
use crate::adjust::{Adjusted, kernel_scale};
use crate::correspond::{AdjustPoints, Pairing, SurfacePair};
use crate::problem::{Problem, add_priors, residual_row};
use crate::state::Hypothesis;

const LIMITS: CameraLimits = MODES.camera;

/// Ways in which a link may be off: along the beams as a whole, and growing to either side of the
/// image.
const N_WAYS: usize = 3;

/// What is added to the covariance of base twist (base axes) and joints.
pub(crate) fn camera_spread(
    problem: &Problem<'_>,
    best: &Adjusted,
    points: &AdjustPoints,
) -> DMatrix<f64> {
    of_links(problem, best, points) + of_foot(problem, &best.hypothesis)
}

/// Joints are no better known than to the farthest of other postures that explain the points nearly
/// as well.
pub(crate) fn reach_of_others<'a>(
    h: &Hypothesis,
    others: impl Iterator<Item = &'a Hypothesis>,
    spread: &mut [f64],
) {
    for other in others {
        let apart = |j: usize| h.turn(other, j);
        spread.iter_mut().enumerate().for_each(|(j, spread)| *spread = spread.max(apart(j)));
    }
}

/// What the links' own errors add to the covariance of base twist (base axes) and joints.
fn of_links(problem: &Problem<'_>, best: &Adjusted, points: &AdjustPoints) -> DMatrix<f64> {
    let state = best.state();
    let pairing = Pairing::new(problem, &state, points.gate);
    let pairs: Vec<SurfacePair> =
        points.points().iter().filter_map(|&i| pairing.pair(i, &mut None)).collect();
    let h = &best.hypothesis;
    let n = 6 + h.posture.len();
    let places = LinkImages::of(&pairs, problem.prepared.links.len());
    let kinematics = problem.prepared.model.kinematics(&h.posture);
    let base_from_local = h.local_from_base.inverse();
    let (mut hessian, mut gradient) = (DMatrix::zeros(n, n), DVector::zeros(n));
    add_priors(problem, h, &mut hessian, &mut gradient);
    let mut pulls = vec![DMatrix::<f64>::zeros(n, N_WAYS); places.0.len()];
    let mut row = vec![0.0; n];
    for pair in &pairs {
        let scale = kernel_scale(pair.variance, points.gate);
        let weight = robust::tukey(pair.r, scale) / (problem.scene.n_alike * pair.variance);
        let q = base_from_local * Point::from(pair.p);
        let normal = base_from_local.rotation * pair.n;
        residual_row(&q.coords, &normal, &kinematics.twists[pair.link], &mut row);
        let own = DVector::from_column_slice(&row);
        hessian.ger(weight, &own, &own, 1.0);
        let along = pair.n.dot(&pair.ray);
        for (way, size) in places.ways(pair).into_iter().enumerate() {
            pulls[pair.link].column_mut(way).axpy(weight * along * size, &own, 1.0);
        }
    }
    let mut out = DMatrix::zeros(n, n);
    let Some(cholesky) = hessian.cholesky() else { return out };
    let sigma = problem.scene.noise;
    for pull in &pulls {
        let answer = cholesky.solve(pull);
        for (way, answer) in answer.column_iter().enumerate() {
            let off =
                sigma * if way == 0 { LIMITS.link_off_sigmas } else { LIMITS.link_bent_sigmas };
            out.ger(off * off, &answer, &answer, 1.0);
        }
    }
    out
}

/// Where the points of one link lie in the image.
struct LinkImage {
    /// The mean of the points, metres.
    middle: Vector,
    /// Two unit vectors across the beam, each with the standard deviation of the points along it,
    /// metres.
    axes: [(Vector, f64); 2],
}

/// Where the points of each link lie in the image; `None` for a link without points.
struct LinkImages(Vec<Option<LinkImage>>);

impl LinkImages {
    fn of(pairs: &[SurfacePair], n_links: usize) -> Self {
        let of = |link: usize| {
            let own: Vec<&SurfacePair> = pairs.iter().filter(|pair| pair.link == link).collect();
            let n = own.len() as f64;
            let middle = own.iter().map(|pair| pair.p).sum::<Vector>() / n;
            let beam = own.iter().map(|pair| pair.ray).sum::<Vector>().try_normalize(1e-9)?;
            let first = beam.cross(&Vector::ith(beam.iamin(), 1.0)).normalize();
            let spread = |axis: Vector| {
                let square = |pair: &&SurfacePair| axis.dot(&(pair.p - middle)).powi(2);
                (axis, (own.iter().map(square).sum::<f64>() / n).sqrt().max(1e-3))
            };
            Some(LinkImage { middle, axes: [spread(first), spread(beam.cross(&first))] })
        };
        Self((0..n_links).map(of).collect())
    }

    /// How much a point is off with each way in which its link may be.
    fn ways(&self, pair: &SurfacePair) -> [f64; N_WAYS] {
        let Some(LinkImage { middle, axes }) = &self.0[pair.link] else { return [0.0; N_WAYS] };
        let [first, second] = axes.map(|(axis, spread)| axis.dot(&(pair.p - middle)) / spread);
        [1.0, first, second]
    }
}

/// What turns of the base add, the first joint turned back, where the points of the foot leave them
/// open all around: no more than a quarter turn is looked at where a scanner shows the foot (see
/// `foot.rs`), and a camera bends it besides.
fn of_foot(problem: &Problem<'_>, h: &Hypothesis) -> DMatrix<f64> {
    let n = 6 + h.posture.len();
    let mut out = DMatrix::zeros(n, n);
    let Some(foot) = Foot::new(problem, h) else { return out };
    let turns = (PI / LIMITS.foot_step) as i32;
    let angles = (-turns..=turns).map(|k| f64::from(k) * LIMITS.foot_step).collect();
    if foot.reach(angles, problem.scene.n_alike) > LIMITS.open_foot {
        let way = foot.way(n);
        out.ger(MODES.any_angle * MODES.any_angle, &way, &way, 1.0);
    }
    out
}
