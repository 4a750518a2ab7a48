//! An adjusted posture in; out come other values of the joint before its last at which the points fit about as well: a
//! wrist of which little is seen has many, and what hangs on its flange draws it to some of them (METHOD.md §9).

use contract::Fan;
use std::f64::consts::TAU;

use crate::beam::Hypothesis;
use crate::refine::Refine;
use crate::sweep::Sweep;

/// Values nearer than this to one another, or to the posture's own, are one, radians: 2°.
const APART: f64 = 0.035;
/// Share of the squares that a value may lack.
const SHORT: f64 = 0.3;
/// Most values.
const N_VALUES: usize = 4;

impl Refine<'_> {
    /// Postures with other values of the joint before the last, best first.
    pub(crate) fn bends(&self, h: &Hypothesis, near: &[u32], fan: &impl Fan) -> Vec<Hypothesis> {
        let joint = h.posture.len().checked_sub(2);
        let sweep = joint.and_then(|joint| Some((joint, Sweep::new(self, h, near, joint)?)));
        let Some((joint, sweep)) = sweep else { return Vec::new() };
        let [low, high] = self.prepared.model.limits(joint);
        let span = (high - low).min(TAU);
        let n = sweep.n_values(span);
        let value = |k: usize| low + span * k as f64 / n as f64;
        let costs: Vec<f64> = fan.fan((0..=n).collect(), |k| sweep.cost_held(value(k)));
        let least = costs.iter().copied().fold(f64::INFINITY, f64::min);
        let cost = |k: usize| costs.get(k).copied().unwrap_or(f64::INFINITY);
        let is_least = |k: &usize| {
            cost(*k) <= cost(k + 1)
                && cost(*k) <= cost(k.wrapping_sub(1))
                && cost(*k) <= (1.0 + SHORT) * least
        };
        let mut found: Vec<usize> = (0..=n).filter(is_least).collect();
        found.sort_by(|a, b| costs[*a].total_cmp(&costs[*b]));
        let mut values = vec![h.posture[joint]];
        for value in found.into_iter().map(value) {
            if values.len() <= N_VALUES && values.iter().all(|v| (v - value).abs() > APART) {
                values.push(value);
            }
        }
        values[1..].iter().map(|value| sweep.at(*value)).collect()
    }
}
