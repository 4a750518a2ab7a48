//! The noise of a region's points, estimated from the points themselves (METHOD.md §3).

use contract::{Fan, View};
use geometry::robust::median;
use nalgebra::{Matrix3, Vector3};

use super::measured::Measured;

/// Noise that is assumed where the points do not tell (shuffled files), metres: a common scanner on
/// dark steel.
const UNKNOWN: f64 = 0.003;
/// Consecutive points nearer than this lie on one surface more often than not, metres.
const NEIGHBOURS: f32 = 0.05;
/// Fewer triples say nothing.
const MIN_TRIPLES: usize = 60;

/// Patches whose flatness is looked at.
struct FlatPatches {
    /// Edge of a patch, metres: a depth camera's bumps are as wide.
    edge: f32,
    /// Fewest points of a patch.
    min_points: usize,
    /// Fewer patches say nothing.
    min_patches: usize,
    /// Share of the patches that are taken for flat things: most scenes have as many.
    flat_share: f64,
}

const PATCHES: FlatPatches =
    FlatPatches { edge: 0.10, min_points: 30, min_patches: 40, flat_share: 0.05 };

/// Standard deviation of the points, metres: from one point to the next, or over a hand's width
/// where that is more, as it is for depth cameras, whose neighbours err alike.
pub(crate) fn of(views: &[&View], points: &[Measured], thin: &[u32], fan: &dyn Fan) -> f64 {
    let beams = between_neighbours(views, fan).unwrap_or(UNKNOWN);
    beams.max(over_patches(points, thin, fan).unwrap_or(0.0))
}

/// Noise along the beams: how far the middle one of three consecutive points lies off the line
/// through the others.
fn between_neighbours(views: &[&View], fan: &dyn Fan) -> Option<f64> {
    let mut off = fan.fan(views.to_vec(), bends).concat();
    let enough = off.len() >= MIN_TRIPLES;
    median(&mut off).filter(|_| enough).map(|m| 1.4826 * m)
}

/// How far the middle one of three consecutive points of a view lies off, triple by triple, as the
/// noise of one point.
fn bends(view: &View) -> Vec<f64> {
    let scanner = view.scanner.map(|s| s.coords.cast::<f32>());
    let triples = view.points.windows(3).step_by((view.points.len() / 20_000).max(1));
    let bend = |triple: &[[f32; 3]]| {
        let [a, b, c] = [0, 1, 2].map(|i| Vector3::from(triple[i]));
        let along = c - a;
        if along.norm() > 2.0 * NEIGHBOURS || (b - a).norm() > NEIGHBOURS || along.norm() < 1e-4 {
            return None;
        }
        let bend = b - (a + c) * 0.5;
        let d = scanner.map_or_else(|| bend.norm(), |s| bend.dot(&(b - s).normalize()).abs());
        // Three ranges with equal noise: the deviation has √1.5 of it.
        Some(f64::from(d) / 1.5_f64.sqrt())
    };
    triples.filter_map(bend).collect()
}

/// How far the points of the flattest patches, one view's each, lie off their planes.
fn over_patches(points: &[Measured], thin: &[u32], fan: &dyn Fan) -> Option<f64> {
    let view = |i: &u32| points[*i as usize].view;
    let of_views = thin.chunk_by(|a, b| view(a) == view(b)).collect();
    let mut off = fan.fan(of_views, |own| patches_of(points, own)).concat();
    if off.len() < PATCHES.min_patches {
        return None;
    }
    off.sort_by(f64::total_cmp);
    Some(off[(off.len() as f64 * PATCHES.flat_share) as usize])
}

/// How far points lie off their planes, patch by patch.
fn patches_of(points: &[Measured], own: &[u32]) -> Vec<f64> {
    let cell = |i: &u32| points[*i as usize].p.map(|v| (v / PATCHES.edge).floor() as i32);
    let mut order = own.to_vec();
    order.sort_by_cached_key(cell);
    let patches =
        order.chunk_by(|a, b| cell(a) == cell(b)).filter(|p| p.len() >= PATCHES.min_points);
    patches.filter_map(|patch| thickness(points, patch)).collect()
}

/// RMS distance of points from their plane; `None` where they lie along a line.
fn thickness(points: &[Measured], patch: &[u32]) -> Option<f64> {
    let at = |i: &u32| Vector3::from(points[*i as usize].p.map(f64::from));
    let mean = patch.iter().map(at).sum::<Vector3<f64>>() / patch.len() as f64;
    let spread: Matrix3<f64> =
        patch.iter().map(|i| (at(i) - mean) * (at(i) - mean).transpose()).sum();
    let mut values: Vec<f64> =
        (spread / patch.len() as f64).symmetric_eigenvalues().iter().map(|v| v.max(0.0)).collect();
    values.sort_by(f64::total_cmp);
    // A strip says nothing of its own width.
    let is_wide = values[1].sqrt() > 0.15 * f64::from(PATCHES.edge);
    is_wide.then(|| values[0].sqrt())
}
