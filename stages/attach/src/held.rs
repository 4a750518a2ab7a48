//! What a robot holds although it also touches something fixed: a plate of suction cups on a pile,
//! and what a hose leads to.

use crate::body_cut::{Body, TouchesRobot};
use crate::layers::{N_BESIDE, N_FOLLOWED, N_FOLLOWED_NECK, THIN_NECK, layers_behind};
use crate::thin::LocalShape;

/// How many times more voxels a side has than touch it behind its cut, if it does not stand there.
const LIGHT: usize = 18;
/// How many times wider than there the body is within 10 cm behind such a cut.
const WIDENS: usize = 3;
/// Largest distance of the hand from the middle of such a side, in mean distances of its voxels.
const CENTRED: f64 = 0.6;
/// Way along what a robot holds, in longest tools: around a plate or a part it is longer than one.
pub(crate) const LIGHT_TOOLS: u32 = 2;
/// Least number of voxels behind a cut that must face up for something to rest on them.
const LEAST_UP: usize = 6;
/// Least number of voxels that touch a hand where a side hangs on a thin part as well.
const TOUCHED: usize = 2;

/// Whether a side touches what is behind its cut so little, for its size, that it does not stand on
/// it: a plate of suction cups on a pile. Behind the cut the body must become wide at once, as legs
/// of a bench do not, and the side must be centred beside the hand, as a bench rarely is.
pub(crate) fn is_light_touch(body: &Body<'_>, side: &[bool]) -> bool {
    is_lightly_touching(body, side, CENTRED)
}

/// The same with another bound of how far from its middle the hand may be.
pub(crate) fn is_lightly_touching(body: &Body<'_>, side: &[bool], centred: f64) -> bool {
    let layers = layers_behind(body.graph, side);
    let n_touched = layers[0].len();
    let own = compact(body, side);
    let widens = layers[..N_FOLLOWED].iter().any(|layer| layer.len() >= WIDENS * n_touched);
    n_touched > 0 && own.len() >= LIGHT * n_touched && widens && is_centred(body, &own, centred)
}

/// The voxels of a side that are no hose; none where one of them is farther from the robot than a
/// tool with a plate or a part reaches.
fn compact(body: &Body<'_>, side: &[bool]) -> Vec<usize> {
    let is_own = |k: &usize| side[*k] && body.shape[*k] != LocalShape::Hose;
    let own: Vec<usize> = (0..side.len()).filter(is_own).collect();
    let is_near = |k: &usize| body.length[*k] <= LIGHT_TOOLS * body.longest_tool;
    if own.iter().all(is_near) { own } else { Vec::new() }
}

/// Whether what is behind the cut of a side faces up: the side rests on it. A bench whose legs are
/// cut has sides of legs there.
pub(crate) fn is_on_top(body: &Body<'_>, side: &[bool]) -> bool {
    let layers = layers_behind(body.graph, side);
    let faces = layers[..N_BESIDE].iter().flatten().filter_map(|k| body.facet[*k].faces_up());
    let (mut n, mut n_up) = (0, 0);
    for faces_up in faces {
        n += 1;
        n_up += usize::from(faces_up);
    }
    n_up >= LEAST_UP && 2 * n_up >= n
}

/// The thin part behind the cut of a side that hangs on it, as a hose that leads to what a robot
/// holds; empty where it is on the side already, and `None` where the side may stand: what stands
/// is held from below.
pub(crate) fn line_that_holds(body: &Body<'_>, side: &[bool]) -> Option<Vec<bool>> {
    let is_at_cut = |k: &usize| body.graph.neighbours(*k).any(|(other, _)| !side[other]);
    let all: Vec<usize> = (0..side.len()).filter(|k| side[*k]).collect();
    let at_cut: Vec<usize> = all.iter().copied().filter(is_at_cut).collect();
    let own = compact(body, side);
    let height = |of: &[usize]| {
        of.iter().map(|k| f64::from(body.graph.voxel(*k)[2])).sum::<f64>() / of.len() as f64
    };
    let touches =
        |k: &&usize| body.contact[**k] == TouchesRobot::Touch && body.from_hand[**k] == Some(0);
    if own.iter().filter(touches).count() < TOUCHED {
        return None;
    }
    if at_cut.is_empty() || height(&at_cut) <= height(&own) {
        return None;
    }
    let is_thin = |layer: &Vec<usize>| (1..=THIN_NECK).contains(&layer.len());
    // A bit of the side may lie beside where the line begins, if the line is long.
    let begin_of_line = |layers: &[Vec<usize>]| {
        let is_short = layers[N_BESIDE..N_BESIDE + N_FOLLOWED].iter().all(is_thin);
        let is_long = layers[N_FOLLOWED..N_FOLLOWED_NECK].iter().all(is_thin);
        is_short.then_some(N_BESIDE).or(is_long.then_some(N_FOLLOWED))
    };
    let others: Vec<bool> = side.iter().map(|own| !own).collect();
    let mut line = vec![false; side.len()];
    if begin_of_line(&layers_behind(body.graph, &others)) == Some(N_BESIDE) {
        return Some(line);
    }
    let mut at = layers_behind(body.graph, side);
    let mut n_beside = begin_of_line(&at)?;
    let mut reached = side.to_vec();
    while let Some(layer) = at.first().filter(|layer| n_beside > 0 || is_thin(layer)) {
        n_beside = n_beside.saturating_sub(1);
        if layer.iter().any(|k| body.is_fixed[*k]) {
            break;
        }
        layer.iter().for_each(|k| (reached[*k], line[*k]) = (true, true));
        at.remove(0);
        if at.is_empty() {
            at = layers_behind(body.graph, &reached);
        }
    }
    Some(line)
}

/// Whether voxels lie about those of them that touch the robot, seen from above.
fn is_centred(body: &Body<'_>, own: &[usize], most: f64) -> bool {
    let place = |k: &usize| body.graph.voxel(*k).map(f64::from);
    let mean = |chosen: &[usize]| {
        let sum = chosen.iter().map(place).fold([0.0; 2], |s, v| [s[0] + v[0], s[1] + v[1]]);
        sum.map(|v| v / chosen.len() as f64)
    };
    let touches = |k: &usize| body.contact[*k] != TouchesRobot::None;
    let hand: Vec<usize> = own.iter().copied().filter(touches).collect();
    let (hand, middle) = (mean(&hand), mean(own));
    let away = |v: [f64; 3]| (v[0] - middle[0]).hypot(v[1] - middle[1]);
    let spread = own.iter().map(|k| away(place(k))).sum::<f64>() / own.len() as f64;
    away([hand[0], hand[1], 0.0]) <= most * spread
}
