//! Modes of leaf joints, which move nothing but the links that they place and the tool: a flange
//! with six bolts looks the same every 60°, and only points on its small features tell (METHOD.md
//! §9).

use geometry::angle;
use std::f64::consts::TAU;

use super::profile::JointProfile;
use super::settings::MODES;
use super::settled::JointModes;
use crate::problem::Problem;
use crate::state::Hypothesis;

/// How far the run of values around `own` reaches, up or down, whose costs are within the limit; it
/// may begin a little beside `own`, to which all points drew it, not those of the profile alone.
pub(crate) fn extent(costs: &[(f64, f64)], own: f64, limit: f64) -> f64 {
    let mut offsets: Vec<(f64, f64)> = costs.iter().map(|c| (c.0 - own, c.1)).collect();
    offsets.sort_by(|a, b| a.0.total_cmp(&b.0));
    let is_beside = |c: &&(f64, f64)| c.1 > limit && c.0.abs() <= MODES.same_turn;
    let is_good = |c: &&(f64, f64)| c.1 <= limit;
    let up = offsets.iter().filter(|c| c.0 >= 0.0);
    let down = offsets.iter().rev().filter(|c| c.0 <= 0.0);
    let up = up.skip_while(is_beside).take_while(is_good).last();
    let down = down.skip_while(is_beside).take_while(is_good).last();
    up.map_or(0.0, |c| c.0).max(down.map_or(0.0, |c| -c.0))
}

/// The values of each leaf joint at which the points fit as well as at the best one, over its whole
/// range.
pub(crate) fn leaf_modes(problem: &Problem<'_>, h: &Hypothesis) -> Vec<JointModes> {
    let leaves = (0..h.posture.len()).filter(|&j| problem.prepared.leaf[j]);
    leaves.filter_map(|joint| modes_of(problem, h, joint)).collect()
}

fn modes_of(problem: &Problem<'_>, h: &Hypothesis, joint: usize) -> Option<JointModes> {
    let (prepared, fan) = (problem.prepared, problem.fan);
    let profile = JointProfile::new(problem, h, joint)?;
    let [low, high] = prepared.model.limits(joint);
    let span = (high - low).min(TAU);
    let n = profile.n_values(span);
    // Around the value found, so that it is one of those tried.
    let first = if high - low > TAU { h.posture[joint] - span / 2.0 } else { low };
    let variance = problem.scene.noise * problem.scene.noise;
    let cost = |value: f64| profile.cost(&[&profile.distances(value, &profile.moved)]) / variance;
    let values = (0..=n).map(|k| first + span * k as f64 / n as f64);
    let values: Vec<f64> = values.chain([h.posture[joint]]).collect();
    let costs: Vec<(f64, f64)> = fan.fan(values, |value| (value, cost(value)));
    let best = costs.iter().map(|c| c.1).fold(f64::INFINITY, f64::min);
    let limit = MODES.as_good.limit(best, 1.0);
    let extent = extent(&costs, h.posture[joint], limit);
    // A tool is held by more than its outline: within its own valley the covariance tells.
    let is_bare = profile.moved.len() == prepared.placed_by[joint].len();
    let extent = if is_bare || extent > MODES.same_turn { extent } else { 0.0 };
    let least = costs.iter().min_by(|a, b| a.1.total_cmp(&b.1))?.0;
    let least = profile.distances(least, &profile.moved);
    let is_twin = |k: usize| {
        let [own, up, down] = [k, (k + 1).min(n), k.saturating_sub(1)].map(|k| costs[k].1);
        own <= up
            && own <= down
            && profile.sigmas_worse(costs[k].0, &least) < MODES.leaf.clearly_worse_sigmas
    };
    let is_good = |k: usize| costs[k].1 <= limit || k <= n && is_twin(k);
    let good = fan.fan((0..costs.len()).collect(), |k| is_good(k).then_some(costs[k]));
    let mut good: Vec<(f64, f64)> = good.into_iter().flatten().collect();
    good.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut values: Vec<f64> = Vec::new();
    for (value, _) in good {
        if values.iter().all(|v| angle::apart(*v, value) > MODES.same_turn) {
            // A little beyond a stop that it cannot be turned back from it stays there.
            values.push(angle::within(value, [low, high]).unwrap_or(value));
        }
    }
    Some(JointModes { joint, values, extent })
}

#[cfg(test)]
mod tests {
    use super::extent;

    #[test]
    fn runs_reach_as_far_as_values_are_as_good() {
        let costs = |good: &[i32]| -> Vec<(f64, f64)> {
            let cost = |k: i32| if good.contains(&k) { 1.0 } else { 3.0 };
            (-9..=9).map(|k| (0.02 * f64::from(k), cost(k))).collect()
        };
        let of = |good: &[i32]| (extent(&costs(good), 0.0, 2.0) / 0.02).round() as i32;
        assert_eq!(of(&[-1, 0, 1, 2, 5]), 2);
        // The own value is none of the run, but near it.
        assert_eq!(of(&[-4, -3, -2, -1]), 4);
        // Another run altogether.
        assert_eq!(of(&[6, 7]), 0);
        assert_eq!(of(&[]), 0);
    }
}
