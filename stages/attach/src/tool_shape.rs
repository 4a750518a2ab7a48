//! Which sides of a cut have the shape of a tool.

use crate::body_cut::Body;
use crate::thin::LocalShape;
use std::collections::BTreeMap;

/// Way along a body from the robot within which it is as wide as it is at the hand, hundredths of a
/// voxel's edge (15 cm).
const AT_HAND: u32 = 750;
/// Range of the largest number of voxels of a tool in two neighbouring levels, if it has more than
/// three times as many there than [`LEVELS_BESIDE`] levels (6 cm) above and below: a level plate
/// whose sides are half of the longest tool, from 25 cm to 40 cm. What is wider is the top of a
/// bench or a part that the tool touches. In any case a tool has no more than three times as many.
const MAX_LEVEL: [usize; 2] = [150, 400];
const LEVELS_BESIDE: i32 = 3;
/// Way along a body over which its voxels are counted as one layer, hundredths of a voxel's edge.
pub(crate) const LAYER: u32 = 100;

/// Whether what is on the robot's side of a cut may be a tool, hoses aside: it is no longer than
/// one, has no wide level surface, and becomes no wider far from the hand, as a bench does behind
/// the tip that touches it.
pub(crate) fn is_like_a_tool(body: &Body<'_>, side: &[bool]) -> bool {
    let (mut widths, mut levels) = (BTreeMap::new(), BTreeMap::new());
    for k in (0..side.len()).filter(|k| side[*k] && body.shape[*k] != LocalShape::Hose) {
        if body.length[k] > body.longest_tool {
            return false;
        }
        *widths.entry(body.length[k] / LAYER).or_insert(0_usize) += 1;
        *levels.entry(body.graph.voxel(k)[2]).or_insert(0_usize) += 1;
    }
    let width = |at: u32| widths.get(&at).copied().unwrap_or(0);
    let at_hand = widths.range(..AT_HAND / LAYER).map(|(_, n)| *n).max().unwrap_or(0);
    let is_wider = |at: &u32| 2 * (width(*at) + width(at + 1) + width(at + 2)) > 9 * at_hand;
    let side = (body.longest_tool / (2 * LAYER)) as usize;
    let most = (side * side).clamp(MAX_LEVEL[0], MAX_LEVEL[1]);
    let level = |at: i32| [at, at + 1].iter().filter_map(|at| levels.get(at)).sum::<usize>();
    let is_wide = |at: &i32| {
        let beside = level(at - LEVELS_BESIDE).max(level(at + LEVELS_BESIDE));
        level(*at) > most && (level(*at) > 3 * most || level(*at) > 3 * beside)
    };
    !widths.keys().filter(|at| **at >= AT_HAND / LAYER).any(is_wider) && !levels.keys().any(is_wide)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body_cut::TouchesRobot;
    use crate::voxel_graph::Graph;
    use contract::Voxel;

    fn is_a_tool(voxels: &[Voxel]) -> bool {
        let graph = Graph::new(voxels);
        let n = voxels.len();
        let body = Body {
            graph: &graph,
            length: voxels.iter().map(|v| 100 * v[2].unsigned_abs()).collect(),
            from_hand: voxels.iter().map(|v| Some(100 * v[2].unsigned_abs())).collect(),
            longest_tool: 2500,
            thin: 0.19,
            contact: vec![TouchesRobot::None; n],
            is_fixed: vec![false; n],
            shape: vec![LocalShape::Body; n],
            facet: Vec::new(),
        };
        is_like_a_tool(&body, &vec![true; n])
    }

    /// A solid block of this width between two heights below a hand.
    fn block(width: i32, heights: std::ops::Range<i32>) -> Vec<Voxel> {
        let level = |z: i32| (0..width).flat_map(move |x| (0..width).map(move |y| [x, y, -z]));
        heights.flat_map(level).collect()
    }

    #[test]
    fn a_bench_behind_a_tool_is_no_tool() {
        let tool = block(4, 0..10);
        assert!(is_a_tool(&tool));
        // A wide top, a body that is wider than the tool, and one that is too long.
        assert!(!is_a_tool(&[tool.clone(), block(10, 10..12)].concat()));
        assert!(!is_a_tool(&[tool.clone(), block(7, 10..16)].concat()));
        assert!(!is_a_tool(&[tool, block(4, 10..30)].concat()));
    }
}
