//! Tells which closed loops stand on the other of their two solutions, by the points and beams of
//! their own links (METHOD.md §12). Limits and closure say which solutions there are; where the
//! points cannot tell, the assembly mode of the zero posture stays.

use robot::Model;

use super::settings::MODES;
use crate::correspond::Apart;
use crate::problem::{Judgement, Problem, judged, links_apart};
use crate::state::Hypothesis;

/// A model with some of its closed loops on their other solution.
pub(crate) struct OtherLoops {
    /// The loops that stand on their other solution.
    pub(crate) loops: Vec<usize>,
    pub(crate) model: Model,
}

/// Loops that stand otherwise than the model has them; `None` where all stand as it has them.
pub(crate) fn other_loops(
    problem: &Problem<'_>,
    h: &Hypothesis,
    own: &Judgement,
) -> Option<OtherLoops> {
    let nominal = problem.prepared.model;
    let mut loops: Vec<usize> = Vec::new();
    let mut model = nominal.clone();
    let mut best = own.clone();
    for at in 0..nominal.loops.len() {
        if !model.has_other_branch(at, &h.posture) {
            continue;
        }
        let other = model.with_other_branches(&[at]);
        let (before, after) = (problem.prepared.moved(&model), problem.prepared.moved(&other));
        let before = Problem { prepared: &before, ..*problem };
        let after = Problem { prepared: &after, ..*problem };
        let found = judged(&after, h);
        let links = links_apart([before.prepared, after.prepared], [h, h]);
        let (mut ahead, mut seen) = (0.0, 0.0);
        for &l in &links {
            ahead += found.links[l][0] - best.links[l][0];
            seen += found.links[l][1].max(best.links[l][1]);
        }
        let worse = || Apart { best: h, other: h }.worsening(&before, &after, &links);
        let is_better = ahead > MODES.loops.surface * seen && worse() < -MODES.loops.squares;
        if is_better {
            loops.push(at);
            (model, best) = (other, found);
        }
    }
    (!loops.is_empty()).then_some(OtherLoops { loops, model })
}
