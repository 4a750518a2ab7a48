//! Fits the comb of elevations to the columns about an axis, and tests it against chance.

use crate::axis::{AxisLine, side};
use crate::height::Height;
use crate::planes::PlanarRun;
use crate::refine::{CombPoint, ScannerFit};
use crate::setup::{Setup, SetupEvidence};
use crate::tune;
use geometry::{Pose, Vector};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Clearness from which on a comb is no chance. For independent phases its probability to exceed
/// `z` is at most `16 exp(-0.96 z)`, whatever the lengths of the phasors: the bound of Chernoff in
/// each of 16 directions, with `I0(x) <= exp(x²/4)`. Trials: 10⁵ axes, 2000 heights and 1000 steps
/// that differ, 12 parts of the step and 2 ways to count sides are 5·10¹², or exp(29.2); one wrong
/// setup in a million clouds takes exp(13.8) more.
pub(crate) const CLEAR: f64 = 48.0;
/// Edge of the cells of direction of which the phases count as independent, radians (6°). Phases
/// seen from another place turn several times within a cell.
const CELL: f64 = 0.105;
/// Fewest points of a cell.
const IN_CELL: usize = 8;
/// Largest number of runs, and of points of each, in the least squares.
const MOST: (usize, usize) = (200, 64);
/// Rounds of least squares.
const ROUNDS: usize = 4;
/// Number of further passes where the comb is not plain.
const AGAIN: usize = 2;
/// Coherence from which on the other way to count sides is not tried.
const PLAIN: f64 = 0.8;

/// Factor on standard deviations for errors that columns and elevations share. Without it 95 % of
/// the errors of 744 drawn setups lay within 2.7 to 3.0 deviations instead of 2.0.
const UNMODELLED: f64 = 1.5;

/// How the sides of the axis are told apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sides {
    /// Elevations are counted from the side on which most points of a run lie.
    Front,
    /// Elevations rise along the file: columns that go on beyond the zenith come down as their
    /// other side.
    Rising,
}

/// A setup on an axis, if its comb is clear; else `None`.
pub(crate) fn certified(
    runs: &[PlanarRun],
    line: &AxisLine,
    height: Height,
    origin: &Vector,
) -> Option<Setup> {
    let every = line.runs.len().div_ceil(MOST.0).max(1);
    let own: Vec<&PlanarRun> = line.runs.iter().step_by(every).map(|i| &runs[*i]).collect();
    let start = start(line, height);
    let front = with_sides(&own, start, Sides::Front, origin);
    let is_plain = |setup: &Setup| setup.evidence.coherence > PLAIN;
    let rising = match &front {
        Some(setup) if is_plain(setup) => None,
        _ => with_sides(&own, start, Sides::Rising, origin),
    };
    let clearer = |a: &Setup, b: &Setup| a.evidence.clearness >= b.evidence.clearness;
    let found = match (front, rising) {
        (Some(a), Some(b)) => Some(if clearer(&a, &b) { a } else { b }),
        (a, b) => a.or(b),
    };
    let mut found = found.filter(|setup| setup.evidence.clearness > CLEAR)?;
    found.evidence.n_planes = line.runs.len();
    Some(found)
}

fn start(line: &AxisLine, height: Height) -> ScannerFit {
    let x = side(&line.along);
    let turn = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[
        x,
        line.along.cross(&x),
        line.along,
    ]));
    let at = line.at + line.along * height.s;
    let turn = UnitQuaternion::from_rotation_matrix(&turn);
    ScannerFit { pose: Pose::from_parts(at.into(), turn), step: height.step }
}

fn with_sides(
    runs: &[&PlanarRun],
    start: ScannerFit,
    sides: Sides,
    origin: &Vector,
) -> Option<Setup> {
    let points = points(runs, &start, sides);
    let tuned = tune::tuned(&points, start);
    let mut found = fitted(&points, tuned, sides, origin)?;
    for _ in 0..AGAIN {
        if found.1.evidence.coherence > PLAIN {
            break;
        }
        // A better axis lets longer stretches tell.
        let Some(next) = fitted(&points, tune::tuned(&points, found.0), sides, origin) else {
            break;
        };
        if next.1.evidence.clearness > found.1.evidence.clearness {
            found = next;
        }
    }
    Some(found.1)
}

/// The setup by least squares from a tuned start, with the fit in the frame of the search.
fn fitted(
    points: &[CombPoint],
    start: ScannerFit,
    sides: Sides,
    origin: &Vector,
) -> Option<(ScannerFit, Setup)> {
    // First each column has a phase of its own, so that a wrong step does no harm.
    let mut fit = start;
    for _ in 0..ROUNDS {
        fit = fit.improved(&in_columns(points, &fit))?.0;
    }
    // Then all of them share one.
    let (step, phase) = shared_phase(points, &fit)?;
    fit.step = step;
    let mut comb = [phase, step];
    let mut rows = Vec::new();
    let mut last = None;
    for _ in 0..ROUNDS {
        rows = on_comb(points, &fit, comb);
        let (next, normal) = fit.improved(&rows)?;
        last = Some((fit, normal));
        fit = next;
        comb = [phase_of(&rows, &fit, comb[0]), fit.step];
    }
    let (before, normal) = last?;
    let (angle_sigmas, covariance) = (normal.sigmas, normal.position_covariance(&before, &rows)?);
    let evidence = evidence(&rows, &fit, comb, angle_sigmas);
    let mut pose = fit.pose;
    pose.translation.vector += origin;
    // Points that were counted to the wrong row pull, and their pulls are not independent.
    let doubt = UNMODELLED / evidence.coherence.max(0.1).powi(2);
    let sigma = [0, 1, 2].map(|i| covariance[(i, i)].max(0.0).sqrt() * doubt);
    let by_direction = sides == Sides::Rising;
    let world_from_scanner = pose;
    let setup = Setup { world_from_scanner, sigma, comb, col_step: None, by_direction, evidence };
    Some((fit, setup))
}

/// The points of the runs, each with its side.
fn points(runs: &[&PlanarRun], fit: &ScannerFit, sides: Sides) -> Vec<CombPoint> {
    let mut out = Vec::new();
    for (run, planar) in runs.iter().enumerate() {
        let along = direction(planar, fit, sides);
        let every = planar.points.len().div_ceil(MOST.1).max(1);
        out.extend(planar.points.iter().enumerate().step_by(every).map(|(order, at)| {
            let p = fit.local(at);
            let side = if p.x * along[0] + p.y * along[1] < 0.0 { -1.0 } else { 1.0 };
            let (run, order) = (run as u32, order as u32);
            CombPoint { at: *at, run, order, phase: run, side, row: 0.0 }
        }));
    }
    out
}

/// The points with their rows on combs of their own columns.
fn in_columns(points: &[CombPoint], fit: &ScannerFit) -> Vec<CombPoint> {
    let own = points.chunk_by(|a, b| a.run == b.run).flat_map(|column| {
        let phase = phase_of(column, fit, 0.0);
        let row = move |p: &CombPoint| ((fit.elevation(&p.at, p.side) - phase) / fit.step).round();
        column.iter().map(move |p| CombPoint { row: row(p), ..*p })
    });
    own.collect()
}

/// The direction about the axis in which the elevations of a run count from the horizon up.
fn direction(run: &PlanarRun, fit: &ScannerFit, sides: Sides) -> [f64; 2] {
    let center = fit.local(&run.center);
    let far = run
        .points
        .iter()
        .map(|p| fit.local(p))
        .max_by(|a, b| a.x.hypot(a.y).total_cmp(&b.x.hypot(b.y)));
    let mut along = far.map_or([1.0, 0.0], |p| [p.x, p.y]);
    let flips = match sides {
        Sides::Front => center.x * along[0] + center.y * along[1] < 0.0,
        Sides::Rising => {
            let signed = |p: &Vector| {
                let p = fit.local(p);
                p.z.atan2((p.x * along[0] + p.y * along[1]).signum() * p.x.hypot(p.y))
            };
            let all: Vec<f64> = run.points.iter().map(signed).collect();
            all.windows(2).map(|w| (w[1] - w[0]).signum()).sum::<f64>() < 0.0
        }
    };
    if flips {
        along = along.map(|v| -v);
    }
    along
}

/// The step near that of a fit, or a whole part of it, at which the elevations of all runs share a
/// phase the best, and that phase, radians.
fn shared_phase(points: &[CombPoint], fit: &ScannerFit) -> Option<(f64, f64)> {
    /// Largest number of points that are looked at.
    const LOOKED: usize = 3_000;
    /// Largest relative difference of the step, and the most cycles that two trials may differ by
    /// over all elevations.
    const REACH: (f64, f64) = (1e-3, 0.15);
    /// Largest divisor of the step: every so manieth point may be kept.
    const PARTS: u32 = 12;
    /// By how much a finer step must be clearer.
    const CLEARER: f64 = 1.5;
    /// Coherence from which on no finer step is tried.
    const ENOUGH: f64 = 0.6;
    let every = points.len().div_ceil(LOOKED).max(1);
    let all: Vec<f64> =
        points.iter().step_by(every).map(|p| fit.elevation(&p.at, p.side)).collect();
    let (low, high) =
        all.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |m, v| (m.0.min(*v), m.1.max(*v)));
    let mut best: Option<(f64, f64, f64)> = None;
    for part in 1..=PARTS {
        let apart = REACH.1 / (high - low).max(fit.step);
        let about = f64::from(part) / fit.step;
        let n = (REACH.0 * about / apart).ceil().min(400.0);
        let (length, f) = clearest(&all, about - n * apart, apart, 2 * n as usize + 1);
        if best.is_none_or(|b| length > CLEARER * b.0) {
            let sum = phasor(&all, f);
            best = Some((length, 1.0 / f, sum[1].atan2(sum[0]) / TAU / f));
        }
        if best.is_some_and(|b| b.0 > ENOUGH) {
            break;
        }
    }
    best.map(|(_, step, phase)| (step, phase))
}

/// Sum of the phasors of angles at a frequency.
fn phasor(angles: &[f64], f: f64) -> [f64; 2] {
    angles.iter().fold([0.0, 0.0], |s, e| {
        let (sin, cos) = (TAU * e * f).sin_cos();
        [s[0] + cos, s[1] + sin]
    })
}

/// The greatest length of the mean phasor at `n` frequencies from `first` on, and its frequency.
/// Phasors are turned from one frequency to the next, without a sine or cosine.
fn clearest(angles: &[f64], first: f64, apart: f64, n: usize) -> (f64, f64) {
    let at = |f: f64| -> Vec<[f64; 2]> {
        angles.iter().map(|e| <[f64; 2]>::from((TAU * e * f).sin_cos())).collect()
    };
    let (mut now, turn) = (at(first), at(apart));
    let mut best = (0.0, first);
    for i in 0..n {
        let sum = now.iter().fold([0.0, 0.0], |s, p| [s[0] + p[0], s[1] + p[1]]);
        let length = sum[0].hypot(sum[1]) / angles.len() as f64;
        if length > best.0 {
            best = (length, first + apart * i as f64);
        }
        for ([sin, cos], [s, c]) in now.iter_mut().zip(&turn) {
            (*sin, *cos) = (*sin * c + *cos * s, *cos * c - *sin * s);
        }
    }
    best
}

/// The points with their rows on one comb, as one group.
fn on_comb(points: &[CombPoint], fit: &ScannerFit, comb: [f64; 2]) -> Vec<CombPoint> {
    let row = |p: &CombPoint| ((fit.elevation(&p.at, p.side) - comb[0]) / comb[1]).round();
    points.iter().map(|p| CombPoint { phase: 0, row: row(p), ..*p }).collect()
}

/// The phase of the comb at this fit, by the mean of the phasors.
fn phase_of(points: &[CombPoint], fit: &ScannerFit, near: f64) -> f64 {
    let sum = points.iter().fold([0.0, 0.0], |s, p| {
        let (sin, cos) = (TAU * (fit.elevation(&p.at, p.side) - near) / fit.step).sin_cos();
        [s[0] + cos, s[1] + sin]
    });
    near + sum[1].atan2(sum[0]) / TAU * fit.step
}

/// How clear the comb is, over cells of direction.
fn evidence(
    points: &[CombPoint],
    fit: &ScannerFit,
    comb: [f64; 2],
    angle_sigmas: [f64; 2],
) -> SetupEvidence {
    let mut cells: BTreeMap<(i64, i64), (usize, [f64; 2])> = BTreeMap::new();
    let mut all = [0.0, 0.0];
    for point in points {
        let e = fit.elevation(&point.at, point.side);
        let (sin, cos) = (TAU * (e - comb[0]) / comb[1]).sin_cos();
        all = [all[0] + cos, all[1] + sin];
        let p = fit.local(&point.at);
        let rise = p.z.atan2(p.x.hypot(p.y));
        // Cells are as wide near the zenith as at the horizon.
        let azimuth = p.y.atan2(p.x) * rise.cos();
        let cell = ((azimuth / CELL).floor() as i64, (rise / CELL).floor() as i64);
        let sum = cells.entry(cell).or_insert((0, [0.0, 0.0]));
        *sum = (sum.0 + 1, [sum.1[0] + cos, sum.1[1] + sin]);
    }
    let phasors: Vec<[f64; 2]> = cells
        .values()
        .filter(|c| c.0 >= IN_CELL)
        .map(|(n, sum)| sum.map(|v| v / *n as f64))
        .collect();
    let sum = phasors.iter().fold([0.0, 0.0], |s, p| [s[0] + p[0], s[1] + p[1]]);
    let power: f64 = phasors.iter().map(|p| p[0] * p[0] + p[1] * p[1]).sum();
    SetupEvidence {
        n_planes: 0,
        n_points: points.len(),
        coherence: all[0].hypot(all[1]) / points.len().max(1) as f64,
        n_cells: phasors.len(),
        clearness: if power > 0.0 { (sum[0] * sum[0] + sum[1] * sum[1]) / power } else { 0.0 },
        elevation_sigma: angle_sigmas[0],
        azimuth_sigma: angle_sigmas[1],
    }
}
