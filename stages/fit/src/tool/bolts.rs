//! Tells which holes of a flange a tool may be bolted to. The turn of the tool is the sum of the
//! turns of the last joint and of the hole; only the flange itself tells the two apart (METHOD.md
//! §13).

use contract::Fan;
use geometry::angle;
use robot::Role;
use std::f64::consts::TAU;

use crate::modes::{AsGood, JointProfile, MODES};
use crate::problem::Problem;
use crate::state::Hypothesis;

/// Turns of tool and flange that are tried are so many, or twice, and so on: every turn between
/// holes, 15°, is one of them.
const N_HOLES: usize = 24;

/// Squares by which a side may be worse and still be as good: fingers and last joint are not
/// refined on it, but stand as the first side has them. The wrong side of a two-finger gripper was
/// the better one by 4.5 %; what is no side of it is worse by 36 %.
const AS_GOOD_UNREFINED: AsGood = AsGood { share: 0.10, ..MODES.as_good };

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
    profile: JointProfile<'a>,
    own: Vec<usize>,
    tool: Vec<usize>,
    /// Value of the joint in the posture as it stands, radians.
    value: f64,
}

impl<'a> Turning<'a> {
    /// `None` where the points are too few, or nothing turns that is a tool.
    fn new(problem: &Problem<'a>, h: &'a Hypothesis, flange: usize) -> Option<Self> {
        let profile = JointProfile::new(problem, h, flange)?;
        let is_tool = |l: &usize| problem.prepared.model.links[*l].role == Role::Effector;
        let (tool, own): (Vec<usize>, Vec<usize>) =
            profile.moved.iter().copied().partition(is_tool);
        let value = h.posture[flange];
        (!tool.is_empty()).then_some(Self { profile, own, tool, value })
    }

    /// Distances of the points to some of the links at equal steps of a whole turn from where the
    /// joint stands, metres.
    fn around(&self, n: usize, links: &[usize], fan: &dyn Fan) -> Vec<Vec<f32>> {
        fan.fan((0..n).collect(), |k| self.profile.distances(self.at(k, n), links))
    }

    /// The joint's value after so many of `n` steps, radians.
    fn at(&self, k: usize, n: usize) -> f64 {
        self.value + TAU * k as f64 / n as f64
    }
}

/// All pairs of the joint `flange` and a hole that explain the points as well as the best one,
/// best first; the holes are turns of the tool about that joint, the posture is that of the
/// hole at 0. Empty where the points are too few.
pub(super) fn bolts(
    problem: &Problem<'_>,
    h: &Hypothesis,
    flange: usize,
    holes: &[f64],
) -> Vec<Bolt> {
    let Some(turning) = Turning::new(problem, h, flange) else { return Vec::new() };
    let limits = problem.prepared.model.limits(flange);
    let (profile, variance) = (&turning.profile, problem.scene.noise * problem.scene.noise);
    let n = profile.n_values(TAU).next_multiple_of(N_HOLES);
    let [tool, arm] =
        [&turning.tool, &turning.own].map(|links| turning.around(n, links, problem.fan));
    let mut all: Vec<(f64, Bolt)> = Vec::new();
    for (hole, by) in holes.iter().enumerate() {
        let turned = (by / TAU * n as f64).round().rem_euclid(n as f64) as usize;
        let cost = |k: usize| profile.cost(&[&tool[(k + turned) % n], &arm[k]]) / variance;
        let costs: Vec<f64> = (0..n).map(cost).collect();
        let is_least =
            |k: &usize| costs[*k] <= costs[(k + 1) % n] && costs[*k] <= costs[(k + n - 1) % n];
        for k in (0..n).filter(is_least) {
            if let Some(value) = angle::within(turning.at(k, n), limits) {
                all.push((costs[k], Bolt { hole, value }));
            }
        }
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let Some(least) = all.first().map(|a| a.0) else { return Vec::new() };
    let limit = AS_GOOD_UNREFINED.limit(least, 1.0);
    all.into_iter().filter(|a| a.0 <= limit).map(|a| a.1).collect()
}
