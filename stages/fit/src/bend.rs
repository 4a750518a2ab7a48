//! An adjusted posture in; out come other values of the joint before its last at which the points fit about as well: a
//! wrist of which little is seen has many, and what hangs on its flange draws it to some of them (fit.md §4e).

use std::f64::consts::TAU;

use crate::beam::Hypothesis;
use crate::refine::Refine;
use crate::spin::{MAX_STEP, MIN_POINTS, STEP};

/// Values nearer than this to one another, or to the posture's own, are one, radians: 2°.
const APART: f64 = 0.035;
/// Share of the squares that a value may lack.
const SHORT: f64 = 0.3;
/// Most values.
const N_VALUES: usize = 4;

impl Refine<'_> {
    /// Postures with other values of the joint before the last, best first.
    pub(crate) fn bends(&self, h: &Hypothesis, near: &[u32]) -> Vec<Hypothesis> {
        let Some(joint) = h.posture.len().checked_sub(2) else { return Vec::new() };
        let with = |value: f64| {
            let mut other = h.clone();
            other.posture[joint] = value;
            other
        };
        let costs = self.bend_costs(h, near, joint);
        let least = costs.iter().map(|c| c.1).fold(f64::INFINITY, f64::min);
        let cost = |k: usize| costs.get(k).map_or(f64::INFINITY, |c| c.1);
        let is_least = |k: &usize| {
            cost(*k) <= cost(k + 1)
                && cost(*k) <= cost(k.wrapping_sub(1))
                && cost(*k) <= (1.0 + SHORT) * least
        };
        let mut found: Vec<(f64, f64)> =
            (0..costs.len()).filter(is_least).map(|k| costs[k]).collect();
        found.sort_by(|a, b| a.1.total_cmp(&b.1));
        let mut values = vec![h.posture[joint]];
        for (value, _) in found {
            if values.len() <= N_VALUES && values.iter().all(|v| (v - value).abs() > APART) {
                values.push(value);
            }
        }
        values[1..].iter().map(|value| with(*value)).collect()
    }

    /// Values of a joint over its whole way and what the points near the links that it moves say of each: sums of squares.
    fn bend_costs(&self, h: &Hypothesis, near: &[u32], joint: usize) -> Vec<(f64, f64)> {
        let moved = self.prepared.carried(joint);
        let points = self.swept(h, near, &moved);
        if self.is_prismatic(joint) || moved.is_empty() || points.len() < MIN_POINTS {
            return Vec::new();
        }
        let still = self.distances(h, &points, |l| !moved.contains(&l));
        let [low, high] = self.prepared.model.limits(joint);
        let step = (STEP / self.prepared.lever[joint]).min(MAX_STEP);
        let n = ((high - low).min(TAU) / step).ceil() as usize;
        let mut trial = h.clone();
        let cost = |value: f64| {
            trial.posture[joint] = value;
            let own = self.distances(&trial, &points, |l| moved.contains(&l));
            (value, self.squares(&trial, &points, &[&own, &still]))
        };
        (0..=n).map(|k| low + (high - low).min(TAU) * k as f64 / n as f64).map(cost).collect()
    }
}
