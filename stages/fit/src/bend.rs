//! An adjusted posture in; out come other values of joints about its end that are worth a look
//! (METHOD.md §9): of the one before its last, a wrist of which little is seen has many, and what
//! hangs on its flange draws it to some of them; and of a tool's slides, which stand as well in a
//! part that the tool holds.

use contract::Fan;
use std::f64::consts::TAU;

use crate::beam::Hypothesis;
use crate::judge::judged;
use crate::refine::Refine;
use crate::solve::Polished;
use crate::sweep::Sweep;

/// Values nearer than this to one another, or to the posture's own, are one, radians: 2°.
const APART: f64 = 0.035;
/// Share of the squares that a value may lack.
const SHORT: f64 = 0.3;
/// Most values.
const N_VALUES: usize = 4;
/// Steps of a slide, metres, and most of them. They are compared as they are: a refinement would be
/// drawn to what the tool holds.
const SLIDE_STEP: f64 = 0.005;
const MAX_SLIDES: f64 = 100.0;

impl Refine<'_> {
    /// Postures with other values of the joint before the last, best first.
    pub(crate) fn bends(&self, h: &Hypothesis, near: &[u32], fan: &dyn Fan) -> Vec<Hypothesis> {
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

    /// Postures with other values of each slide that moves nothing but a tool's part.
    pub(crate) fn slides(&self, h: &Hypothesis, fan: &dyn Fan) -> Vec<Polished> {
        let slides =
            (0..h.posture.len()).filter(|&j| self.prepared.leaf[j] && self.is_prismatic(j));
        let others = slides.flat_map(|joint| {
            let [low, high] = self.prepared.model.limits(joint);
            let n = ((high - low) / SLIDE_STEP).ceil().clamp(1.0, MAX_SLIDES);
            let values = (0..=n as usize).map(move |k| low + (high - low) * k as f64 / n);
            let is_other = move |value: &f64| (value - h.posture[joint]).abs() > SLIDE_STEP;
            values.filter(is_other).map(move |value| {
                let mut other = h.clone();
                other.posture[joint] = value;
                other
            })
        });
        let judge = |other: Hypothesis| {
            let judgement = judged(self, &other);
            (other, judgement)
        };
        fan.fan(others.collect(), judge)
    }
}
