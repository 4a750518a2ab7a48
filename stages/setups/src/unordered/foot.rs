//! Searches over places on the floor and heights above it for those from which angles lie on a
//! comb.

use super::spectrum::{CellSpectrum, CombPeak};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Width of a cell of azimuth, radians, and its depth, metres.
const AZIMUTH_CELL: (f64, f64) = (0.12, 0.3);
/// Bins of a cell.
const BINS: usize = 512;
/// Nearest and farthest points of the floor, metres.
pub(crate) const RING: [f64; 2] = [0.6, 4.0];
/// Cell of elevation and azimuth in which heights are compared, radians: the tilt of the axis turns
/// within.
const RISE_CELL: (f64, f64) = (0.128, 0.03);
/// Bins of a cell of elevation.
const RISE_BINS: usize = 256;
/// Lowest and highest scanner above the floor, metres, and the step between trials.
const HEIGHTS: (f64, f64, f64) = (0.3, 4.0, 0.012);

/// A place on the floor from which azimuths lie on a comb.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FootPeak {
    pub(crate) at: [f64; 2],
    pub(crate) comb: CombPeak,
}

/// The clearest place on a square grid about a place.
pub(crate) fn place(points: &[[f64; 3]], about: [f64; 2], half: i32, step: f64) -> FootPeak {
    let n_az = (TAU / AZIMUTH_CELL.0).ceil() as usize;
    let n_r = (RING[1] / AZIMUTH_CELL.1) as usize + 2;
    let mut spectrum = CellSpectrum::new(n_az * n_r, BINS, AZIMUTH_CELL.0);
    let mut best: Option<FootPeak> = None;
    for (i, j) in (-half..=half).flat_map(|j| (-half..=half).map(move |i| (i, j))) {
        let at = [about[0] + f64::from(i) * step, about[1] + f64::from(j) * step];
        for p in points {
            let (x, y) = (p[0] - at[0], p[1] - at[1]);
            let r = (x * x + y * y).sqrt();
            if !(RING[0]..=RING[1]).contains(&r) {
                continue;
            }
            let a = y.atan2(x) + TAU / 2.0;
            let cell = ((a / AZIMUTH_CELL.0) as usize).min(n_az - 1);
            let ring = ((r / AZIMUTH_CELL.1) as usize).min(n_r - 1);
            spectrum.add(ring * n_az + cell, a - cell as f64 * AZIMUTH_CELL.0);
        }
        let comb = spectrum.clearest();
        if best.is_none_or(|b| comb.z > b.comb.z) {
            best = Some(FootPeak { at, comb });
        }
    }
    best.unwrap_or(FootPeak { at: about, comb: CombPeak { z: 0.0, step: 1.0 } })
}

/// Heights above a place from which elevations lie on a comb, the clearest first.
pub(crate) fn heights(points: &[[f64; 3]], at: [f64; 2]) -> Vec<(f64, CombPeak)> {
    let n_az = (TAU / RISE_CELL.1).ceil() as usize;
    let n_el = (FRAC_PI_2 / RISE_CELL.0) as usize + 1;
    let mut spectrum = CellSpectrum::new(n_az * n_el, RISE_BINS, RISE_CELL.0);
    let polar: Vec<(usize, f64, f64)> = points
        .iter()
        .map(|p| {
            let (x, y) = (p[0] - at[0], p[1] - at[1]);
            let a = y.atan2(x) + TAU / 2.0;
            (((a / RISE_CELL.1) as usize).min(n_az - 1), x.hypot(y), p[2])
        })
        .collect();
    let n = ((HEIGHTS.1 - HEIGHTS.0) / HEIGHTS.2) as usize;
    let mut all = Vec::new();
    for i in 0..n {
        let s = HEIGHTS.0 + i as f64 * HEIGHTS.2;
        for (cell, r, z) in &polar {
            let e = (s - z).atan2(*r);
            let row = ((e.max(0.0) / RISE_CELL.0) as usize).min(n_el - 1);
            spectrum.add(cell * n_el + row, (e - row as f64 * RISE_CELL.0).max(0.0));
        }
        all.push((s, spectrum.clearest()));
    }
    // Only the clearest of neighbours.
    let mut out: Vec<(f64, CombPeak)> = Vec::new();
    all.sort_by(|a, b| b.1.z.total_cmp(&a.1.z));
    for one in all {
        if out.iter().all(|other| (other.0 - one.0).abs() > 0.05) {
            out.push(one);
        }
        if out.len() == 3 {
            break;
        }
    }
    out
}
