//! Which points are those of a scanner: the raster that they lie on, as closely as its own points
//! do, and how many of others would pass for them.

use super::EXPLAINED;
use super::raster::RasterSetup;
use super::solve::{RasterFit, SeenAngles};
use contract::{OnRaster, PointRaster};
use geometry::{Point, Pose};
use std::f64::consts::TAU;

/// Sectors of azimuth and bands of elevation of which each has a phase of its own, 5° each:
/// graduation errors turn within 30° at least.
const PHASES: [usize; 2] = [72, 36];
/// Fewest points of a phase; others take that of the nearest sector.
const IN_PHASE: f64 = 24.0;
/// Digits of a phase that a scanners file keeps: a ten-thousandth of a step.
const DIGITS: f64 = 1e4;
/// Deviations of the own points within which a point counts as on the raster, and up to which it
/// may be on it.
const WITHIN: f64 = 2.5;
const APART: f64 = 4.0;
/// Least and largest of both, steps. A point of another scanner is within by chance with twice the
/// one times twice the other.
const MOST_WITHIN: f64 = 0.1;
const LEAST_WITHIN: f64 = 0.02;
const APARTS: [f64; 2] = [0.1, 0.3];
/// Fewest deviations of the own points that a raster is narrowed to.
const LEAST_DEVIATIONS: f64 = 1.0;
/// Standard deviation of coordinates that are rounded to a millimetre, metres.
const ROUNDED: f64 = 3e-4;
/// Largest share of the points of a setup that may be those of others by chance.
const MOST_WRONG: f64 = 0.003;
/// Nearest point whose deviation is looked at, metres: errors along the surface turn nearer ones.
const NEAREST: f64 = 2.0;
/// Deviation from both combs beyond which own points are rare, steps.
const BESIDE: f64 = 0.3;
/// Share of points of others below which all points of a cloud are taken for those of one scanner.
const ALONE: f64 = 0.01;

/// How the points all round a scanner lie about its raster.
pub(crate) struct RasterPoints {
    pub(crate) raster: PointRaster,
    /// Share of the points that are its own.
    pub(crate) share: f64,
    /// Share of the points that lie beside it as those of others do.
    pub(crate) beside: f64,
}

/// The raster of a fit as points show it; `sigmas` are the deviations of the own ones, radians.
pub(crate) fn of_points(fit: &RasterFit, points: &[[f64; 3]], sigmas: [f64; 2]) -> RasterPoints {
    let sigma = [0, 1].map(|k| sigmas[k] / fit.steps[k]);
    let seen: Vec<SeenAngles> =
        points.iter().filter_map(|p| fit.see(p)).filter(SeenAngles::is_flat).collect();
    let mut raster = PointRaster {
        steps: fit.steps,
        phases: PHASES.map(|n| vec![0.0; n]),
        within: sigma.map(|s| (WITHIN * s).clamp(LEAST_WITHIN, MOST_WITHIN)),
        apart: sigma.map(|s| (APART * s).clamp(APARTS[0], APARTS[1])),
    };
    // Points near one comb are mostly those of the scanner, so that each comb tells the other.
    raster.phases[1] = phases(fit, 1, 1, seen.iter());
    for kind in [0, 1, 0] {
        let other = 1 - kind;
        let near = 2.0 * raster.within[other];
        let own = seen.iter().filter(|a| deviations(&raster, a)[other] <= near);
        raster.phases[kind] = phases(fit, kind, PHASES[kind], own);
    }
    let (mut n_far, mut n_beside, mut n_on) = (0.0, 0.0, 0.0);
    for angles in &seen {
        let off = deviations(&raster, angles);
        n_on += f64::from(u8::from((0..2).all(|k| off[k] <= raster.within[k])));
        if angles.range > NEAREST {
            n_far += 1.0;
            n_beside += f64::from(u8::from(off.iter().all(|v| *v > BESIDE)));
        }
    }
    let beside = n_beside / (1.0 - 2.0 * BESIDE).powi(2) / f64::max(n_far, 1.0);
    let n = seen.len() as f64;
    let by_chance = by_chance(&raster);
    let share = ((n_on - by_chance * n) / (1.0 - by_chance)).max(0.0) / points.len().max(1) as f64;
    RasterPoints { raster, share, beside }
}

fn deviations(raster: &PointRaster, angles: &SeenAngles) -> [f64; 2] {
    raster.deviations([angles.azimuth, angles.elevation]).map(f64::abs)
}

/// The share of the points of others that are on a raster.
fn by_chance(raster: &PointRaster) -> f64 {
    raster.within.iter().map(|w| 2.0 * w).product()
}

/// The phases of a comb in `n` sectors of its angle.
fn phases<'a>(
    fit: &RasterFit,
    kind: usize,
    n: usize,
    own: impl Iterator<Item = &'a SeenAngles>,
) -> Vec<f64> {
    let mut sums = vec![[0.0_f64; 3]; n];
    for angles in own {
        let angle = [angles.azimuth, angles.elevation][kind];
        let (sin, cos) = (TAU * angle / fit.steps[kind]).sin_cos();
        let sum = &mut sums[PointRaster::sector(kind, angle, n)];
        *sum = [sum[0] + cos, sum[1] + sin, sum[2] + 1.0];
    }
    let is_told = |i: &usize| sums[*i][2] >= IN_PHASE;
    let told: Vec<usize> = (0..n).filter(is_told).collect();
    let phase = |i: usize| {
        let nearest = told.iter().min_by_key(|at| at.abs_diff(i)).copied().unwrap_or(i);
        let phase = sums[nearest][1].atan2(sums[nearest][0]) / TAU;
        (phase.rem_euclid(1.0) * DIGITS).round() / DIGITS
    };
    (0..n).map(phase).collect()
}

/// Narrows the rasters of all setups of a cloud until the points of others that chance puts on them
/// are few; takes that of a setup away whose own points scatter too much for it. `points` are in
/// the frame `world_from_points`.
pub(crate) fn narrow(setups: &mut [RasterSetup], world_from_points: &Pose, points: &[[f64; 3]]) {
    /// Share of the points of other setups that are not known as theirs: few errors are larger than
    /// that.
    const UNKNOWN: f64 = 0.01;
    let widest: Vec<_> = setups.iter().map(|s| s.raster.clone()).collect();
    loop {
        let strange = strangers(setups, world_from_points, points);
        let mut has_lost = false;
        for (setup, widest) in setups.iter_mut().zip(&widest) {
            let own = setup.evidence.share;
            let (Some(raster), Some(widest)) = (&mut setup.raster, widest) else { continue };
            let others = strange + UNKNOWN * (1.0 - strange - own).max(0.0);
            let wrong = by_chance(widest) * others / own.max(1e-6);
            let narrower = (MOST_WRONG / wrong.max(1e-9)).sqrt().min(1.0);
            raster.within = widest.within.map(|w| (w * narrower * DIGITS).round() / DIGITS);
            if narrower * WITHIN < LEAST_DEVIATIONS {
                setup.raster = None;
                has_lost = true;
            }
        }
        // The points of those count as those of nobody.
        if !has_lost {
            return;
        }
    }
}

/// The share of points that are of no setup with a raster, from those that are clearly beside all
/// rasters.
fn strangers(setups: &[RasterSetup], world_from_points: &Pose, points: &[[f64; 3]]) -> f64 {
    let rasters: Vec<(&PointRaster, Pose)> = setups
        .iter()
        .filter_map(|s| {
            Some((s.raster.as_ref()?, s.world_from_scanner.inverse() * world_from_points))
        })
        .collect();
    let is_beside = |p: &&[f64; 3]| {
        rasters.iter().all(|(raster, scanner_from_points)| {
            let p = scanner_from_points * Point::from(**p);
            raster.has(p.coords.into(), ROUNDED) == OnRaster::No
        })
    };
    let n = points.iter().filter(is_beside).count() as f64 / points.len().max(1) as f64;
    let beside = |(raster, _): &(&PointRaster, Pose)| 1.0 - 4.0 * raster.apart[0] * raster.apart[1];
    (n / rasters.iter().map(beside).product::<f64>()).min(1.0)
}

/// Whether all points of a cloud are those of its only setup.
pub(crate) fn is_alone(setups: &[RasterSetup]) -> bool {
    let is_alone = |s: &RasterSetup| s.evidence.share >= EXPLAINED && s.evidence.beside < ALONE;
    setups.len() == 1 && setups.iter().all(is_alone)
}
