//! Layers of voxels behind a cut, from which the shape of what follows is read.

use crate::voxel_graph::Graph;

/// Number of layers of voxels behind a tip that show that the body is wider there: 6 cm.
pub(crate) const N_LAYERS: usize = 3;
/// Number of layers of voxels behind a cut that may be a part of the tool: 6 cm.
pub(crate) const N_BESIDE: usize = 3;
/// Number of layers of voxels behind a cut in which the end of a tool is looked for: the length of
/// a finger, 10 cm, and that of a thin neck, 40 cm.
pub(crate) const N_FOLLOWED: usize = 5;
pub(crate) const N_FOLLOWED_NECK: usize = 20;
/// Largest number of voxels in a layer of a thin neck, of 6 cm.
pub(crate) const THIN_NECK: usize = 12;

/// The voxels behind a cut in layers, the nearest first.
pub(crate) fn layers_behind(graph: &Graph, side: &[bool]) -> Vec<Vec<usize>> {
    let mut is_seen = side.to_vec();
    let mut layer: Vec<usize> = (0..side.len()).filter(|k| side[*k]).collect();
    let next = |_| {
        let mut next = Vec::new();
        for k in &layer {
            for (other, _) in graph.neighbours(*k) {
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
