//! A posture adjusted to points of a depth camera in; out comes how far base and joints may be off
//! beyond what the scatter of the points says (METHOD.md §14.6).
//!
//! A camera has whole links off, each by an amount of its own: up to 15 mm where its neighbour is
//! not, with hundreds of points and more on each (`scripts/camera_residuals.py`). Such errors leave
//! no residuals, since the joints between the links follow them: they are laid on the links here,
//! and the adjustment is asked how it would answer.

use contract::Fan;
use geometry::{Point, Vector, robust};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::PI;

use crate::adjust::{Adjusted, kernel_scale};
use crate::beam::Hypothesis;
use crate::foot::Foot;
use crate::pairs::{Pair, Pairing};
use crate::refine::Refine;
use crate::report::turn;
use crate::sampled::Sampled;

/// How far a link is off as a whole, one sigma, in deviations of the points as flat things show it.
const LINK_OFF: f64 = 0.9;
/// How far its ends are off by more than its middle, the same.
const LINK_BENT: f64 = 0.6;
/// Ways in which a link may be off: along the beams as a whole, and growing to either side of the
/// image.
const N_WAYS: usize = 3;
/// Turns of the base that are tried, radians: 3°.
const STEP: f64 = 0.052;
/// Standard deviation of an angle of which nothing is known, radians.
const ANY_ANGLE: f64 = PI / 1.732_050_807_568_877_2;

/// What is added to the covariance of base twist (base axes) and joints.
pub(crate) fn beyond(
    refine: &Refine<'_>,
    best: &Adjusted,
    (near, points): (&[u32], &Sampled),
    fan: &dyn Fan,
) -> DMatrix<f64> {
    of_links(refine, best, points) + of_foot(refine, &best.hypothesis, near, fan)
}

/// Joints are no better known than to the farthest of other postures that explain the points nearly
/// as well.
pub(crate) fn spread<'a>(
    h: &Hypothesis,
    others: impl Iterator<Item = &'a Hypothesis>,
    spread: &mut [f64],
) {
    for other in others {
        let apart = |j: usize| turn(h, other, j);
        spread.iter_mut().enumerate().for_each(|(j, spread)| *spread = spread.max(apart(j)));
    }
}

/// What the links' own errors add to the covariance of base twist (base axes) and joints.
fn of_links(refine: &Refine<'_>, best: &Adjusted, points: &Sampled) -> DMatrix<f64> {
    let state = best.state();
    let pairing = Pairing::new(refine, &state, points.gate);
    let pairs: Vec<Pair> =
        points.points().iter().filter_map(|&i| pairing.pair(i, &mut None)).collect();
    let h = &best.hypothesis;
    let n = 6 + h.posture.len();
    let places = Places::of(&pairs, refine.prepared.links.len());
    let kinematics = refine.prepared.model.kinematics(&h.posture);
    let base_from_local = h.local_from_base.inverse();
    let (mut hessian, mut gradient) = (DMatrix::zeros(n, n), DVector::zeros(n));
    refine.add_priors(h, &mut hessian, &mut gradient);
    let mut pulls = vec![DMatrix::<f64>::zeros(n, N_WAYS); places.0.len()];
    let mut row = vec![0.0; n];
    for pair in &pairs {
        let scale = kernel_scale(pair.variance, points.gate);
        let weight = robust::tukey(pair.r, scale) / (refine.scene.n_alike * pair.variance);
        let q = base_from_local * Point::from(pair.p);
        let normal = base_from_local.rotation * pair.n;
        refine.row(&q.coords, &normal, &kinematics.twists[pair.link], &mut row);
        let own = DVector::from_column_slice(&row);
        hessian.ger(weight, &own, &own, 1.0);
        let along = pair.n.dot(&pair.ray);
        for (way, size) in places.ways(pair).into_iter().enumerate() {
            pulls[pair.link].column_mut(way).axpy(weight * along * size, &own, 1.0);
        }
    }
    let mut out = DMatrix::zeros(n, n);
    let Some(cholesky) = hessian.cholesky() else { return out };
    let sigma = refine.scene.noise;
    for pull in &pulls {
        let answer = cholesky.solve(pull);
        for (way, answer) in answer.column_iter().enumerate() {
            let off = sigma * if way == 0 { LINK_OFF } else { LINK_BENT };
            out.ger(off * off, &answer, &answer, 1.0);
        }
    }
    out
}

/// Where the points of one link lie in the image.
struct Seen {
    /// The mean of the points, metres.
    middle: Vector,
    /// Two unit vectors across the beam, each with the standard deviation of the points along it,
    /// metres.
    axes: [(Vector, f64); 2],
}

/// Where the points of each link lie in the image; `None` for a link without points.
struct Places(Vec<Option<Seen>>);

impl Places {
    fn of(pairs: &[Pair], n_links: usize) -> Self {
        let of = |link: usize| {
            let own: Vec<&Pair> = pairs.iter().filter(|pair| pair.link == link).collect();
            let n = own.len() as f64;
            let middle = own.iter().map(|pair| pair.p).sum::<Vector>() / n;
            let beam = own.iter().map(|pair| pair.ray).sum::<Vector>().try_normalize(1e-9)?;
            let first = beam.cross(&Vector::ith(beam.iamin(), 1.0)).normalize();
            let spread = |axis: Vector| {
                let square = |pair: &&Pair| axis.dot(&(pair.p - middle)).powi(2);
                (axis, (own.iter().map(square).sum::<f64>() / n).sqrt().max(1e-3))
            };
            Some(Seen { middle, axes: [spread(first), spread(beam.cross(&first))] })
        };
        Self((0..n_links).map(of).collect())
    }

    /// How much a point is off with each way in which its link may be.
    fn ways(&self, pair: &Pair) -> [f64; N_WAYS] {
        let Some(Seen { middle, axes }) = &self.0[pair.link] else { return [0.0; N_WAYS] };
        let [first, second] = axes.map(|(axis, spread)| axis.dot(&(pair.p - middle)) / spread);
        [1.0, first, second]
    }
}

/// What turns of the base add, the first joint turned back, where the points of the foot leave them
/// open all around: no more than a quarter turn is looked at where a scanner shows the foot (see
/// `foot.rs`), and a camera bends it besides.
fn of_foot(refine: &Refine<'_>, h: &Hypothesis, near: &[u32], fan: &dyn Fan) -> DMatrix<f64> {
    let n = 6 + h.posture.len();
    let mut out = DMatrix::zeros(n, n);
    let Some(foot) = Foot::new(refine, h, near) else { return out };
    let turns = (PI / STEP) as i32;
    let angles = (-turns..=turns).map(|k| f64::from(k) * STEP).collect();
    if foot.reach(angles, refine.scene.n_alike, fan) > PI / 9.0 {
        let way = foot.way(n);
        out.ger(ANY_ANGLE * ANY_ANGLE, &way, &way, 1.0);
    }
    out
}
