//! Searches for poses of the new session in the earlier one that are worth refining.

use crate::plans::Plans;
use crate::surfels::{Surfel, Surfels};
use contract::Fan;
use geometry::{Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Number of bins of the histogram of wall directions (0.5° each).
const N_BINS: usize = 720;
/// Standard deviation of the blur of that histogram, bins.
const BLUR: f64 = 2.0;
/// Smallest distance between two yaws, bins.
const YAW_APART: usize = 6;
/// Largest number of yaws.
const MAX_YAWS: usize = 10;
/// Smallest score of a yaw, as share of the best.
const LEAST_YAW: f64 = 0.25;
/// Number of upright surfels below which all yaws are tried, in steps of [`YAW_STEP`] radians (2°).
const MIN_UPRIGHT: usize = 60;
/// Step in which all yaws are tried, radians.
const YAW_STEP: f64 = TAU / 180.0;
/// Edge of a bin of heights, metres.
const HEIGHT: f64 = 0.02;
/// Largest number of heights that are tried.
const MAX_HEIGHTS: usize = 3;
/// Smallest score of a height, as share of the best.
const LEAST_HEIGHT: f64 = 0.6;
/// Smallest distance between two heights, bins.
const HEIGHT_APART: i32 = 8;
/// Largest number of poses that are refined.
const MAX_POSES: usize = 96;

/// Poses of the new session in the earlier one, each about its own origin, the most promising
/// first.
pub(crate) fn poses(old: &Surfels, new: &Surfels, fan: &dyn Fan) -> Vec<Pose> {
    let (yaws, main) = yaws(old, new);
    let Some(plans) = Plans::of(old, new, main) else { return Vec::new() };
    let found = fan.fan(yaws, |yaw| (yaw, plans.peaks(new, yaw)));
    let all = found.into_iter().flat_map(|(yaw, peaks)| peaks.into_iter().map(move |p| (yaw, p)));
    let mut all: Vec<_> = all.collect();
    all.sort_by(|a, b| b.1.score.total_cmp(&a.1.score));
    let heights = heights(old, new);
    all.truncate(MAX_POSES / heights.len().max(1));
    let pose = |yaw: f64, [x, y]: [f64; 2], z: f64| {
        let turn = UnitQuaternion::from_axis_angle(&Vector::z_axis(), yaw);
        Pose::from_parts(Translation3::new(x, y, z), turn)
    };
    let of = |(yaw, peak): &(f64, crate::plans::Peak)| {
        let (yaw, shift) = (*yaw, peak.shift);
        heights.iter().map(move |z| pose(yaw, shift, *z)).collect::<Vec<_>>()
    };
    all.iter().flat_map(of).collect()
}

/// Yaws from the new session to the earlier one that align walls, radians, and the direction that
/// most walls of the earlier session face.
fn yaws(old: &Surfels, new: &Surfels) -> (Vec<f64>, f64) {
    let is_signed = |all: &Surfels| all.all.iter().filter(|s| s.is_upright()).all(|s| s.is_signed);
    let signed = is_signed(old) && is_signed(new);
    let histogram = |all: &Surfels| histogram(all.all.iter().filter(|s| s.is_upright()), signed);
    let ([n_old, n_new], [old, new]) = (
        [old, new].map(|s| s.all.iter().filter(|s| s.is_upright()).count()),
        [histogram(old), histogram(new)],
    );
    let angle = |bin: f64| bin * TAU / N_BINS as f64;
    // Modulo a quarter turn.
    let quarter = |b: usize| (0..4).map(|k| old[(b + k * N_BINS / 4) % N_BINS]).sum::<f64>();
    let main = (0..N_BINS / 4).max_by(|a, b| quarter(*a).total_cmp(&quarter(*b)).then(b.cmp(a)));
    let main = angle(main.unwrap_or_default() as f64);
    if n_old.min(n_new) < MIN_UPRIGHT {
        let n = (TAU / YAW_STEP) as usize;
        return ((0..n).map(|k| k as f64 * YAW_STEP).collect(), main);
    }
    let fit =
        |shift: usize| -> f64 { (0..N_BINS).map(|b| old[(b + shift) % N_BINS] * new[b]).sum() };
    let fits: Vec<f64> = (0..N_BINS).map(fit).collect();
    let at = |b: usize| fits[b % N_BINS];
    let top = fits.iter().copied().fold(0.0, f64::max);
    let is_peak = |b: &usize| {
        let (l, r) = (at(b + N_BINS - 1), at(b + 1));
        at(*b) >= LEAST_YAW * top && at(*b) > l && at(*b) >= r
    };
    let mut peaks: Vec<usize> = (0..N_BINS).filter(is_peak).collect();
    peaks.sort_by(|a, b| at(*b).total_cmp(&at(*a)).then(a.cmp(b)));
    let mut chosen: Vec<usize> = Vec::new();
    for peak in peaks {
        let is_apart = |c: &usize| {
            let d = c.abs_diff(peak);
            d.min(N_BINS - d) >= YAW_APART
        };
        if chosen.len() < MAX_YAWS && chosen.iter().all(is_apart) {
            chosen.push(peak);
        }
    }
    // The vertex of a parabola gives a maximum between bins.
    let fine = |b: usize| {
        let (l, m, r) = (at(b + N_BINS - 1), at(b), at(b + 1));
        let curve = l - 2.0 * m + r;
        let off = if curve < 0.0 { 0.5 * (l - r) / curve } else { 0.0 };
        angle(b as f64 + off)
    };
    (chosen.into_iter().map(fine).collect(), main)
}

/// Blurred number of surfels that face each direction; both directions where sides are unknown.
fn histogram<'s>(upright: impl Iterator<Item = &'s Surfel>, is_signed: bool) -> Vec<f64> {
    let mut raw = vec![0.0; N_BINS];
    for surfel in upright {
        let bin = surfel.normal.y.atan2(surfel.normal.x).rem_euclid(TAU) / TAU * N_BINS as f64;
        raw[bin as usize % N_BINS] += 1.0;
        if !is_signed {
            raw[(bin as usize + N_BINS / 2) % N_BINS] += 1.0;
        }
    }
    let reach = (3.0 * BLUR) as usize;
    let weight = |d: usize| (-0.5 * (d as f64 / BLUR).powi(2)).exp();
    let of = |b: usize| -> f64 {
        (0..=2 * reach)
            .map(|k| raw[(b + N_BINS + k - reach) % N_BINS] * weight(k.abs_diff(reach)))
            .sum()
    };
    // The root keeps the longest wall of a room from deciding alone.
    (0..N_BINS).map(|b| of(b).sqrt()).collect()
}

/// Differences in height that align level surfaces of the same side, metres, the best first.
fn heights(old: &Surfels, new: &Surfels) -> Vec<f64> {
    let levels = |all: &Surfels, up: bool| {
        let mut out: BTreeMap<i32, f64> = BTreeMap::new();
        let own = all.all.iter().filter(|s| s.is_level());
        for s in own.filter(|s| !s.is_signed || (s.normal.z > 0.0) == up) {
            *out.entry((s.at.z / HEIGHT).round() as i32).or_default() += 1.0;
        }
        out.values_mut().for_each(|n| *n = f64::sqrt(*n));
        out
    };
    let mut fits: BTreeMap<i32, f64> = BTreeMap::new();
    for up in [true, false] {
        let (old, new) = (levels(old, up), levels(new, up));
        for (a, n) in &old {
            for (b, m) in &new {
                *fits.entry(a - b).or_default() += n * m;
            }
        }
    }
    let sum = |z: i32| (z - 2..=z + 2).filter_map(|z| fits.get(&z)).sum::<f64>();
    let mut order: Vec<(f64, i32)> = fits.keys().map(|z| (sum(*z), *z)).collect();
    order.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let least = order.first().map_or(0.0, |best| LEAST_HEIGHT * best.0);
    let mut out: Vec<i32> = Vec::new();
    for (fit, z) in order {
        let is_apart = out.iter().all(|o| (o - z).abs() >= HEIGHT_APART);
        if fit >= least && is_apart && out.len() < MAX_HEIGHTS {
            out.push(z);
        }
    }
    out.into_iter().map(|z| f64::from(z) * HEIGHT).collect()
}
