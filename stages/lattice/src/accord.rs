//! The views of a region in; out comes where they contradict each other: missing returns where
//! others measured matter, which prove nothing, and matter where others saw free space, which
//! moved.

use contract::{Fan, View};
use geometry::Eye;
use geometry::depth::{LANES, lanes};
use geometry::narrow::floor_i32;

/// Share of the matter measured by other scans that a scanner must have missed for its missing
/// returns to mean nothing.
const BLIND: f32 = 0.5;
/// Half-width (cells) of the window about such matter in which missing returns mean nothing.
const DOUBT_WINDOW: i32 = 3;
/// Points of each scan that are asked, at most, and of all of them: more scans show the same things
/// again.
const N_ASKED: usize = 100_000;
const N_ASKED_OF_ALL: usize = 600_000;

/// Every how many of a scan's points are asked.
fn step(view: &View, n_views: usize) -> usize {
    (view.points.len() / (N_ASKED_OF_ALL / n_views).clamp(1, N_ASKED)).max(1)
}

/// Lets the views of a region check each other's missing returns: where one scan measured matter,
/// the silence of another is no free space (a scanner behind a near post, black or shiny surfaces).
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

/// Beams that went on so far beyond a point of another scan saw free space there, metres.
const BEYOND: f32 = 0.10;
/// Footprint in which they are asked, metres.
const FOOTPRINT: f32 = 0.03;
/// Points that one thread asks at a time.
const N_AT_A_TIME: usize = 8192;
/// Edge of the cells that contradictions are counted in, metres, and points that make one.
const CELL: f32 = 0.05;
const MIN_IN_CELL: usize = 3;

/// What was here for one scan and gone for another: middles of cells of 5 cm, local frame. Edges
/// and wires make a few, what moved makes many.
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
