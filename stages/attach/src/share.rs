//! Shares out a body that reaches both a robot and something fixed, by two cuts: one that is near
//! the robot and one that is not.

use crate::body_cut::{Body, Preference, TouchesRobot};
use crate::thin::LocalShape;
use std::collections::BTreeMap;

/// Way along a body from where it touches a robot up to which nothing of it is called fixed because
/// of a cut alone, hundredths of a voxel's edge (15 cm): there may be a tool.
const DOUBT: u32 = 750;
/// Way along a body up to which it is bolted to the robot whatever follows, hundredths of a voxel's
/// edge (4 cm).
const MOUNT: u32 = 200;
/// Largest number of voxels of a tool in two neighbouring levels: a level plate of 25 cm by 25 cm.
/// What is wider is the top of a bench or a part that the tool touches.
const MAX_LEVEL: usize = 150;
/// Way along a body over which its voxels are counted as one layer, hundredths of a voxel's edge.
const LAYER: u32 = 100;
/// Number of layers of voxels behind a cut that are counted: 12 cm.
const N_LAYERS: usize = 6;
/// Number of layers of voxels behind a cut in which the end of a tool is looked for: 20 cm.
const N_FOLLOWED: usize = 10;

/// To whom a voxel belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Share {
    Robot,
    Open,
    Fixed,
}

/// Tells for each voxel of a body to whom it belongs. What is on the robot's side of the cut near
/// the robot is the robot's, up to two voxels beside the cut; what only the other cut gives to it
/// is open, as is what is near the hand on the fixed side.
pub(crate) fn share(body: &Body<'_>) -> Vec<Share> {
    let mut near = body.robot_side(Preference::NearRobot);
    let far = body.robot_side(Preference::NearFixed);
    let is_hose = |k: usize| body.shape[k] == LocalShape::Hose;
    let n = body.graph.len();
    // A cut that leaves more than a tool on the robot's side has not found where the tool ends, nor
    // has one behind which the body is as wide as at the cut: a bench would go with the tool.
    let held = if !is_like_a_tool(body, &near) {
        MOUNT
    } else if let Some(side) = up_to_where_it_widens(body, &near) {
        near = side;
        body.longest_tool
    } else {
        DOUBT
    };
    // What is only near the robot may stand beside it, as a wire does; no tool is looked for there.
    let doubt = if body.contact.contains(&TouchesRobot::Touch) { DOUBT } else { 0 };
    // One voxel beside a cut may be on either side of it, and two where it is no hose that is cut.
    let once = inside(body, &near);
    let twice = inside(body, &once);
    let share = |k: usize| {
        let is_held = twice[k] && body.length[k] <= held || once[k] && is_hose(k);
        match (near[k], far[k]) {
            (true, true) if is_held => Share::Robot,
            (false, false) if body.length[k] > doubt || body.is_fixed[k] => Share::Fixed,
            _ => Share::Open,
        }
    };
    (0..n).map(share).collect()
}

/// Whether what is on the robot's side of a cut may be a tool, hoses aside: it is no longer than
/// one, has no wide level surface, and becomes no wider far from the hand, as a bench does behind
/// the tip that touches it.
fn is_like_a_tool(body: &Body<'_>, side: &[bool]) -> bool {
    let (mut widths, mut levels) = (BTreeMap::new(), BTreeMap::new());
    for k in (0..side.len()).filter(|k| side[*k] && body.shape[*k] != LocalShape::Hose) {
        if body.length[k] > body.longest_tool {
            return false;
        }
        *widths.entry(body.length[k] / LAYER).or_insert(0_usize) += 1;
        *levels.entry(body.graph.voxel(k)[2]).or_insert(0_usize) += 1;
    }
    let width = |at: u32| widths.get(&at).copied().unwrap_or(0);
    let at_hand = widths.range(..DOUBT / LAYER).map(|(_, n)| *n).max().unwrap_or(0);
    let is_wider = |at: &u32| 2 * (width(*at) + width(at + 1) + width(at + 2)) > 9 * at_hand;
    let is_wide = |(at, n): (&i32, &usize)| n + levels.get(&(at + 1)).unwrap_or(&0) > MAX_LEVEL;
    !widths.keys().filter(|at| **at >= DOUBT / LAYER).any(is_wider) && !levels.iter().any(is_wide)
}

/// A side without its voxels beside the cut.
fn inside(body: &Body<'_>, side: &[bool]) -> Vec<bool> {
    let is_inside = |k: usize| side[k] && body.graph.neighbours(k).all(|(other, _)| side[other]);
    (0..side.len()).map(is_inside).collect()
}

/// A side together with what follows behind its cut, up to where the body becomes half as wide
/// again, as where a tip touches a part: a finger is cut anywhere along its length. `None` if that
/// is not found near the cut.
fn up_to_where_it_widens(body: &Body<'_>, side: &[bool]) -> Option<Vec<bool>> {
    let layers = layers_behind(body, side);
    let width = |at: usize| layers[at].len() + layers[at + 1].len();
    let widens = |at: &usize| {
        let behind = width(at + N_LAYERS - 2);
        behind > 0 && 2 * behind >= 3 * width(*at)
    };
    let n_before = (0..N_FOLLOWED).find(widens)?;
    let mut side = side.to_vec();
    layers[..n_before].iter().flatten().for_each(|k| side[*k] = true);
    Some(side)
}

/// The voxels behind a cut in layers, the nearest first.
fn layers_behind(body: &Body<'_>, side: &[bool]) -> Vec<Vec<usize>> {
    let mut is_seen = side.to_vec();
    let mut layer: Vec<usize> = (0..side.len()).filter(|k| side[*k]).collect();
    let next = |_| {
        let mut next = Vec::new();
        for k in &layer {
            for (other, _) in body.graph.neighbours(*k) {
                if !std::mem::replace(&mut is_seen[other], true) {
                    next.push(other);
                }
            }
        }
        layer.clone_from(&next);
        next
    };
    (0..N_FOLLOWED + N_LAYERS).map(next).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::voxel_graph::Graph;
    use contract::Voxel;

    fn is_a_tool(voxels: &[Voxel]) -> bool {
        let graph = Graph::new(voxels);
        let n = voxels.len();
        let body = Body {
            graph: &graph,
            length: voxels.iter().map(|v| 100 * v[2].unsigned_abs()).collect(),
            from_hand: vec![true; n],
            longest_tool: 2500,
            contact: vec![TouchesRobot::None; n],
            is_fixed: vec![false; n],
            shape: vec![LocalShape::Body; n],
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
