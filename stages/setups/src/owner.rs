//! Tells from which setup points that follow one another were measured: from there they lie on its
//! comb of elevations and in one or two of its columns.

use crate::refine::wrapped;
use crate::setup::{ScanWindow, Setup};
use geometry::robust::median;
use geometry::{Point, Vector};
use std::f64::consts::{PI, TAU};

/// Largest number of points of a window that are looked at.
const LOOKED: usize = 48;
/// Fewest points that tell.
const FEWEST: usize = 12;
/// Least mean cosine of the phases on the comb: elevations without order reach it in one of 10⁵
/// windows of 48 points, and a scatter of 0.19 steps leaves it.
const ON_COMB: f64 = 0.5;
/// Mean cosine at which no other setup is asked.
const SURE: f64 = 0.8;
/// By how much the best setup must be better than the next.
const CLEARLY: f64 = 0.2;
/// Largest median deviation from one column, steps of elevation: points lie in two columns at most.
const ACROSS: f64 = 2.0;

/// The setup from which these points, which follow one another in a file, were measured; `None`
/// where none or several explain them.
#[must_use]
pub fn owner(points: &[[f64; 3]], setups: &[Setup]) -> Option<usize> {
    if points.len() < FEWEST {
        return None;
    }
    let every = points.len().div_ceil(LOOKED);
    let looked: Vec<[f64; 3]> = points.iter().copied().step_by(every).collect();
    let mut best = (0.0, None);
    let mut next = 0.0;
    for (i, setup) in setups.iter().enumerate() {
        let agrees = agreement(&looked, setup);
        if agrees > best.0 {
            next = best.0;
            best = (agrees, Some(i));
        } else if agrees > next {
            next = agrees;
        }
    }
    best.1.filter(|_| best.0 > ON_COMB && best.0 - next > CLEARLY)
}

/// Whether one setup explains points that follow one another, whatever others would explain.
#[must_use]
pub fn is_own(points: &[[f64; 3]], setup: &Setup) -> bool {
    /// Number of points that are looked at: a look that is made for every few points of a file.
    const GLANCE: usize = 16;
    let every = points.len().div_ceil(GLANCE).max(1);
    let looked: Vec<[f64; 3]> = points.iter().copied().step_by(every).collect();
    looked.len() >= FEWEST && agreement(&looked, setup) > SURE
}

/// The setup of each window.
#[must_use]
pub fn owners(windows: &[ScanWindow], setups: &[Setup]) -> Vec<Option<usize>> {
    windows.iter().map(|window| owner(middle(&window.points), setups)).collect()
}

/// Points from the middle of a window, few enough that they lie in two columns at most.
fn middle(points: &[[f64; 3]]) -> &[[f64; 3]] {
    /// Number of points: more than are looked at, so that they span several surfaces.
    const SPAN: usize = 128;
    let from = points.len().saturating_sub(SPAN) / 2;
    &points[from..(from + SPAN).min(points.len())]
}

/// Mean cosine of the phases of points on the comb of a setup; 0 where they do not lie in columns.
fn agreement(points: &[[f64; 3]], setup: &Setup) -> f64 {
    let scanner_from_world = setup.world_from_scanner.inverse();
    let seen: Vec<Vector> =
        points.iter().map(|p| (scanner_from_world * Point::from(*p)).coords).collect();
    // A column is a half plane, or a whole one where it goes on beyond the zenith: twice the
    // azimuth is the same on both sides.
    let (sin, cos) = seen.iter().fold((0.0, 0.0), |s, p| {
        let (sin, cos) = (2.0 * p.y.atan2(p.x)).sin_cos();
        (s.0 + sin, s.1 + cos)
    });
    let middle = 0.5 * f64::atan2(sin, cos);
    let off = |p: &Vector| {
        let azimuth = 0.5 * wrapped(2.0 * (p.y.atan2(p.x) - middle));
        azimuth.abs() * p.x.hypot(p.y) / p.norm().max(1e-6)
    };
    let mut offs: Vec<f64> = seen.iter().map(off).collect();
    let [phase, step] = setup.comb;
    if median(&mut offs).is_none_or(|off| off > ACROSS * step) {
        return 0.0;
    }
    let mean = |flipped: bool| {
        let sum: f64 = seen
            .iter()
            .map(|p| {
                let rise = p.z.atan2(p.x.hypot(p.y));
                let e = if flipped { PI - rise } else { rise };
                (TAU * (e - phase) / step).cos()
            })
            .sum();
        sum / seen.len() as f64
    };
    if setup.by_direction { mean(false).max(mean(true)) } else { mean(false) }
}
