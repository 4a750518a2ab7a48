//! An arm with a tool that stands as the points have it, and the holes that it may be bolted to;
//! which of them explain the flange under it, out: the turn of the tool is the sum of the last
//! joint's and the hole's, only the flange tells them apart.

use contract::Fan;
use robot::Role;
use std::f64::consts::TAU;

use crate::beam::Hypothesis;
use crate::refine::Refine;
use crate::spin::AS_GOOD;
use crate::sweep::Sweep;
use crate::turns;

/// Turns of tool and flange that are tried are so many, or twice, and so on: every turn between
/// holes, 15°, is one of them.
const N_HOLES: usize = 24;

/// Share of the squares by which a side may be worse and still be as good: fingers and last joint
/// stand as the first side has them. The wrong side of a two-finger gripper was the better one by
/// 4.5 %; what is no side of it is worse by 36 %.
const UNPOLISHED: f64 = 0.10;

/// A hole that a tool may be bolted to, and the value of the arm's last joint that goes with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bolt {
    /// Index among the holes.
    pub hole: usize,
    /// Value of the arm's last joint, radians.
    pub value: f64,
}

/// The tool, and the links of the arm that turn with it about one joint.
struct Turning<'a> {
    sweep: Sweep<'a>,
    own: Vec<usize>,
    tool: Vec<usize>,
    /// Value of the joint in the posture as it stands, radians.
    value: f64,
}

impl<'a> Turning<'a> {
    /// `None` where the points are too few, or nothing turns that is a tool.
    fn new(refine: &'a Refine<'a>, h: &'a Hypothesis, near: &[u32], flange: usize) -> Option<Self> {
        let sweep = Sweep::new(refine, h, near, flange)?;
        let is_tool = |l: &usize| refine.prepared.model.links[*l].role == Role::Effector;
        let (tool, own): (Vec<usize>, Vec<usize>) = sweep.moved.iter().copied().partition(is_tool);
        let value = h.posture[flange];
        (!tool.is_empty()).then_some(Self { sweep, own, tool, value })
    }

    /// Distances of the points to some of the links at equal steps of a whole turn from where the
    /// joint stands, metres.
    fn around(&self, n: usize, links: &[usize], fan: &dyn Fan) -> Vec<Vec<f32>> {
        fan.fan((0..n).collect(), |k| self.sweep.distances(self.at(k, n), links))
    }

    /// The joint's value after so many of `n` steps, radians.
    fn at(&self, k: usize, n: usize) -> f64 {
        self.value + TAU * k as f64 / n as f64
    }
}

impl Refine<'_> {
    /// All pairs of the joint `flange` and a hole that explain the points as well as the best one,
    /// best first; the holes are turns of the tool about that joint, the posture is that of the
    /// hole at 0. Empty where the points are too few.
    pub(crate) fn bolts(
        &self,
        h: &Hypothesis,
        near: &[u32],
        flange: usize,
        holes: &[f64],
        fan: &dyn Fan,
    ) -> Vec<Bolt> {
        let Some(turning) = Turning::new(self, h, near, flange) else { return Vec::new() };
        let limits = self.prepared.model.limits(flange);
        let (sweep, variance) = (&turning.sweep, self.scene.noise * self.scene.noise);
        let n = sweep.n_values(TAU).next_multiple_of(N_HOLES);
        let [tool, arm] = [&turning.tool, &turning.own].map(|links| turning.around(n, links, fan));
        let mut all: Vec<(f64, Bolt)> = Vec::new();
        for (hole, by) in holes.iter().enumerate() {
            let turned = (by / TAU * n as f64).round().rem_euclid(n as f64) as usize;
            let cost = |k: usize| sweep.cost(&[&tool[(k + turned) % n], &arm[k]]) / variance;
            let costs: Vec<f64> = (0..n).map(cost).collect();
            let is_least =
                |k: &usize| costs[*k] <= costs[(k + 1) % n] && costs[*k] <= costs[(k + n - 1) % n];
            for k in (0..n).filter(is_least) {
                if let Some(value) = turns::within(turning.at(k, n), limits) {
                    all.push((costs[k], Bolt { hole, value }));
                }
            }
        }
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let Some(least) = all.first().map(|a| a.0) else { return Vec::new() };
        let limit = least + (UNPOLISHED * least).max(AS_GOOD.1);
        all.into_iter().filter(|a| a.0 <= limit).map(|a| a.1).collect()
    }
}
