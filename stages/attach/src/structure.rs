//! Things that only a hose leads to and that are too large to hang on it: a column to which a hose
//! is clamped, whose foot no scan sees.

use crate::thin::{LocalShape, reached};
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
    let mut out = vec![false; graph.len()];
    for part in parts(graph, |k| shape[k] != LocalShape::Hose) {
        let places: Vec<Voxel> = part.iter().map(|k| graph.voxel(*k)).collect();
        if is_large(&places) && !part.iter().any(|k| is_at_robot(*k)) {
            part.iter().for_each(|k| out[*k] = true);
        }
    }
    out
}

/// The connected parts of some voxels of a graph.
pub(crate) fn parts(graph: &Graph, is_in: impl Fn(usize) -> bool) -> Vec<Vec<usize>> {
    let mut is_left: Vec<bool> = (0..graph.len()).map(is_in).collect();
    let mut out = Vec::new();
    for first in 0..graph.len() {
        if is_left[first] {
            out.push(reached(graph, vec![first], &mut is_left));
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
