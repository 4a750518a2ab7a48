//! A settled posture in; out come the closed loops that stand on the other of their two solutions,
//! by the points and beams of their own links (METHOD.md §12): limits and closure say which
//! solutions there are, the assembly mode of the zero posture stays where the points cannot tell.

use robot::Model;

use crate::beam::Hypothesis;
use crate::judge::{Judgement, judged};
use crate::refine::Refine;

/// How much better the points and beams must like the other solution: shares of squares and of
/// surface judged.
const CLEAR: (f64, f64) = (0.1, 0.1);

/// Loops that stand otherwise than the model has them, and the model with them so; `None` where all
/// stand as it has them.
pub(crate) fn branches(
    refine: &Refine<'_>,
    h: &Hypothesis,
    own: &Judgement,
    near: &[u32],
) -> Option<(Vec<usize>, Model)> {
    let nominal = refine.prepared.model;
    let mut loops: Vec<usize> = Vec::new();
    let mut model = nominal.clone();
    let mut best = own.clone();
    for at in 0..nominal.loops.len() {
        if !model.has_other_branch(at, &h.posture) {
            continue;
        }
        let other = model.with_other_branches(&[at]);
        let (before, after) = (refine.prepared.moved(&model), refine.prepared.moved(&other));
        let before = Refine { prepared: &before, prior: refine.prior, ..*refine };
        let after = Refine { prepared: &after, prior: refine.prior, ..*refine };
        let found = judged(&after, h);
        let links = before.apart(&after, h);
        let (mut ahead, mut seen) = (0.0, 0.0);
        for &l in &links {
            ahead += found.links[l][0] - best.links[l][0];
            seen += found.links[l][1].max(best.links[l][1]);
        }
        let is_better =
            ahead > CLEAR.0 * seen && before.worsening_in(&after, [h, h], &links, near) < -CLEAR.1;
        if is_better {
            loops.push(at);
            (model, best) = (other, found);
        }
    }
    (!loops.is_empty()).then_some((loops, model))
}
