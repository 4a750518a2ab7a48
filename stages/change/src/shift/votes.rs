//! Shifts for which many pairs of surfels of two sessions vote: one of each that face the same way
//! may be the same piece of the thing.

use super::surfels::ThingSurfel;
use geometry::Vector;

/// Edge of a cell of shifts, metres: about as far as surfels of the search lie apart.
const CELL: f64 = 0.08;
/// Least cosine of the normals of surfels that vote (25°).
const SAME_WAY: f64 = 0.9;
/// Shifts that are returned.
const N_SHIFTS: usize = 12;

/// The shifts, metres, of an earlier side (turned already) onto the later one with most votes, in
/// descending order; none raises the thing by more than `raised` metres.
pub(super) fn steps_by_votes(
    then: &[ThingSurfel],
    now: &[ThingSurfel],
    raised: f64,
) -> Vec<Vector> {
    let mut votes: Vec<[i32; 3]> = Vec::new();
    for (a, b) in then.iter().flat_map(|a| now.iter().map(move |b| (a, b))) {
        let step = b.at - a.at;
        if step.z.abs() <= raised && a.normal.dot(&b.normal) >= SAME_WAY {
            votes.push([0, 1, 2].map(|i| (step[i] / CELL).round() as i32));
        }
    }
    votes.sort_unstable();
    let mut cells: Vec<(usize, [i32; 3])> =
        votes.chunk_by(|a, b| a == b).map(|same| (same.len(), same[0])).collect();
    cells.sort_by_key(|(n, cell)| (std::cmp::Reverse(*n), *cell));
    let mut out: Vec<[i32; 3]> = Vec::new();
    for (_, cell) in cells {
        let is_near = |c: &[i32; 3]| (0..3).all(|i| (c[i] - cell[i]).abs() <= 1);
        if out.len() < N_SHIFTS && !out.iter().any(is_near) {
            out.push(cell);
        }
    }
    out.into_iter().map(|cell| Vector::from(cell.map(f64::from)) * CELL).collect()
}
