//! Finds where the views of a region contradict each other: missing returns where another scan
//! measured a surface prove no free space, and a surface in what another scan saw as free has
//! moved between the scans.

use contract::{Fan, View};
use geometry::Eye;
use geometry::depth::{LANES, lanes};
use geometry::narrow::floor_i32;

/// Share of the surfaces measured by other scans that a scanner must have missed for none of its
/// missing returns to count.
const BLIND: f32 = 0.5;
/// Half-width of the window about such a surface in which missing returns do not count, cells.
const DOUBT_WINDOW: i32 = 3;
/// Largest number of points of a scan that are tested; more show the same surfaces again.
const N_ASKED: usize = 100_000;
/// Largest number of points of all scans together that are tested.
const N_ASKED_OF_ALL: usize = 600_000;

/// Distance between the points of a scan that are tested.
fn step(view: &View, n_views: usize) -> usize {
    (view.points.len() / (N_ASKED_OF_ALL / n_views).clamp(1, N_ASKED)).max(1)
}

/// Compares the views of a region: where one scan measured a surface, a missing return of another
/// is no evidence of free space (a scanner behind a near post, black or shiny surfaces).
pub fn agree(views: &mut [View], fan: &dyn Fan) {
    let n = views.len();
    let asked = |view: &View| view.points.iter().step_by(step(view, n)).copied().collect();
    let matter: Vec<Vec<[f32; 3]>> = views.iter().map(asked).collect();
    let doubt = |(own, view): (usize, &mut View)| {
        for image in &mut view.images {
            let others = matter.iter().enumerate().filter(|(other, _)| *other != own);
            image.doubt(others.map(|(_, points)| points.as_slice()), DOUBT_WINDOW, BLIND);
        }
    };
    fan.fan(views.iter_mut().enumerate().collect(), doubt);
}

/// Distance that a beam must pass a point of another scan to prove that place free, metres.
const BEYOND: f32 = 0.10;
/// Width of the depth image cells in which beams are looked up, metres.
const FOOTPRINT: f32 = 0.03;
/// Number of points that one thread tests at a time.
const N_AT_A_TIME: usize = 8192;
/// Edge of the cells in which contradictions are counted, metres.
const CELL: f32 = 0.05;
/// Number of contradicting points from which on a cell counts.
const MIN_IN_CELL: usize = 3;

/// Centres of 5 cm cells (local frame, metres) in which one scan measured a surface and another saw
/// free space. Edges and wires give a few such cells, a thing that moved gives many.
#[must_use]
pub fn disagreement(views: &[View], fan: &dyn Fan) -> Vec<[f32; 3]> {
    let eyes: Vec<Eye<'_>> = views.iter().map(|v| Eye::new(&v.images)).collect();
    let parts = views.iter().enumerate().flat_map(|(own, view)| {
        let points = view.points.chunks(N_AT_A_TIME * step(view, views.len()));
        points.map(move |points| (own, points))
    });
    let gone_of = |(own, points): (usize, &[[f32; 3]])| {
        let asked = points.iter().step_by(step(&views[own], views.len())).copied();
        let mut gone = Vec::new();
        for some in asked.collect::<Vec<_>>().chunks(LANES) {
            let local = lanes(some);
            let mut is_gone = [false; LANES];
            let others = eyes.iter().enumerate().filter(|(other, _)| *other != own);
            for looks in others.map(|(_, eye)| eye.look_lanes(&local, FOOTPRINT)) {
                for (i, is_gone) in is_gone.iter_mut().enumerate() {
                    let around = looks.around[i];
                    let is_known = !looks.near[i].is_nan() & around.is_finite();
                    *is_gone |= is_known & (around - looks.range[i] > BEYOND);
                }
            }
            gone.extend(some.iter().zip(is_gone).filter(|(_, is_gone)| *is_gone).map(|(p, _)| *p));
        }
        gone.iter().map(|p| p.map(|v| floor_i32(f64::from(v / CELL)))).collect()
    };
    let found: Vec<Vec<[i32; 3]>> = fan.fan(parts.collect(), gone_of);
    let mut cells: Vec<[i32; 3]> = found.into_iter().flatten().collect();
    cells.sort_unstable();
    let many = cells.chunk_by(|a, b| a == b).filter(|same| same.len() >= MIN_IN_CELL);
    many.map(|same| same[0].map(|i| (i as f32 + 0.5) * CELL)).collect()
}
