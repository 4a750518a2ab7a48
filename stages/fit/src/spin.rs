//! An adjusted posture in; out come the other values of its last joints at which the points fit as
//! well or better: a flange with six bolts looks the same every 60°, and only points on its small
//! features tell (METHOD.md §9).

use contract::Fan;
use std::f64::consts::TAU;

use crate::beam::Hypothesis;
use crate::refine::Refine;
use crate::sweep::Sweep;
use crate::turns;

/// Values nearer than this to one another are one, radians: 3°.
const APART: f64 = 0.052;
/// Extra sum of squares, relative to the best's and in units of the noise's variance, up to which a
/// value is as good: 3 % of the squares is less than what real castings differ by.
pub(crate) const AS_GOOD: (f64, f64) = (0.03, 30.0);

/// Another place where the points fit best is as good if it is no more clearly worse, see
/// [`Sweep::clearly_worse`]: of flanges that bolts make look alike the right one was worse by up to
/// 1.8; what is not alike by 3 and more.
const TWIN: f64 = 2.5;

/// Values of one joint.
#[derive(Debug, Clone)]
pub(crate) struct Spin {
    pub(crate) joint: usize,
    /// All values at which the points fit as well as at the best one, best first.
    pub(crate) values: Vec<f64>,
    /// How far around the posture's own value all values are as good, at most, radians: 0 where
    /// those beside it are worse.
    pub(crate) extent: f64,
}

/// How far the run of values around `own` reaches, up or down, whose costs are within the limit; it
/// may begin a little beside `own`, to which all points drew it, not those of the sweep alone.
pub(crate) fn extent(costs: &[(f64, f64)], own: f64, limit: f64) -> f64 {
    let mut offsets: Vec<(f64, f64)> = costs.iter().map(|c| (c.0 - own, c.1)).collect();
    offsets.sort_by(|a, b| a.0.total_cmp(&b.0));
    let is_beside = |c: &&(f64, f64)| c.1 > limit && c.0.abs() <= APART;
    let is_good = |c: &&(f64, f64)| c.1 <= limit;
    let up = offsets.iter().filter(|c| c.0 >= 0.0);
    let down = offsets.iter().rev().filter(|c| c.0 <= 0.0);
    let up = up.skip_while(is_beside).take_while(is_good).last();
    let down = down.skip_while(is_beside).take_while(is_good).last();
    up.map_or(0.0, |c| c.0).max(down.map_or(0.0, |c| -c.0))
}

impl Refine<'_> {
    /// Sweeps each joint that moves nothing but the links that it places and the tool.
    pub(crate) fn spins(&self, h: &Hypothesis, near: &[u32], fan: &dyn Fan) -> Vec<Spin> {
        let leaves = (0..h.posture.len()).filter(|&j| self.prepared.leaf[j]);
        leaves.filter_map(|joint| self.spin(h, near, joint, fan)).collect()
    }

    fn spin(&self, h: &Hypothesis, near: &[u32], joint: usize, fan: &dyn Fan) -> Option<Spin> {
        let sweep = Sweep::new(self, h, near, joint)?;
        let [low, high] = self.prepared.model.limits(joint);
        let span = (high - low).min(TAU);
        let n = sweep.n_values(span);
        // Around the value found, so that it is one of those tried.
        let first = if high - low > TAU { h.posture[joint] - span / 2.0 } else { low };
        let variance = self.scene.noise * self.scene.noise;
        let cost = |value: f64| sweep.cost(&[&sweep.distances(value, &sweep.moved)]) / variance;
        let values = (0..=n).map(|k| first + span * k as f64 / n as f64);
        let values: Vec<f64> = values.chain([h.posture[joint]]).collect();
        let costs: Vec<(f64, f64)> = fan.fan(values, |value| (value, cost(value)));
        let best = costs.iter().map(|c| c.1).fold(f64::INFINITY, f64::min);
        let limit = best + (AS_GOOD.0 * best).max(AS_GOOD.1);
        let extent = extent(&costs, h.posture[joint], limit);
        // A tool is held by more than its outline: within its own valley the covariance tells.
        let is_bare = sweep.moved.len() == self.prepared.placed_by[joint].len();
        let extent = if is_bare || extent > APART { extent } else { 0.0 };
        let least = costs.iter().min_by(|a, b| a.1.total_cmp(&b.1))?.0;
        let least = sweep.distances(least, &sweep.moved);
        let is_twin = |k: usize| {
            let [own, up, down] = [k, (k + 1).min(n), k.saturating_sub(1)].map(|k| costs[k].1);
            own <= up && own <= down && sweep.clearly_worse(costs[k].0, &least) < TWIN
        };
        let is_good = |k: usize| costs[k].1 <= limit || k <= n && is_twin(k);
        let good = fan.fan((0..costs.len()).collect(), |k| is_good(k).then_some(costs[k]));
        let mut good: Vec<(f64, f64)> = good.into_iter().flatten().collect();
        good.sort_by(|a, b| a.1.total_cmp(&b.1));
        let mut values: Vec<f64> = Vec::new();
        for (value, _) in good {
            if values.iter().all(|v| turns::apart(*v, value) > APART) {
                // A little beyond a stop that it cannot be turned back from it stays there.
                values.push(turns::within(value, [low, high]).unwrap_or(value));
            }
        }
        Some(Spin { joint, values, extent })
    }
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
