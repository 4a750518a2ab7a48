//! Shares out a body that reaches both a robot and something fixed, by two cuts: one that is near
//! the robot and one that is not.

use crate::body_cut::{Body, Preference, TouchesRobot};
use crate::deeper::may_be_a_tool;
use crate::held::{LIGHT_TOOLS, is_light_touch, is_on_top, line_that_holds};
use crate::layers::{N_BESIDE, N_FOLLOWED, N_FOLLOWED_NECK, N_LAYERS, THIN_NECK, layers_behind};
use crate::structure::parts;
use crate::thin::{LocalShape, is_line, spreads_of};
use crate::tool_shape::{LAYER, is_like_a_tool};
use crate::touched_line::lines_at_a_tip;
use contract::Voxel;
use std::collections::BTreeMap;

/// Way along a body from where it touches a robot up to which nothing of it is called fixed because
/// of a cut alone, hundredths of a voxel's edge (15 cm): there may be a tool.
const DOUBT: u32 = 750;
/// Largest number of voxels of what a hose ends in.
const HOSE_END: usize = 20;
/// Way along a body up to which it is bolted to the robot whatever follows, hundredths of a voxel's
/// edge (4 cm).
const MOUNT: u32 = 200;
/// How many times longer than thick a thin neck is.
const NECK_RATIO: f64 = 3.0;
/// Least number of voxels in a layer of a neck with which what is behind it is compared.
const LEAST_NECK: usize = 6;

/// Way along a body up to which its robot's side is held to be a tool where the cut is not at the
/// end of something, hundredths of a voxel's edge (10 cm): the side may hold what stands beside it.
const CERTAIN: u32 = 500;

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
    // A hose holds nothing: what only hoses join to the building is the robot's, flat or not.
    if is_whole(body, &far) {
        near.clone_from(&far);
    }
    let is_hose = |k: usize| body.shape[k] == LocalShape::Hose;
    let n = body.graph.len();
    // A cut that leaves more than a tool on the robot's side has not found where the tool ends, nor
    // has one behind which the body is as wide as at the cut: a bench would go with the tool.
    let is_whole = is_whole(body, &near);
    let mut is_light = is_light_touch(body, &near);
    // Wide flat surfaces are cut off near the robot, also those of a plate that it holds.
    let line = line_that_holds(body, &far);
    if line.is_some() || !is_light && is_light_touch(body, &far) && is_on_top(body, &far) {
        is_light = true;
        near.clone_from(&far);
    }
    let on_line: Vec<bool> = line.unwrap_or_else(|| vec![false; n]);
    near.iter_mut().zip(&on_line).for_each(|(near, line)| *near |= line);
    let is_tool = is_whole || is_light || is_like_a_tool(body, &near);
    let tip = up_to_where_it_widens(body, &near)
        .filter(|tip| is_tool && !is_light && is_like_a_tool(body, tip));
    let has_tip = tip.is_some();
    let held = match is_tool {
        true if is_whole => u32::MAX,
        true if is_light => LIGHT_TOOLS * body.longest_tool,
        true if has_tip || is_narrow(body, &near) => body.longest_tool,
        true => CERTAIN,
        false => MOUNT,
    };
    near = tip.unwrap_or(near);
    // What is only near the robot may stand beside it, as a wire does; no tool is looked for there.
    let is_touched = body.contact.contains(&TouchesRobot::Touch);
    let doubt = if is_touched { DOUBT } else { 0 };
    let beside = if is_touched { beside(body, &near) } else { vec![false; n] };
    let may_be_a_tool = may_be_a_tool(body);
    let at_tip = if is_whole { vec![false; n] } else { lines_at_a_tip(body, &near) };
    // One voxel beside a cut may be on either side of it.
    let inside = inside(body, &near);
    let share = |k: usize| {
        // Beside another link than a hand nothing is a tool.
        let held = if is_whole || body.from_hand[k].is_some() { held } else { held.min(MOUNT) };
        let is_held = inside[k] && (body.length[k] <= held || is_hose(k) || on_line[k]);
        match (near[k], far[k] || on_line[k]) {
            (true, far) if is_held && (far || has_tip) && !at_tip[k] => Share::Robot,
            (false, false) if body.is_fixed[k] => Share::Fixed,
            (false, false) if may_be_a_tool[k] => Share::Open,
            (false, false) if body.length[k] > doubt && !beside[k] => Share::Fixed,
            _ => Share::Open,
        }
    };
    (0..n).map(share).collect()
}

/// Whether only hoses lead from a side to what is not on it: all else hangs on the robot. What a
/// hose ends in, as a clamp, belongs to it.
fn is_whole(body: &Body<'_>, side: &[bool]) -> bool {
    let is_inner = |k: &usize| body.graph.neighbours(*k).all(|(other, _)| side[other]);
    let is_end = |part: &[usize]| {
        let at_robot = part.iter().any(|k| body.contact[*k] != TouchesRobot::None);
        !at_robot && part.len() <= HOSE_END
    };
    let others = parts(body.graph, |k| side[k] && body.shape[k] != LocalShape::Hose);
    others.iter().all(|part| part.iter().all(is_inner) || is_end(part))
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
    let layers = layers_behind(body.graph, side);
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

/// Whether a body is narrower at a cut than beside the hand, as fingers are.
fn is_narrow(body: &Body<'_>, side: &[bool]) -> bool {
    let mut widths = vec![0; (CERTAIN / LAYER) as usize];
    for k in (0..side.len()).filter(|k| side[*k] && body.shape[*k] != LocalShape::Hose) {
        if let Some(width) = widths.get_mut((body.length[k] / LAYER) as usize) {
            *width += 1;
        }
    }
    widths.sort_unstable();
    let layers = layers_behind(body.graph, side);
    let behind = layers[..2].iter().map(Vec::len).min().unwrap_or(0);
    3 * behind <= 2 * widths[widths.len() / 2]
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
    let layers = layers_behind(body.graph, side);
    layers.iter().take(N_BESIDE).flatten().for_each(|k| beside[*k] = true);
    beside
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::voxel_graph::Graph;

    #[test]
    fn what_a_hose_ends_in_belongs_to_it_and_a_thing_that_a_tool_touches_does_not() {
        // A tool, a hose, and what that is held by, along x; the last voxel is beyond the cut.
        let voxels: Vec<Voxel> = (0..60).map(|x| [x, 0, 0]).collect();
        let graph = Graph::new(&voxels);
        let is_whole_with = |hose: std::ops::Range<usize>| {
            let shape = |k: usize| match hose.contains(&k) {
                true => LocalShape::Hose,
                false => LocalShape::Body,
            };
            let body = Body {
                graph: &graph,
                length: (0..60).map(|k| 100 * k).collect(),
                from_hand: vec![None; 60],
                longest_tool: 2500,
                thin: 0.19,
                contact: (0..60)
                    .map(|k| if k == 0 { TouchesRobot::Touch } else { TouchesRobot::None })
                    .collect(),
                is_fixed: vec![false; 60],
                shape: (0..60).map(shape).collect(),
                facet: Vec::new(),
            };
            is_whole(&body, &(0..60).map(|k| k < 59).collect::<Vec<_>>())
        };
        assert!(is_whole_with(10..55));
        assert!(!is_whole_with(10..30));
        assert!(!is_whole_with(0..0));
    }
}
