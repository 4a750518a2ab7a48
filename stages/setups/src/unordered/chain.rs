//! From a candidate on the floor to a certified scanner: azimuths on the floor, height, elevations,
//! and all points round it.

use super::floor::FloorPoints;
use super::foot::{self, RING};
use super::judge;
use super::owners;
use super::raster::{RasterEvidence, RasterSetup};
use super::solve::{
    CombComparison, RasterFit, coherence, deviations, improved, position_covariance, single,
};
use super::votes::FootVote;
use geometry::{Pose, Vector};
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, TAU};

/// Numbers of points of the floor with which candidates are tried, and refined.
const GLANCE: usize = 16_000;
const REFINED: usize = 40_000;
/// Number of points with which heights are tried.
const FOR_HEIGHT: usize = 25_000;
/// Least clearness of azimuths at a glance, and with all points: right places had 77 to 1700 with
/// these, wrong ones up to 22. Chance alone never comes near.
const GLANCED: f64 = 7.0;
const CLEAR_FLOOR: f64 = 20.0;
/// Least coherence of azimuths and of elevations on the floor: right places had 0.14 and 0.33 or
/// more, wrong ones up to 0.023 and 0.1.
const COHERENT: [f64; 2] = [0.1, 0.3];
/// Greatest angle between the axis and the normal of the floor, radians.
const MOST_LEAN: f64 = 0.35;
/// Largest step of a raster, radians.
const MOST_STEP: f64 = 0.02;
/// Largest distance of a point that is compared all round, metres.
const FAR: f64 = 15.0;
/// Cells of direction over which phases are free, from step to step, radians.
const AZIMUTH_CELLS: [[f64; 2]; 4] = [[0.08, 0.08], [0.2, 0.2], [0.6, 2.0], [1.6, 2.0]];
const ELEVATION_CELLS: [[f64; 2]; 5] =
    [[0.05, 0.1], [0.1, 0.2], [0.3, 0.4], [1.0, 2.0], [7.0, 7.0]];
const ALL_CELLS: [[f64; 2]; 3] = [[0.1, 0.1], [0.3, 0.3], SHARED];
/// Elevations share one phase; azimuths do on either side of where a scan begins and ends.
const SHARED: [f64; 2] = [0.4, 7.0];
/// Cut-offs of residuals, steps: while a place is looked for, and when it is known.
const WIDE: f64 = 0.35;
const NARROW: f64 = 0.2;
/// Rounds of least squares with one size of cells.
const ROUNDS: usize = 15;
/// Greatest deviation from a column with which a point counts as in it, steps.
const IN_COLUMN: f64 = 0.12;
/// Factor on standard deviations for errors that columns and rows share.
const UNMODELLED: f64 = 1.5;

/// At most so many points of a cloud in the frame of its floor, evenly chosen.
pub(crate) fn all_round(floor: &FloorPoints, points: &[[f32; 3]], n: usize) -> Vec<[f64; 3]> {
    let every = points.len().div_ceil(n).max(1);
    let floor_from_points = floor.pose.inverse();
    let local = |p: &[f32; 3]| {
        let p = floor_from_points * geometry::Point::from(p.map(f64::from));
        p.coords.into()
    };
    points.iter().step_by(every).map(local).collect()
}

/// The scanner at a candidate, if its combs are clear; else `None`.
pub(crate) fn certified(
    floor: &FloorPoints,
    candidate: &FootVote,
    all_round: &[[f64; 3]],
) -> Option<RasterSetup> {
    let ring = [0.8 * RING[0], RING[1] + 0.1];
    let few = floor.near(candidate.at, ring, GLANCE);
    let glance = foot::place(&few, candidate.at, 3, 0.008);
    if glance.comb.z < GLANCED {
        return None;
    }
    let points = floor.near(glance.at, ring, REFINED);
    let place = foot::place(&points, glance.at, 1, 0.004);
    if place.comb.z < CLEAR_FLOOR {
        return None;
    }
    let fit = in_plan(place, &points);
    let columns = in_columns(&fit.0, &points, IN_COLUMN);
    let every = columns.len().div_ceil(FOR_HEIGHT).max(1);
    let few: Vec<[f64; 3]> = columns.iter().step_by(every).copied().collect();
    let at = [fit.0.pose.translation.x, fit.0.pose.translation.y];
    let heights = foot::heights(&few, at).into_iter().map(|(height, comb)| {
        let mut next = fit.0;
        next.pose.translation.vector.z = height;
        next.steps[1] = comb.step;
        above(next, &columns)
    });
    let best = heights.max_by(|a, b| a.1.total_cmp(&b.1))?;
    let coherence = [fit.1, best.1];
    let is_plain = |fit: &RasterFit| {
        let lean = (fit.pose.rotation * Vector::z()).z.clamp(-1.0, 1.0).acos();
        lean < MOST_LEAN && fit.steps.iter().all(|s| *s > 1e-4 && *s < MOST_STEP)
    };
    if coherence[0] < COHERENT[0] || coherence[1] < COHERENT[1] || !is_plain(&best.0) {
        return None;
    }
    let fit = round_about(best.0, &points, all_round);
    let setup = judged(floor, fit, all_round, place.comb.z, coherence)?;
    is_plain(&fit).then_some(setup)
}

/// The place in the plan by the azimuths of the floor, with their coherence.
fn in_plan(place: foot::FootPeak, points: &[[f64; 3]]) -> (RasterFit, f64) {
    let pose = Pose::translation(place.at[0], place.at[1], 1.0);
    let mut fit = RasterFit { pose, steps: [place.comb.step; 2] };
    let mut coherence = 0.0;
    for cell in AZIMUTH_CELLS {
        let how = CombComparison { cell, cut: WIDE, uses: [true, false] };
        let (next, clear) = improved(fit, points, &how, |_| single([0, 1, 5]), ROUNDS);
        (fit, coherence) = (next, clear[0]);
    }
    (fit, coherence)
}

/// Height and lean by the elevations of the points in the columns, with their coherence.
fn above(mut fit: RasterFit, columns: &[[f64; 3]]) -> (RasterFit, f64) {
    let mut coherence = 0.0;
    for cell in ELEVATION_CELLS {
        let how = CombComparison { cell, cut: WIDE, uses: [false, true] };
        let along = |fit: &RasterFit| [fit.about_foot().to_vec(), single([6])].concat();
        let (next, clear) = improved(fit, columns, &how, along, ROUNDS);
        (fit, coherence) = (next, clear[1]);
    }
    (fit, coherence)
}

/// All unknowns by the points of the floor, then by those all round.
fn round_about(mut fit: RasterFit, floor: &[[f64; 3]], all_round: &[[f64; 3]]) -> RasterFit {
    let everything = |_: &RasterFit| single([0, 1, 2, 3, 4, 5, 6]);
    for cell in ALL_CELLS {
        let how = CombComparison { cell, cut: WIDE, uses: [true; 2] };
        fit = improved(fit, floor, &how, everything, ROUNDS).0;
    }
    fit = with_whole_steps(fit, floor);
    for cell in [[0.15, 0.15], SHARED] {
        let near = on_raster(&fit, all_round, cell, 2.0 * NARROW);
        let how = CombComparison { cell, cut: WIDE, uses: [true; 2] };
        fit = improved(fit, &near, &how, everything, ROUNDS).0;
    }
    let cut = cut(&fit, all_round);
    let near = on_raster(&fit, all_round, SHARED, cut);
    let how = CombComparison { cell: SHARED, cut: 1.2 * cut, uses: [true; 2] };
    improved(fit, &near, &how, everything, ROUNDS).0
}

/// The fit with the steps of which those that were found may be parts: angles that lie on every
/// other tooth only lie on a comb of twice the step, too, and more closely.
fn with_whole_steps(mut fit: RasterFit, points: &[[f64; 3]]) -> RasterFit {
    /// Cells in which phases are free, radians.
    const CELL: [f64; 2] = [0.2, 0.2];
    /// Parts of a step that are tried, one after the other.
    const PARTS: [f64; 3] = [2.0, 2.0, 3.0];
    let how = CombComparison { cell: CELL, cut: WIDE, uses: [true; 2] };
    for (kind, part) in (0..2).flat_map(|kind| PARTS.map(|part| (kind, part))) {
        let mut whole = fit;
        whole.steps[kind] *= part;
        let [own, other] = [fit, whole].map(|fit| coherence(&fit, points, &how)[kind]);
        if whole.steps[kind] < MOST_STEP && other >= own {
            fit = whole;
        }
    }
    fit
}

/// The narrowest cut-off within which nearly all own points lie, steps: the fewer points of others,
/// which pull together, lie within it.
fn cut(fit: &RasterFit, all_round: &[[f64; 3]]) -> f64 {
    /// Cut-offs that are tried, and the share of the own points that must lie within.
    const TRIED: [f64; 4] = [0.06, 0.09, 0.13, NARROW];
    const NEARLY_ALL: f64 = 0.9;
    let near: Vec<[f64; 3]> = all_round.iter().filter(|p| is_within(fit, p)).copied().collect();
    let own = TRIED.map(|cut| {
        let n = kept(fit, &near, SHARED, [cut; 2]).len() as f64;
        let by_chance = (2.0 * cut).powi(2);
        (n - by_chance * near.len() as f64) / (1.0 - by_chance)
    });
    let is_enough = |i: &usize| own[*i] >= NEARLY_ALL * own[3];
    TRIED[(0..4).find(is_enough).unwrap_or(3)]
}

/// The setup with its deviations and the evidence all round.
fn judged(
    floor: &FloorPoints,
    fit: RasterFit,
    all_round: &[[f64; 3]],
    floor_clearness: f64,
    coherence: [f64; 2],
) -> Option<RasterSetup> {
    let near: Vec<[f64; 3]> = all_round.iter().filter(|p| is_within(&fit, p)).copied().collect();
    let judged = judge::judge(&fit, &near);
    if judged.clearness.iter().any(|c| *c < judge::CLEAR) {
        return None;
    }
    let cut = cut(&fit, all_round);
    let within = |cut: f64| {
        let how = CombComparison { cell: SHARED, cut: 1.2 * cut, uses: [true; 2] };
        (on_raster(&fit, all_round, SHARED, cut), how)
    };
    let (own, how) = within(cut);
    let covariance = position_covariance(&fit, &own, &how).or_else(|| {
        let (own, how) = within(NARROW);
        position_covariance(&fit, &own, &how)
    })?;
    let turn = floor.pose.rotation.to_rotation_matrix();
    let covariance = turn * covariance * turn.inverse();
    let n_cells = judged.n_cells;
    let sigma = [0, 1, 2].map(|i| covariance[(i, i)].max(0.0).sqrt() * UNMODELLED);
    let angle_sigmas = deviations(&fit, &own, &how);
    let owners::RasterPoints { raster, share, beside } =
        owners::of_points(&fit, all_round, angle_sigmas);
    let clearness = judged.clearness;
    let evidence = RasterEvidence {
        floor_clearness,
        coherence,
        clearness,
        n_cells,
        share,
        beside,
        angle_sigmas,
    };
    let world_from_scanner = floor.pose * fit.pose;
    let (raster, steps) = (Some(raster), fit.steps);
    Some(RasterSetup { world_from_scanner, sigma, steps, raster, evidence })
}

fn is_within(fit: &RasterFit, p: &[f64; 3]) -> bool {
    (Vector::from(*p) - fit.pose.translation.vector).norm() < FAR
}

/// Points in the columns of a fit on the floor.
fn in_columns(fit: &RasterFit, points: &[[f64; 3]], within: f64) -> Vec<[f64; 3]> {
    kept(fit, points, [0.3, 2.0], [within, 1.0])
}

/// Points near both combs of a fit.
fn on_raster(fit: &RasterFit, points: &[[f64; 3]], cell: [f64; 2], within: f64) -> Vec<[f64; 3]> {
    let near: Vec<[f64; 3]> = points.iter().filter(|p| is_within(fit, p)).copied().collect();
    kept(fit, &near, cell, [within; 2])
}

/// Points whose azimuth and elevation lie within so many steps of combs, of which each cell of
/// direction has its own phase.
fn kept(fit: &RasterFit, points: &[[f64; 3]], cell: [f64; 2], within: [f64; 2]) -> Vec<[f64; 3]> {
    let key = |azimuth: f64, elevation: f64| {
        ((azimuth / cell[0]).floor() as i64, (elevation / cell[1]).floor() as i64)
    };
    let mut phases: BTreeMap<(i64, i64), [[f64; 2]; 2]> = BTreeMap::new();
    let seen: Vec<Option<[f64; 2]>> =
        points.iter().map(|p| fit.see(p).map(|a| [a.azimuth, a.elevation])).collect();
    for [azimuth, elevation] in seen.iter().flatten() {
        if elevation.abs() > FRAC_PI_2 - 0.2 {
            continue;
        }
        let sums = phases.entry(key(*azimuth, *elevation)).or_default();
        for (sum, angle) in sums.iter_mut().zip([azimuth / fit.steps[0], elevation / fit.steps[1]])
        {
            let (sin, cos) = (TAU * angle).sin_cos();
            *sum = [sum[0] + cos, sum[1] + sin];
        }
    }
    let is_on = |[azimuth, elevation]: &[f64; 2]| {
        let Some(sums) = phases.get(&key(*azimuth, *elevation)) else { return false };
        let cycles = [azimuth / fit.steps[0], elevation / fit.steps[1]];
        (0..2).all(|kind| {
            let off = cycles[kind] - sums[kind][1].atan2(sums[kind][0]) / TAU;
            (off - off.round()).abs() <= within[kind]
        })
    };
    let all = points.iter().zip(&seen);
    all.filter(|(_, seen)| seen.as_ref().is_some_and(is_on)).map(|(p, _)| *p).collect()
}
