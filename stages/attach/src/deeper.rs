//! What may be a tool: cuts that are asked for deeper and deeper behind a hand.
//!
//! The mount of a tool may be its thinnest part, or hidden, so that the least cut is there. What
//! follows still hangs on the hand if it ends like a tool: at tips, or at cups on a pile.

use crate::body_cut::Body;
use crate::held::is_lightly_touching;
use crate::tool_shape::is_like_a_tool;

/// By how much deeper each cut is, hundredths of a voxel's edge (5 cm).
const STEP: u32 = 250;
/// Largest distance of the hand from the middle of a plate of which half is hidden, in mean
/// distances of its voxels: still above the plate, and not beside it.
const ABOVE: f64 = 1.0;

/// The largest side of such a cut that may be a tool; nothing where no hand is near.
pub(crate) fn may_be_a_tool(body: &Body<'_>) -> Vec<bool> {
    let mut found = vec![false; body.graph.len()];
    let mut side = found.clone();
    for depth in (STEP..=body.longest_tool).step_by(STEP as usize) {
        let is_within = |k: usize| body.from_hand[k].is_some_and(|length| length <= depth);
        if (0..side.len()).all(|k| side[k] || body.is_fixed[k] || !is_within(k)) {
            continue;
        }
        side = body.side_beyond(depth);
        if is_like_a_tool(body, &side) || is_lightly_touching(body, &side, ABOVE) {
            found.clone_from(&side);
        }
    }
    found
}
