//! The marginal spread of joints that few points hold: how far they may stand from where they were
//! adjusted to (METHOD.md §14.2, *profile*).
//!
//! The covariance takes the sum of squares for a parabola. Where a wrist shows two hundred points,
//! most of them beside edges, the sum is no parabola: which points lie on the model changes as the
//! wrist bends, and another value may fit as well or better.

use super::settings::{MODES, MarginalLimits};
use crate::adjust::{Adjust, Adjusted};
use crate::correspond::AdjustPoints;
use crate::problem::Problem;

const LIMITS: MarginalLimits = MODES.marginal;

/// Variance of each joint beyond what is stated, radians² or metres²: mean square of its values
/// from its own, each as likely as the points about what the joint moves make it, where all else
/// stays.
pub(crate) fn marginal_spread(
    problem: &Problem<'_>,
    best: &Adjusted,
    points: &AdjustPoints,
) -> Vec<f64> {
    let n = best.hypothesis.posture.len();
    let sigma = |j: usize| best.covariance[(6 + j, 6 + j)].max(0.0).sqrt();
    let is_asked = |j: usize| !problem.prepared.leaf[j] && LIMITS.sigma.contains(sigma(j));
    let of = |j: usize| match is_asked(j)
        .then(|| costs(problem, best, points, &JointSigma { joint: j, sigma: sigma(j) }))
    {
        Some(Some(costs)) => (mean_square(&costs) - 1.0).max(0.0) * sigma(j).powi(2),
        _ => 0.0,
    };
    (0..n).map(of).collect()
}

/// A joint and its standard deviation as the covariance states it.
struct JointSigma {
    joint: usize,
    /// Radians or metres.
    sigma: f64,
}

/// Costs of values of a joint, from the lowest to the highest; `None` where many points hold it.
fn costs(
    problem: &Problem<'_>,
    best: &Adjusted,
    points: &AdjustPoints,
    &JointSigma { joint, sigma }: &JointSigma,
) -> Option<Vec<f64>> {
    let [_, turning] = points.parted(&problem.prepared.carried(joint));
    if turning.points().len() > LIMITS.max_points {
        return None;
    }
    let adjust = Adjust::new(problem);
    let cost = |k: i32| {
        let mut state = best.state();
        state.hypothesis.posture[joint] += sigma * f64::from(k);
        adjust.cost(&state, &turning)
    };
    Some(problem.fan.fan((-LIMITS.n_beside..=LIMITS.n_beside).collect(), cost))
}

/// Mean square of values that cost so much, in standard deviations: likelihoods are as wide as is
/// stated on the whole, the parabola through both ends and the least cost has that width.
fn mean_square(costs: &[f64]) -> f64 {
    let n = costs.len() / 2;
    let least = costs.iter().copied().fold(f64::INFINITY, f64::min);
    let ends = (costs[0] + costs[2 * n] - 2.0 * least) / (n * n) as f64;
    let wide = ends.max(1.0);
    let [sum, total] = costs.iter().enumerate().fold([0.0; 2], |[sum, total], (k, cost)| {
        let weight = ((least - cost) / wide).exp();
        [sum + weight * (k as f64 - n as f64).powi(2), total + weight]
    });
    sum / total
}

#[cfg(test)]
mod tests {
    use super::*;

    fn costs(of: impl Fn(f64) -> f64) -> Vec<f64> {
        (-LIMITS.n_beside..=LIMITS.n_beside).map(|k| of(f64::from(k))).collect()
    }

    #[test]
    fn a_parabola_is_as_wide_as_stated_and_what_is_better_beside_it_counts() {
        // However much the points know, what is stated of them is the width.
        for sharp in [1.0, 13.0] {
            let square = mean_square(&costs(|k| sharp * 0.5 * k * k));
            assert!((square - 1.0).abs() < 0.05, "{square}");
        }
        // Nothing is known between the ends.
        assert!((mean_square(&costs(|_| 5.0)) - 14.0).abs() < 1e-9);
        // A second valley, three deviations on, a little better.
        let two = mean_square(&costs(|k| (0.5 * k * k).min(0.5 * (k - 3.0).powi(2) - 2.0)));
        assert!((7.0..12.0).contains(&two), "{two}");
    }
}
