//! Shares out a body that reaches both a robot and something fixed, by two cuts: one that is near
//! the robot and one that is not.

use crate::body_cut::{Body, Preference, TouchesRobot};
use crate::thin::{LocalShape, is_line, spreads_of};
use contract::Voxel;
use std::collections::BTreeMap;

/// Way along a body from where it touches a robot up to which nothing of it is called fixed because
/// of a cut alone, hundredths of a voxel's edge (15 cm): there may be a tool.
const DOUBT: u32 = 750;
/// Way along a body up to which it is bolted to the robot whatever follows, hundredths of a voxel's
/// edge (4 cm).
const MOUNT: u32 = 200;
/// Range of the largest number of voxels of a tool in two neighbouring levels, if it has more than
/// three times as many there than [`LEVELS_BESIDE`] levels (6 cm) above and below: a level plate
/// whose sides are half of the longest tool, from 25 cm to 40 cm. What is wider is the top of a
/// bench or a part that the tool touches. In any case a tool has no more than three times as many.
const MAX_LEVEL: [usize; 2] = [150, 400];
const LEVELS_BESIDE: i32 = 3;
/// Way along a body over which its voxels are counted as one layer, hundredths of a voxel's edge.
const LAYER: u32 = 100;
/// Number of layers of voxels behind a tip that show that the body is wider there: 6 cm.
const N_LAYERS: usize = 3;
/// Number of layers of voxels behind a cut that may be a part of the tool: 6 cm.
const N_BESIDE: usize = 3;
/// Number of layers of voxels behind a cut in which the end of a tool is looked for: the length of
/// a finger, 10 cm, and that of a thin neck, 40 cm.
const N_FOLLOWED: usize = 5;
const N_FOLLOWED_NECK: usize = 20;
/// Largest number of voxels in a layer of a thin neck, of 6 cm, and how many times longer than
/// thick it is.
const THIN_NECK: usize = 12;
const NECK_RATIO: f64 = 3.0;
/// Least number of voxels in a layer of a neck with which what is behind it is compared.
const LEAST_NECK: usize = 6;

/// To whom a voxel belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Share {
    Robot,
    Open,
    Fixed,
}

/// Tells for each voxel of a body to whom it belongs. What is on the robot's side of the cut near
/// the robot is the robot's, up to one voxel beside the cut, and so is what follows up to the tip
/// of a tool; what only the other cut gives to it is open, as is what is near the hand on the fixed
/// side.
pub(crate) fn share(body: &Body<'_>) -> Vec<Share> {
    let mut near = body.robot_side(Preference::NearRobot);
    let far = body.robot_side(Preference::NearFixed);
    let is_hose = |k: usize| body.shape[k] == LocalShape::Hose;
    let n = body.graph.len();
    // A cut that leaves more than a tool on the robot's side has not found where the tool ends, nor
    // has one behind which the body is as wide as at the cut: a bench would go with the tool.
    let is_whole = is_whole(body, &near);
    let is_tool = is_whole || is_like_a_tool(body, &near);
    let tip = up_to_where_it_widens(body, &near).filter(|tip| is_tool && is_like_a_tool(body, tip));
    let has_tip = tip.is_some();
    let held = match is_tool {
        true if is_whole => u32::MAX,
        true if has_tip || is_narrow(body, &near) => body.longest_tool,
        true => DOUBT,
        false => MOUNT,
    };
    near = tip.unwrap_or(near);
    // What is only near the robot may stand beside it, as a wire does; no tool is looked for there.
    let is_touched = body.contact.contains(&TouchesRobot::Touch);
    let doubt = if is_touched { DOUBT } else { 0 };
    let beside = if is_touched { beside(body, &near) } else { vec![false; n] };
    // One voxel beside a cut may be on either side of it.
    let inside = inside(body, &near);
    let share = |k: usize| {
        let is_held = inside[k] && (body.length[k] <= held || is_hose(k));
        match (near[k], far[k]) {
            (true, far) if is_held && (far || has_tip) => Share::Robot,
            (false, false) if body.is_fixed[k] => Share::Fixed,
            (false, false) if body.length[k] > doubt && !beside[k] => Share::Fixed,
            _ => Share::Open,
        }
    };
    (0..n).map(share).collect()
}

/// Whether only hoses lead from a side to what is not on it: all else hangs on the robot.
fn is_whole(body: &Body<'_>, side: &[bool]) -> bool {
    let mut others = (0..side.len()).filter(|k| side[*k] && body.shape[*k] != LocalShape::Hose);
    others.all(|k| body.graph.neighbours(k).all(|(other, _)| side[other]))
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
    let side = (body.longest_tool / (2 * LAYER)) as usize;
    let most = (side * side).clamp(MAX_LEVEL[0], MAX_LEVEL[1]);
    let level = |at: i32| [at, at + 1].iter().filter_map(|at| levels.get(at)).sum::<usize>();
    let is_wide = |at: &i32| {
        let beside = level(at - LEVELS_BESIDE).max(level(at + LEVELS_BESIDE));
        level(*at) > most && (level(*at) > 3 * most || level(*at) > 3 * beside)
    };
    !widths.keys().filter(|at| **at >= DOUBT / LAYER).any(is_wider) && !levels.keys().any(is_wide)
}

/// A side without its voxels beside the cut.
fn inside(body: &Body<'_>, side: &[bool]) -> Vec<bool> {
    let is_inside = |k: usize| side[k] && body.graph.neighbours(k).all(|(other, _)| side[other]);
    (0..side.len()).map(is_inside).collect()
}

/// A side together with what follows behind its cut, up to where the body becomes wider by half, as
/// where a tip touches a part: a finger is cut anywhere along its length. `None` if that is not
/// found near the cut, or at the end of a straight thin neck.
fn up_to_where_it_widens(body: &Body<'_>, side: &[bool]) -> Option<Vec<bool>> {
    let layers = layers_behind(body, side);
    let width = |at: usize| layers[at].len();
    let mut narrowest = usize::MAX;
    let n_before = (0..N_FOLLOWED_NECK).find(|at| {
        narrowest = narrowest.min(width(*at).max(LEAST_NECK));
        *at > 0 && (*at..at + N_LAYERS).all(|at| 2 * width(at) >= 3 * narrowest)
    })?;
    let is_finger = n_before <= N_FOLLOWED && 5 * narrowest <= 2 * widest_layer(body, side);
    let neck = || layers[..n_before].iter().flatten();
    if !is_finger {
        let places: Vec<Voxel> = neck().map(|k| body.graph.voxel(*k)).collect();
        let is_thin = layers[..n_before].iter().all(|layer| layer.len() <= THIN_NECK);
        if !is_thin || !is_line(&spreads_of(&places, *places.first()?), body.thin, NECK_RATIO) {
            return None;
        }
    }
    let mut side = side.to_vec();
    neck().for_each(|k| side[*k] = true);
    Some(side)
}

/// Whether a body is narrower at a cut than before it.
fn is_narrow(body: &Body<'_>, side: &[bool]) -> bool {
    let layers = layers_behind(body, side);
    let behind = layers[..2].iter().map(Vec::len).min().unwrap_or(0);
    3 * behind <= 2 * widest_layer(body, side)
}

/// Largest number of voxels on a side that are equally far from the robot, hoses aside.
fn widest_layer(body: &Body<'_>, side: &[bool]) -> usize {
    let mut widths = BTreeMap::new();
    for k in (0..side.len()).filter(|k| side[*k] && body.shape[*k] != LocalShape::Hose) {
        *widths.entry(body.length[k] / LAYER).or_insert(0) += 1;
    }
    widths.into_values().max().unwrap_or(0)
}

/// The voxels that are not on a side, but at most three steps away from it, as what may still be a
/// part of a tool behind its cut.
fn beside(body: &Body<'_>, side: &[bool]) -> Vec<bool> {
    let mut beside = vec![false; side.len()];
    let layers = layers_behind(body, side);
    layers.iter().take(N_BESIDE).flatten().for_each(|k| beside[*k] = true);
    beside
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
    (0..N_FOLLOWED_NECK + N_LAYERS).map(next).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::voxel_graph::Graph;

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
