//! Things that only a hose leads to and that are too large to hang on it: a column to which a hose
//! is clamped, whose foot no scan sees.

use crate::thin::LocalShape;
use crate::voxel_graph::Graph;
use contract::Voxel;

/// Least number of voxels of such a thing, and least extent along one axis, voxels (40 cm): a valve
/// block or a junction box is smaller.
pub(crate) const LEAST_STRUCTURE: usize = 100;
const LEAST_EXTENT: i32 = 20;

/// For each voxel of a component, whether it belongs to a thing that only hoses lead to, and that
/// is neither on the robot nor near a hand.
pub(crate) fn beyond_hoses(
    graph: &Graph,
    shape: &[LocalShape],
    is_at_robot: impl Fn(usize) -> bool,
) -> Vec<bool> {
    let n = graph.len();
    let is_hose = |k: usize| shape[k] == LocalShape::Hose;
    let mut is_taken: Vec<bool> = (0..n).map(is_hose).collect();
    let mut out = vec![false; n];
    for first in 0..n {
        if std::mem::replace(&mut is_taken[first], true) {
            continue;
        }
        let mut part = vec![first];
        let mut next = 0;
        while let Some(&k) = part.get(next) {
            next += 1;
            for (other, _) in graph.neighbours(k) {
                if !std::mem::replace(&mut is_taken[other], true) {
                    part.push(other);
                }
            }
        }
        let places: Vec<Voxel> = part.iter().map(|k| graph.voxel(*k)).collect();
        if is_large(&places) && !part.iter().any(|k| is_at_robot(*k)) {
            part.iter().for_each(|k| out[*k] = true);
        }
    }
    out
}

fn is_large(voxels: &[Voxel]) -> bool {
    let extent = |i: usize| {
        let along = || voxels.iter().map(|v| v[i]);
        along().max().unwrap_or(0) - along().min().unwrap_or(0)
    };
    voxels.len() >= LEAST_STRUCTURE && (0..3).any(|i| extent(i) >= LEAST_EXTENT)
}
