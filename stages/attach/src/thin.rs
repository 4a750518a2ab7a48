//! Which voxels of a body belong to a thin part of it that runs on in one direction: a hose, a
//! cable, the neck of a torch.

use crate::voxel_graph::Graph;
use contract::{RESIDUAL_EDGE, Voxel};
use std::collections::{BTreeMap, BTreeSet};

/// Distance around a voxel within which the shape of the body counts, voxels: 10 cm.
const AROUND: i64 = 5;
/// Least ratio of the spreads along a thin part and across it.
const MIN_RATIO: f64 = 1.5;
/// Way from the robot within which a thin part begins, hundredths of a voxel's edge (8 cm).
const BEGINS: u32 = 400;
/// Least length of a hose, hundredths of a voxel's edge (35 cm): longer than the fingers of a
/// gripper with a slender part between them.
const MIN_HOSE: u32 = 1750;
/// Least number of voxels within [`AROUND`] of one on a flat surface: two thirds of a disc.
const MIN_FLAT: usize = 35;
/// Largest standard deviation of a flat surface from its plane, voxels: it may cross a layer.
const MAX_BUMP: f64 = 0.6;
/// Least standard deviation of a wide surface in its narrower direction, voxels: half of the
/// radius of a disc would be 2.5.
const MIN_WIDE: f64 = 2.0;
/// Standard deviation that the edges of voxels add, voxels.
const BLUR: f64 = 0.3;

/// What a voxel is part of, by the shape of the body around it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shape {
    /// Anything that does not run on in one direction.
    Body,
    /// A long thin part that begins at the robot and is thin from there on.
    Hose,
    /// Another thin part, as the leg of a bench.
    Leg,
    /// A surface that is flat and wider than tools are: of a part, a bench, a wall.
    Flat,
}

/// The shape around each member of a component. `length` is the way along the body from the robot
/// to each voxel of the graph (hundredths of a voxel's edge), and `thin` the largest circumference
/// of a thin part, metres.
pub(crate) fn shapes(
    graph: &Graph,
    members: &[usize],
    length: impl Fn(usize) -> u32,
    thin: f64,
) -> Vec<Shape> {
    let place: BTreeMap<usize, usize> =
        members.iter().enumerate().map(|(place, &at)| (at, place)).collect();
    let around: Vec<([f64; 3], usize)> = members.iter().map(|at| spreads(graph, *at)).collect();
    let is_thin: Vec<bool> =
        around.iter().map(|(spread, _)| is_line(spread, thin, MIN_RATIO)).collect();
    let begins = |k: &usize| length(members[*k]) <= BEGINS;
    let is_reached = reached(graph, members, &place, (0..members.len()).filter(begins), &is_thin);
    let shape = |(spread, n): &([f64; 3], usize)| match is_line(spread, thin, MIN_RATIO) {
        true => Shape::Leg,
        false if is_flat(spread, *n) => Shape::Flat,
        false => Shape::Body,
    };
    let mut shapes: Vec<Shape> = around.iter().map(shape).collect();
    let part = |first: usize, is_seen: &mut [bool]| {
        is_seen[first] = true;
        let mut part = vec![first];
        let mut next = 0;
        while let Some(&k) = part.get(next) {
            next += 1;
            for (other, _) in graph.neighbours(members[k]) {
                if let Some(&other) = place.get(&other)
                    && is_thin[other]
                    && is_reached[other]
                    && !is_seen[other]
                {
                    is_seen[other] = true;
                    part.push(other);
                }
            }
        }
        part
    };
    let mut is_seen = vec![false; members.len()];
    for first in 0..members.len() {
        if is_thin[first] && is_reached[first] && !is_seen[first] {
            let part = part(first, &mut is_seen);
            let ways = || part.iter().map(|k| length(members[*k]));
            let span = ways().max().unwrap_or(0) - ways().min().unwrap_or(0);
            let shape = if span >= MIN_HOSE { Shape::Hose } else { Shape::Body };
            part.iter().for_each(|k| shapes[*k] = shape);
        }
    }
    shapes
}

/// The members that are reached from some of them through thin ones, and these themselves.
fn reached(
    graph: &Graph,
    members: &[usize],
    place: &BTreeMap<usize, usize>,
    from: impl Iterator<Item = usize>,
    is_thin: &[bool],
) -> Vec<bool> {
    let mut is_reached = vec![false; members.len()];
    let mut queue: Vec<usize> = from.collect();
    queue.iter().for_each(|k| is_reached[*k] = true);
    while let Some(k) = queue.pop() {
        for (other, _) in graph.neighbours(members[k]) {
            if let Some(&other) = place.get(&other)
                && is_thin[other]
                && !is_reached[other]
            {
                is_reached[other] = true;
                queue.push(other);
            }
        }
    }
    is_reached
}

/// Standard deviations of the body around a voxel along its three main directions, voxels,
/// ascending, from its connected voxels within [`AROUND`]; and their number.
fn spreads(graph: &Graph, at: usize) -> ([f64; 3], usize) {
    let centre = graph.voxel(at);
    let by =
        |other: usize| [0, 1, 2].map(|i| i64::from(graph.voxel(other)[i]) - i64::from(centre[i]));
    let mut near = BTreeSet::from([at]);
    let mut queue = vec![at];
    while let Some(next) = queue.pop() {
        for (other, _) in graph.neighbours(next) {
            let square: i64 = by(other).iter().map(|v| v * v).sum();
            if square <= AROUND * AROUND && near.insert(other) {
                queue.push(other);
            }
        }
    }
    let near: Vec<Voxel> = near.into_iter().map(|other| graph.voxel(other)).collect();
    (spreads_of(&near, centre), near.len())
}

/// Standard deviations of voxels along their three main directions, voxels, ascending. `centre` is
/// near them all.
pub(crate) fn spreads_of(near: &[Voxel], centre: Voxel) -> [f64; 3] {
    let n = near.len() as f64;
    let (mut sum, mut squares) = ([0.0; 3], [[0.0; 3]; 3]);
    for other in near {
        let by = [0, 1, 2].map(|i| f64::from(other[i]) - f64::from(centre[i]));
        for i in 0..3 {
            sum[i] += by[i];
            (0..3).for_each(|j| squares[i][j] += by[i] * by[j]);
        }
    }
    let covariance = nalgebra::Matrix3::from_fn(|i, j| squares[i][j] / n - sum[i] * sum[j] / n / n);
    let mut spread = covariance.symmetric_eigenvalues().map(|v| v.max(0.0).sqrt());
    spread.as_mut_slice().sort_unstable_by(f64::total_cmp);
    spread.into()
}

/// Whether voxels with these standard deviations lie along a line, no thicker than a circumference
/// of `thin` metres and so many times longer.
pub(crate) fn is_line(spread: &[f64; 3], thin: f64, ratio: f64) -> bool {
    // A ring has 1/√2 of its radius as standard deviation.
    let radius = thin / std::f64::consts::TAU / RESIDUAL_EDGE;
    let across = radius * std::f64::consts::FRAC_1_SQRT_2 + BLUR;
    spread[1] <= across && spread[2] >= ratio * spread[1].max(BLUR)
}

/// Whether it is flat all around.
fn is_flat(spread: &[f64; 3], n: usize) -> bool {
    n >= MIN_FLAT && spread[0] <= MAX_BUMP && spread[1] >= MIN_WIDE
}
