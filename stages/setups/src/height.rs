//! Finds the place on an axis from which neighbours of a column are equally far apart in elevation,
//! and that step.

use crate::axis::{AxisLine, side};
use crate::planes::{PlanarRun, middle};
use geometry::Vector;
use geometry::robust::median;

/// Place on an axis and step of elevation.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Height {
    /// Distance along the axis from the point `at` of the line, metres.
    pub(crate) s: f64,
    /// Step between rows, radians.
    pub(crate) step: f64,
}

/// Points of one run as (distance along the axis, signed distance from it), metres.
type Profile = Vec<[f64; 2]>;

/// Largest number of runs and of points of each that are looked at for the height.
const LOOKED: (usize, usize) = (64, 40);
/// Reach of heights beyond the columns' own, metres, and step of the scan.
const REACH: (f64, f64) = (1.0, 0.02);
/// Farthest height from the middle of the columns, metres.
const FARTHEST: f64 = 12.0;
/// Least angle between neighbours, radians: nearer ones are one direction.
const LEAST: f64 = 1e-5;

/// Profiles of the runs of a line.
pub(crate) fn profiles(runs: &[PlanarRun], line: &AxisLine) -> Vec<Profile> {
    line.runs.iter().map(|i| profile(&runs[*i], line)).collect()
}

fn profile(run: &PlanarRun, line: &AxisLine) -> Profile {
    let apart = run.center - line.at;
    let flat = apart - line.along * line.along.dot(&apart);
    let across = if flat.norm() > 1e-6 { flat.normalize() } else { side(&line.along) };
    let both = |p: &Vector| {
        let apart = p - line.at;
        [line.along.dot(&apart), across.dot(&apart)]
    };
    run.points.iter().map(both).collect()
}

/// The heights from which elevations of neighbours differ most evenly, by two measures: that of a
/// cloud with most of its points, and that of a thinned one. The first is right far more often.
pub(crate) fn find(profiles: &[Profile]) -> impl Iterator<Item = Height> + '_ {
    [most_alike as Unevenness, least_alike].into_iter().filter_map(|m| by(profiles, m))
}

fn by(profiles: &[Profile], measure: Unevenness) -> Option<Height> {
    let every = profiles.len().div_ceil(LOOKED.0).max(1);
    let looked: Vec<&[[f64; 2]]> =
        profiles.iter().step_by(every).map(|p| &p[..p.len().min(LOOKED.1)]).collect();
    let mut heights: Vec<f64> = looked.iter().flat_map(|p| p.iter().map(|v| v[0])).collect();
    let center = median(&mut heights)?;
    let (low, high) =
        heights.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |m, v| (m.0.min(*v), m.1.max(*v)));
    let from = (low - REACH.0).max(center - FARTHEST);
    let to = (high + REACH.0).min(center + FARTHEST);
    let n = ((to - from) / REACH.1).ceil().clamp(1.0, 2_000.0) as usize;
    let mut scratch = Vec::new();
    let mut best = (f64::INFINITY, center);
    let mut look = |looked: &[&[[f64; 2]]], s: f64, best: &mut (f64, f64)| {
        angles(looked, s, &mut scratch);
        let cost = measure(&mut scratch).unwrap_or(f64::INFINITY);
        if cost < best.0 {
            *best = (cost, s);
        }
    };
    // A few runs tell where about it is.
    let some: Vec<&[[f64; 2]]> = looked.iter().step_by(2).copied().collect();
    for i in 0..=n {
        look(&some, from + (to - from) * i as f64 / n as f64, &mut best);
    }
    best.0 = f64::INFINITY;
    let about = best.1;
    look(&looked, about, &mut best);
    let mut apart = REACH.1;
    while apart > 1e-4 {
        apart *= 0.5;
        for s in [best.1 - apart, best.1 + apart] {
            look(&looked, s, &mut best);
        }
    }
    let step = step(&looked, best.1)?;
    Some(Height { s: best.1, step })
}

/// Angles between neighbours of the profiles, seen from a height, radians.
fn angles(profiles: &[&[[f64; 2]]], s: f64, out: &mut Vec<f64>) {
    out.clear();
    for profile in profiles {
        for pair in profile.windows(2) {
            let ([ta, ra], [tb, rb]) = (pair[0], pair[1]);
            let (ta, tb) = (ta - s, tb - s);
            let angle = ((tb * ra - ta * rb) / (ra * rb + ta * tb)).abs();
            if angle > LEAST {
                out.push(angle);
            }
        }
    }
}

/// How unlike one another angles are, as share of a typical one; `None` for no angles.
type Unevenness = fn(&mut [f64]) -> Option<f64>;

/// Median deviation of the angles from their median: small where most of them are one step.
fn most_alike(angles: &mut [f64]) -> Option<f64> {
    let typical = median(angles)?;
    angles.iter_mut().for_each(|a| *a = (*a - typical).abs());
    Some(median(angles)? / typical)
}

/// Difference of two low quantiles of the angles: small where at least a quarter is one step.
fn least_alike(angles: &mut [f64]) -> Option<f64> {
    /// The quantiles.
    const LOW: (f64, f64) = (0.06, 0.22);
    let last = angles.len().checked_sub(1)?;
    let mut at = |share: f64| {
        *angles.select_nth_unstable_by((last as f64 * share) as usize, f64::total_cmp).1
    };
    let (low, high) = (at(LOW.0), at(LOW.1));
    Some((high - low) / high)
}

/// The step of elevation: the largest of which the angles are multiples, nearly as well as of any
/// other.
fn step(profiles: &[&[[f64; 2]]], s: f64) -> Option<f64> {
    /// Smallest and largest step in medians of the angles.
    const RANGE: (f64, f64) = (0.15, 1.1);
    /// Share of the best fit that is good enough for a larger step.
    const AS_GOOD: f64 = 0.85;
    /// Ratio of neighbouring steps that are tried.
    const RATIO: f64 = 0.99;
    let mut all = Vec::new();
    angles(profiles, s, &mut all);
    let typical = middle(all.clone());
    all.retain(|a| *a < 8.0 * typical);
    if all.len() < 32 {
        return None;
    }
    let fit = |q: f64| {
        all.iter().map(|a| (std::f64::consts::TAU * a / q).cos()).sum::<f64>() / all.len() as f64
    };
    let mut tried = Vec::new();
    let mut q = RANGE.1 * typical;
    while q > RANGE.0 * typical {
        tried.push((q, fit(q)));
        q *= RATIO;
    }
    let best = tried.iter().map(|t| t.1).fold(0.0, f64::max);
    let peak = tried.iter().position(|t| t.1 >= AS_GOOD * best)?;
    // Down to the top of that peak.
    let top = tried[peak..].windows(2).position(|w| w[1].1 < w[0].1).map_or(peak, |i| peak + i);
    Some(tried[top].0)
}
