//! Gauss–Newton over base and all joints on point-to-plane residuals (METHOD.md §11.1).
//!
//! Sums run in the order of the points, which gives the same bits on any machine with IEEE
//! arithmetic.

use geometry::robust;
use nalgebra::{DMatrix, DVector};

use super::rounds::Round;
use crate::correspond::{Matching, chunk, pierced};
use crate::problem::{Problem, add_priors, keep_slides, residual_row};
use crate::state::Hypothesis;

/// Square of a step's length, in standard deviations, below which the same round is not repeated:
/// steps shrink threefold a round and more.
const SMALL_STEP_SQUARED: f64 = 0.01;
/// Fewer matched points do not hold a robot.
const MIN_MATCHES: f64 = 30.0;
/// Longest step, radians and metres: a longer one has left the linear range and is shortened.
const MAX_STEP: f64 = 0.5;
/// A round's gate is so many standard deviations of the points that it is for.
const GATE_SIGMAS: f64 = 3.0;

/// Sums of one link's part of the normal equations.
struct LinkSums {
    /// Its lower triangle until all are joined.
    h: DMatrix<f64>,
    g: DVector<f64>,
    n: usize,
    /// Sums of the weights, and of the kernel's slopes.
    kernel: [f64; 2],
}

impl LinkSums {
    fn new(n: usize) -> Self {
        Self { h: DMatrix::zeros(n, n), g: DVector::zeros(n), n: 0, kernel: [0.0; 2] }
    }

    /// Adds a residual with its derivatives, by the kernel of a gate.
    fn add(&mut self, row: &[f64], r: f64, gate: f64) {
        let weight = robust::tukey(r, gate);
        self.n += 1;
        self.kernel[0] += weight;
        self.kernel[1] += robust::tukey_slope(r, gate);
        let n = row.len();
        for a in (0..n).filter(|a| row[*a] != 0.0) {
            let wa = weight * row[a];
            self.g[a] += wa * r;
            let column = &mut self.h.as_mut_slice()[a * n + a..(a + 1) * n];
            add_scaled(column, wa, &row[a..]);
        }
    }

    fn join(&mut self, other: &Self) {
        self.h += &other.h;
        self.g += &other.g;
        self.n += other.n;
        (0..2).for_each(|i| self.kernel[i] += other.kernel[i]);
    }
}

/// `sums += factor · row`.
#[inline]
pub(crate) fn add_scaled(sums: &mut [f64], factor: f64, row: &[f64]) {
    debug_assert_eq!(sums.len(), row.len());
    // Rows are short: four at a time, what is left one by one. A plain loop takes sixteen at a
    // time, and rows are shorter.
    let (sums, sums_left) = sums.as_chunks_mut::<4>();
    let (row, row_left) = row.as_chunks::<4>();
    for (sums, row) in sums.iter_mut().zip(row) {
        for i in 0..4 {
            sums[i] += factor * row[i];
        }
    }
    sums_left.iter_mut().zip(row_left).for_each(|(sum, v)| *sum += factor * v);
}

/// Runs the rounds on the points with these indices.
pub(super) fn run(
    problem: &Problem<'_>,
    start: &Hypothesis,
    points: &[u32],
    rounds: &[Round],
) -> Hypothesis {
    let mut h = start.clone();
    let mut rounds = rounds.iter().peekable();
    while let Some(round) = rounds.next() {
        let sums = sums(problem, &h, points, round.gate);
        let Some(step) = step(problem, &h, &sums, round) else { break };
        h.take(step.change.as_slice());
        keep_slides(problem.prepared, &mut h);
        // The same again would change nothing.
        while step.squared_sigmas < SMALL_STEP_SQUARED && rounds.next_if_eq(&round).is_some() {}
    }
    h
}

/// Robust standard deviation of the residuals of points within a gate, metres.
pub(super) fn noise(problem: &Problem<'_>, h: &Hypothesis, points: &[u32], gate: f64) -> f64 {
    let mut residuals = Vec::new();
    Matching::new(problem, h, gate).each(points, |m| residuals.push(m.r.abs()));
    robust::median(&mut residuals).map_or(gate, |m| 1.4826 * m)
}

/// Normal equations by link.
fn sums(problem: &Problem<'_>, h: &Hypothesis, points: &[u32], gate: f64) -> Vec<LinkSums> {
    let matching = Matching::new(problem, h, gate);
    let kinematics = problem.prepared.model.kinematics(&h.posture);
    let n = 6 + h.posture.len();
    let n_links = problem.prepared.links.len();
    let chunks = points.chunks(chunk(points.len())).collect();
    let found = problem.fan.fan(chunks, |chunk: &[u32]| {
        let mut sums: Vec<LinkSums> = (0..n_links).map(|_| LinkSums::new(n)).collect();
        let mut row = vec![0.0; n];
        matching.each(chunk, |m| {
            residual_row(&m.q, &m.n, &kinematics.twists[m.link], &mut row);
            sums[m.link].add(&row, m.r, gate);
        });
        sums
    });
    let mut sums: Vec<LinkSums> = (0..n_links).map(|_| LinkSums::new(n)).collect();
    let mut row = vec![0.0; n];
    for m in pierced(problem, h, gate) {
        residual_row(&m.q, &m.n, &kinematics.twists[m.link], &mut row);
        sums[m.link].add(&row, m.r, gate);
    }
    for own in &found {
        sums.iter_mut().zip(own).for_each(|(sum, own)| sum.join(own));
    }
    for s in &mut sums {
        s.h.fill_upper_triangle_with_lower_triangle();
    }
    sums
}

/// A step of base and joints.
struct Step {
    change: DVector<f64>,
    /// Square of its length in standard deviations.
    squared_sigmas: f64,
}

/// Solves for the next step; `None` where the points say nothing.
fn step(problem: &Problem<'_>, h: &Hypothesis, sums: &[LinkSums], round: &Round) -> Option<Step> {
    let n = 6 + h.posture.len();
    let (mut hessian, mut gradient) = (DMatrix::zeros(n, n), DVector::zeros(n));
    let total: f64 = sums.iter().map(|s| s.n as f64).sum();
    let mut kernel = [0.0; 2];
    let n_links = sums.iter().filter(|s| s.n > 0).count() as f64;
    if total < MIN_MATCHES {
        return None;
    }
    for s in sums.iter().filter(|s| s.n > 0) {
        // Balanced: as if each link had the same √count, the sum over links unchanged in size.
        let factor = if round.balanced { (total / n_links / s.n as f64).sqrt() } else { 1.0 };
        hessian += &s.h * factor;
        gradient += &s.g * factor;
        (0..2).for_each(|i| kernel[i] += s.kernel[i] * factor);
    }
    let sigma = (round.gate / GATE_SIGMAS).max(problem.settings.min_noise);
    let variance = problem.scene.n_alike * sigma * sigma;
    // Priors are squares: they ask for no longer step.
    hessian /= variance * robust::stretch(kernel[0], kernel[1]);
    gradient /= variance;
    add_priors(problem, h, &mut hessian, &mut gradient);
    let delta = hessian.cholesky()?.solve(&-&gradient);
    let squared_sigmas = -gradient.dot(&delta);
    let longest = delta.amax();
    let change = if longest > MAX_STEP { delta * (MAX_STEP / longest) } else { delta };
    Some(Step { change, squared_sigmas })
}
