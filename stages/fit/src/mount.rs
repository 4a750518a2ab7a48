//! An arm with a tool that stands as the points have it, and the holes that it may be bolted to; which of them explain the
//! flange under it, out: the turn of the tool is the sum of the last joint's and the hole's, only the flange tells them apart.

use robot::{JointKind, Role};
use std::f64::consts::TAU;

use crate::beam::Hypothesis;
use crate::refine::Refine;
use crate::spin::{AS_GOOD, MAX_STEP, MIN_POINTS, STEP};

/// Turns of the tool that are tried with every hole: the best of those at which the tool alone fits best.
const N_TURNS: usize = 6;

/// A hole that a tool may be bolted to, and the value of the arm's last joint that goes with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bolt {
    /// Index among the holes.
    pub hole: usize,
    /// Value of the arm's last joint, radians.
    pub value: f64,
}

/// The links behind one joint, which turn apart from the rest of a posture.
struct Turning<'a> {
    refine: &'a Refine<'a>,
    h: &'a Hypothesis,
    flange: usize,
    /// Points that any turn of those links may explain.
    points: Vec<u32>,
    /// Distances of the points to all other links, metres.
    still: Vec<f32>,
    /// Links of the arm, and of the tool, that turn.
    own: Vec<usize>,
    tool: Vec<usize>,
}

impl<'a> Turning<'a> {
    /// `None` where the points are too few, or nothing turns that is a tool.
    fn new(refine: &'a Refine<'a>, h: &'a Hypothesis, near: &[u32], flange: usize) -> Option<Self> {
        let model = refine.prepared.model;
        let carried = refine.prepared.carried(flange);
        let is_tool = |l: &usize| model.links[*l].role == Role::Effector;
        let (tool, own): (Vec<usize>, Vec<usize>) = carried.iter().copied().partition(is_tool);
        let points = refine.swept(h, near, &carried);
        let slides = model.joints[model.free[flange]].kind == JointKind::Prismatic;
        if points.len() < MIN_POINTS || slides || tool.is_empty() {
            return None;
        }
        let still = refine.distances(h, &points, |l| !carried.contains(&l));
        Some(Self { refine, h, flange, points, still, own, tool })
    }

    /// Distances of the points to some of the links where the joint has a value, metres.
    fn at(&self, value: f64, links: &[usize]) -> Vec<f32> {
        let mut trial = self.h.clone();
        trial.posture[self.flange] = value;
        self.refine.distances(&trial, &self.points, |l| links.contains(&l))
    }

    /// Squared distances to the nearest of what stands still and what is turned, in units of the noise.
    fn cost(&self, turned: &[&[f32]]) -> f64 {
        let least = |i: usize| turned.iter().map(|d| d[i]).fold(self.still[i], f32::min);
        let sum: f64 = (0..self.points.len()).map(|i| f64::from(least(i)).powi(2)).sum();
        sum / (self.refine.scene.noise * self.refine.scene.noise)
    }

    /// Turns of the tool alone at which it fits better than beside them, best first; the one that it was found at is among
    /// those that are tried.
    fn turns(&self) -> Vec<f64> {
        let step = (STEP / self.refine.prepared.lever[self.flange]).min(MAX_STEP);
        let n = (TAU / step).ceil() as usize;
        let turn = |k: usize| self.h.posture[self.flange] + TAU * k as f64 / n as f64;
        let costs: Vec<f64> = (0..n).map(|k| self.cost(&[&self.at(turn(k), &self.tool)])).collect();
        let is_least =
            |k: &usize| costs[*k] <= costs[(k + 1) % n] && costs[*k] <= costs[(k + n - 1) % n];
        let mut best: Vec<usize> = (0..n).filter(is_least).collect();
        best.sort_by(|a, b| costs[*a].total_cmp(&costs[*b]));
        best.truncate(N_TURNS);
        best.into_iter().map(turn).collect()
    }
}

impl Refine<'_> {
    /// All pairs of the joint `flange` and a hole that explain the points as well as the best one, best first; the holes
    /// are turns of the tool about that joint, the posture is that of the hole at 0. Empty where the points are too few.
    pub(crate) fn bolts(
        &self,
        h: &Hypothesis,
        near: &[u32],
        flange: usize,
        holes: &[f64],
    ) -> Vec<Bolt> {
        let Some(turning) = Turning::new(self, h, near, flange) else { return Vec::new() };
        let [low, high] = self.prepared.model.limits(flange);
        let mut all: Vec<(f64, Bolt)> = Vec::new();
        for turn in turning.turns() {
            let of_tool = turning.at(turn, &turning.tool);
            for (hole, by) in holes.iter().enumerate() {
                let value = low + (turn - by - low).rem_euclid(TAU);
                if value <= high {
                    let cost = turning.cost(&[&of_tool, &turning.at(value, &turning.own)]);
                    all.push((cost, Bolt { hole, value }));
                }
            }
        }
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let Some(least) = all.first().map(|a| a.0) else { return Vec::new() };
        let limit = least + (AS_GOOD.0 * least).max(AS_GOOD.1);
        all.into_iter().filter(|a| a.0 <= limit).map(|a| a.1).collect()
    }
}
