//! Finds lines that the planes of many columns share: axes of scanners.

use crate::planes::PlanarRun;
use crate::setup::SetupLimits;
use geometry::Vector;
use nalgebra::{Matrix4, Vector4};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::SplitMix64;

/// A line that may be the axis of a scanner.
#[derive(Debug, Clone)]
pub(crate) struct AxisLine {
    /// A point of it near the columns, metres.
    pub(crate) at: Vector,
    /// Unit direction, upwards (or along the positive axis of the frame nearest to it).
    pub(crate) along: Vector,
    /// Indices of the runs whose planes contain it.
    pub(crate) runs: Vec<usize>,
}

/// Tolerance of the distance between axis and plane, metres: at least and at most, and in
/// deviations of the plane there.
const TOLERANCE: (f64, f64, f64) = (0.004, 0.03, 4.0);
/// Tolerance of the angle between axis and plane, radians: at least and at most.
const ANGLE: (f64, f64) = (0.001, 0.01);
/// Sine of the angle between two planes below which they fix no line.
const ACROSS: f64 = 0.15;
/// Number of directions of planes that are told apart about an axis: bins of 3°.
const N_BINS: usize = 60;
/// Runs of one bin beyond this number count for nothing: many runs on one wall share its plane.
const IN_BIN: u32 = 4;
/// Fewest runs, and fewest directions of their planes, of an axis: two walls meet in a line, too,
/// and so do four with a pillar.
const FEWEST: (usize, usize) = (12, 8);
/// Number of runs that are asked before all of them.
const GLANCE: usize = 200;
/// Distance beyond which a scanner does not stand from its points, metres.
const FAR: f64 = 400.0;

/// The line that most planes share, counted over directions; lines near those of `refused` are left
/// out. `live` are the indices of the runs that count.
pub(crate) fn find(
    runs: &[PlanarRun],
    live: &[usize],
    refused: &[AxisLine],
    seed: u64,
    settings: &SetupLimits,
) -> Option<AxisLine> {
    if live.len() < FEWEST.0 {
        return None;
    }
    let mut random = SplitMix64::seed_from_u64(seed);
    let glance: Vec<usize> =
        live.iter().copied().step_by(live.len().div_ceil(GLANCE).max(1)).collect();
    let mut best: Option<(u32, AxisLine)> = None;
    let mut most_at_a_glance = 0;
    for i in 0..settings.n_pairs {
        let Some((a, b)) = pair(runs, live, i, &mut random) else { continue };
        let Some((at, along)) = crossing(&runs[a], &runs[b]) else { continue };
        if refused.iter().any(|line| is_near(line, &at, &along)) {
            continue;
        }
        // Most pairs are of two scans: a few runs tell.
        let n = score(runs, &glance, &at, &along).1;
        if n * 2 < most_at_a_glance {
            continue;
        }
        most_at_a_glance = most_at_a_glance.max(n);
        let score = score(runs, live, &at, &along).0;
        if best.as_ref().is_none_or(|(most, _)| score > *most) {
            best = Some((score, AxisLine { at, along, runs: Vec::new() }));
        }
    }
    let (_, mut line) = best?;
    for _ in 0..4 {
        line.runs = inliers(runs, live, &line.at, &line.along);
        (line.at, line.along) = fitted(runs, &line)?;
    }
    line.runs = inliers(runs, live, &line.at, &line.along);
    let (_, n_bins) = score(runs, &line.runs, &line.at, &line.along);
    (line.runs.len() >= FEWEST.0 && n_bins >= FEWEST.1).then_some(line)
}

/// Two runs: of one source, and near each other in the file every other time.
fn pair(
    runs: &[PlanarRun],
    live: &[usize],
    i: usize,
    random: &mut SplitMix64,
) -> Option<(usize, usize)> {
    let below = |n: usize, random: &mut SplitMix64| {
        ((random.random::<f64>() * n as f64) as usize).min(n - 1)
    };
    let first = below(live.len(), random);
    let span = live.len() as f64;
    // Distances in the file from one run to all of them, each scale as likely as any other.
    let apart = span.powf(random.random::<f64>()) as usize;
    let second = match i % 4 {
        0 => below(live.len(), random),
        1 => first.checked_sub(apart)?,
        _ => first + apart,
    };
    let (a, b) = (live[first], *live.get(second)?);
    (a != b && runs[a].source == runs[b].source).then_some((a, b))
}

/// The line in which two planes meet, if they fix one near their points.
fn crossing(a: &PlanarRun, b: &PlanarRun) -> Option<(Vector, Vector)> {
    let along = a.normal.cross(&b.normal);
    let sine = along.norm();
    if sine < ACROSS {
        return None;
    }
    let along = oriented(along / sine);
    // The point of the line nearest to the middle between both runs.
    let middle = (a.center + b.center) * 0.5;
    let (da, db) = (a.normal.dot(&(a.center - middle)), b.normal.dot(&(b.center - middle)));
    let cos = a.normal.dot(&b.normal);
    let det = 1.0 - cos * cos;
    let at = middle + a.normal * ((da - cos * db) / det) + b.normal * ((db - cos * da) / det);
    ((at - middle).norm() < FAR).then_some((at, along))
}

fn oriented(along: Vector) -> Vector {
    if along[along.iamax()] < 0.0 { -along } else { along }
}

fn is_near(line: &AxisLine, at: &Vector, along: &Vector) -> bool {
    let apart = at - line.at;
    let off = apart - line.along * line.along.dot(&apart);
    off.norm() < 0.1 && line.along.dot(along).abs() > 0.99
}

/// Whether the plane of a run contains a line within its uncertainty.
fn contains(run: &PlanarRun, at: &Vector, along: &Vector) -> bool {
    let sigma = run.normal_sigma;
    if run.normal.dot(along).abs() > (TOLERANCE.2 * sigma).clamp(ANGLE.0, ANGLE.1) {
        return false;
    }
    let apart = run.center - at;
    let lever = (apart - along * along.dot(&apart)).norm();
    let tolerance = (TOLERANCE.2 * sigma * lever + run.rms).clamp(TOLERANCE.0, TOLERANCE.1);
    run.normal.dot(&apart).abs() < tolerance && lever > 0.05
}

fn inliers(runs: &[PlanarRun], live: &[usize], at: &Vector, along: &Vector) -> Vec<usize> {
    live.iter().copied().filter(|i| contains(&runs[*i], at, along)).collect()
}

/// The score of a line, and the number of directions of the planes that contain it.
fn score(runs: &[PlanarRun], live: &[usize], at: &Vector, along: &Vector) -> (u32, usize) {
    let side = side(along);
    let front = along.cross(&side);
    let mut bins = [0_u32; N_BINS];
    for run in live.iter().map(|i| &runs[*i]).filter(|run| contains(run, at, along)) {
        let angle =
            run.normal.dot(&front).atan2(run.normal.dot(&side)).rem_euclid(std::f64::consts::PI);
        let bin = (angle / std::f64::consts::PI * N_BINS as f64) as usize;
        bins[bin.min(N_BINS - 1)] += 1;
    }
    (bins.iter().map(|n| n.min(&IN_BIN)).sum(), bins.iter().filter(|n| **n > 0).count())
}

/// A unit vector across a direction.
pub(crate) fn side(along: &Vector) -> Vector {
    let other = if along.x.abs() < 0.6 { Vector::x() } else { Vector::y() };
    (other - along * along.dot(&other)).normalize()
}

/// Least squares of the line that all planes of its runs contain.
fn fitted(runs: &[PlanarRun], line: &AxisLine) -> Option<(Vector, Vector)> {
    let (u, w) = (side(&line.along), line.along.cross(&side(&line.along)));
    let mut normal = Matrix4::zeros();
    let mut right = Vector4::zeros();
    for run in line.runs.iter().map(|i| &runs[*i]) {
        let apart = run.center - line.at;
        let lever = (apart - line.along * line.along.dot(&apart)).norm().max(0.1);
        let (nu, nw, na) = (run.normal.dot(&u), run.normal.dot(&w), run.normal.dot(&line.along));
        // Height of the run's centre along the axis, at which the distance is best known.
        let height = line.along.dot(&apart);
        let distance = run.normal.dot(&apart) - height * na;
        let sigma = run.normal_sigma.max(1e-6);
        let place = Vector4::new(nu, nw, height * nu, height * nw) / (sigma * lever + run.rms);
        let d = (distance + height * na) / (sigma * lever + run.rms);
        normal += place * place.transpose();
        right += place * d;
        let turn = Vector4::new(0.0, 0.0, nu, nw) / sigma;
        normal += turn * turn.transpose();
        right -= turn * (na / sigma);
    }
    let x = normal.cholesky()?.solve(&right);
    let at = line.at + u * x[0] + w * x[1];
    Some((at, oriented((line.along + u * x[2] + w * x[3]).normalize())))
}
