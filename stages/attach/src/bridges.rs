//! Bridges across gaps in thin curves: of a black hose far from the scanners only every other point
//! returns, so that its voxels fall apart.

use crate::near_voxels::NearVoxels;
use crate::thin::{is_line, spreads_of};
use crate::voxel_graph::Graph;
use contract::RESIDUAL_EDGE;

/// Longest bridge, metres.
const GAP: f64 = 0.08;
/// Distance from the middle of a bridge within which everything must lie along one line, metres.
const AROUND: f64 = 0.16;
/// Least number of voxels that show a line.
const MIN_VOXELS: usize = 5;
/// Least ratio of the spreads along the line and across it.
const MIN_RATIO: f64 = 3.0;
/// Largest number of neighbours of a voxel at an end of a curve.
const MAX_NEIGHBOURS: usize = 4;

/// Pairs of voxels between which a thin curve is interrupted, with the distance between them in
/// hundredths of a voxel's edge. `thin` is the largest circumference of a thin part, metres.
pub(crate) fn bridges(graph: &Graph, thin: f64) -> Vec<(usize, usize, u32)> {
    let mut component = vec![0; graph.len()];
    for (which, members) in graph.components().iter().enumerate() {
        members.iter().for_each(|at| component[*at] = which);
    }
    let mut voxels = NearVoxels::default();
    (0..graph.len()).for_each(|at| voxels.add(graph.voxel(at), at as u32));
    let mut out = Vec::new();
    for at in 0..graph.len() {
        if graph.neighbours(at).count() > MAX_NEIGHBOURS {
            continue;
        }
        let mut nearest: Option<(f64, usize)> = None;
        voxels.around(graph.voxel(at), GAP, |distance, other| {
            let found = (distance, other as usize);
            if component[found.1] != component[at] && nearest.is_none_or(|n| found < n) {
                nearest = Some(found);
            }
        });
        if let Some((distance, other)) = nearest
            && is_on_a_line(graph, &voxels, &component, [at, other], thin)
        {
            out.push((at, other, (100.0 * distance / RESIDUAL_EDGE) as u32));
        }
    }
    out
}

/// Whether all that is near the middle between two voxels lies along one thin line, or all of it
/// that belongs to their two components: mixed pixels may hang beside.
fn is_on_a_line(
    graph: &Graph,
    voxels: &NearVoxels,
    component: &[usize],
    ends: [usize; 2],
    thin: f64,
) -> bool {
    let [a, b] = ends.map(|end| graph.voxel(end));
    let middle = [0, 1, 2].map(|i| (a[i] + b[i]).div_euclid(2));
    let (mut near, mut own) = (Vec::new(), Vec::new());
    voxels.around(middle, AROUND, |_, at| {
        near.push(graph.voxel(at as usize));
        if ends.iter().any(|end| component[*end] == component[at as usize]) {
            own.push(graph.voxel(at as usize));
        }
    });
    [near, own]
        .iter()
        .any(|near| near.len() >= MIN_VOXELS && is_line(&spreads_of(near, middle), thin, MIN_RATIO))
}
