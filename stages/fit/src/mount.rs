//! An arm with a tool that stands as the points have it, and the holes that it may be bolted to; which of them explain the
//! flange under it, out: the turn of the tool is the sum of the last joint's and the hole's, only the flange tells them apart.

use robot::{JointKind, Role};
use std::f64::consts::TAU;

use crate::beam::Hypothesis;
use crate::refine::Refine;
use crate::spin::{AS_GOOD, MAX_STEP, MIN_POINTS, STEP};

/// Turns of the tool that are tried with every hole: the best of those at which the tool alone fits best.
const N_TURNS: usize = 6;

/// A turn of the last joint and a hole that go together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bolted {
    /// Value of the arm's last joint, radians.
    pub(crate) value: f64,
    /// Index among the holes.
    pub(crate) hole: usize,
}

impl Refine<'_> {
    /// All pairs of the joint `flange` and a hole that explain the points as well as the best one, best first; the holes
    /// are turns of the tool about that joint, the posture is that of the hole at 0. Empty where the points are too few.
    pub(crate) fn bolted(
        &self,
        h: &Hypothesis,
        near: &[u32],
        flange: usize,
        holes: &[f64],
    ) -> Vec<Bolted> {
        let model = self.prepared.model;
        let carried = self.prepared.carried(flange);
        let is_tool = |l: usize| model.links[l].role == Role::Effector;
        let (tool, own): (Vec<usize>, Vec<usize>) = carried.iter().partition(|l| is_tool(**l));
        let points = self.swept(h, near, &carried);
        let slides = model.joints[model.free[flange]].kind == JointKind::Prismatic;
        if points.len() < MIN_POINTS || slides || tool.is_empty() {
            return Vec::new();
        }
        let at = |value: f64, links: &[usize]| {
            let mut trial = h.clone();
            trial.posture[flange] = value;
            self.distances(&trial, &points, |l| links.contains(&l))
        };
        let still = self.distances(h, &points, |l| !carried.contains(&l));
        let variance = self.scene.noise * self.scene.noise;
        let cost = |all: [&[f32]; 3]| -> f64 {
            let least =
                |i: usize| f64::from(all.iter().map(|d| d[i]).fold(f32::INFINITY, f32::min));
            (0..points.len()).map(|i| least(i).powi(2)).sum::<f64>() / variance
        };
        let step = (STEP / self.prepared.lever[flange]).min(MAX_STEP);
        let n = (TAU / step).ceil() as usize;
        // The turn found is one of those tried.
        let turns: Vec<f64> =
            (0..n).map(|k| h.posture[flange] + TAU * k as f64 / n as f64).collect();
        let costs: Vec<f64> =
            turns.iter().map(|t| cost([&still, &at(*t, &tool), &still])).collect();
        let is_least =
            |k: &usize| costs[*k] <= costs[(k + 1) % n] && costs[*k] <= costs[(k + n - 1) % n];
        let mut best: Vec<usize> = (0..n).filter(is_least).collect();
        best.sort_by(|a, b| costs[*a].total_cmp(&costs[*b]));
        best.truncate(N_TURNS);
        let [low, high] = model.limits(flange);
        let mut all: Vec<(f64, Bolted)> = Vec::new();
        for turn in best.into_iter().map(|k| turns[k]) {
            let of_tool = at(turn, &tool);
            for (hole, by) in holes.iter().enumerate() {
                let value = low + (turn - by - low).rem_euclid(TAU);
                if value <= high {
                    let cost = cost([&still, &of_tool, &at(value, &own)]);
                    all.push((cost, Bolted { value, hole }));
                }
            }
        }
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let Some(least) = all.first().map(|a| a.0) else { return Vec::new() };
        let limit = least + (AS_GOOD.0 * least).max(AS_GOOD.1);
        all.into_iter().filter(|a| a.0 <= limit).map(|a| a.1).collect()
    }
}
