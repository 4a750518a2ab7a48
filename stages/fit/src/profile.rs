//! An adjusted posture and its points in; how far joints that few points hold may stand from where
//! they were adjusted to, out.
//!
//! The covariance takes the sum of squares for a parabola. Where a wrist shows two hundred points,
//! most of them beside edges, it is none: which of them lie on the model at all changes as it
//! bends, and another value may be as good or better.

use contract::Fan;

use crate::adjust::{Adjust, Adjusted, State};
use crate::refine::Refine;
use crate::sampled::Sampled;

/// Joints with more points on what they move are held by so many that the parabola is right.
const MAX_POINTS: usize = 2000;
/// Values on either side of a joint's own at which the points are asked, one standard deviation
/// apart.
const N_BESIDE: i32 = 6;
/// Joints that are stated to be known so well are asked, radians: from 0.03° on it may be more than
/// it should, up to 0.4°; beyond that it is wide enough, and six of it are another posture.
const ASKED: [f64; 2] = [0.000_5, 0.007];

/// Variance of each joint beyond what is stated, radians² or metres²: mean square of its values
/// from its own, each as likely as the points about what the joint moves make it, where all else
/// stays.
pub(crate) fn beyond(
    refine: &Refine<'_>,
    best: &Adjusted,
    points: &Sampled,
    fan: &dyn Fan,
) -> Vec<f64> {
    let n = best.hypothesis.posture.len();
    let sigma = |j: usize| best.covariance[(6 + j, 6 + j)].max(0.0).sqrt();
    let is_asked = |j: usize| !refine.prepared.leaf[j] && (ASKED[0]..ASKED[1]).contains(&sigma(j));
    let of = |j: usize| match is_asked(j).then(|| costs(refine, best, points, (j, sigma(j)), fan)) {
        Some(Some(costs)) => (mean_square(&costs) - 1.0).max(0.0) * sigma(j).powi(2),
        _ => 0.0,
    };
    (0..n).map(of).collect()
}

/// Costs of values of a joint, from the lowest to the highest; `None` where many points hold it.
fn costs(
    refine: &Refine<'_>,
    best: &Adjusted,
    points: &Sampled,
    (joint, sigma): (usize, f64),
    fan: &dyn Fan,
) -> Option<Vec<f64>> {
    let [_, turning] = points.parted(&refine.prepared.carried(joint));
    if turning.points().len() > MAX_POINTS {
        return None;
    }
    let adjust = Adjust::new(refine);
    let cost = |k: i32| {
        let mut state: State = best.state();
        state.hypothesis.posture[joint] += sigma * f64::from(k);
        adjust.cost(&state, &turning)
    };
    Some(fan.fan((-N_BESIDE..=N_BESIDE).collect(), cost))
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
        (-N_BESIDE..=N_BESIDE).map(|k| of(f64::from(k))).collect()
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
