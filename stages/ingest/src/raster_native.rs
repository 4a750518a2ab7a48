//! Fits a regular raster to points with native rows and columns. Rows are elevation and columns are
//! azimuth about one of three axes, in either direction, with or without a jump at ±π.

use crate::angular_grid::{AngularGrid, Axis, median, wrap};
use crate::reader::SampledPoint;
use geometry::robust::tukey;

/// A raster fitted to native rows and columns.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Native {
    pub(crate) grid: AngularGrid,
    /// Residual of rows or columns, whichever is larger, pixels RMS without the worst 2 %.
    pub(crate) rms: f64,
}

/// Number of rows or columns below which regularity may be chance.
const MIN_LINES: usize = 3;
/// Elevation above which azimuths are ignored, radians (75°): there a small error changes the
/// azimuth much.
const STEEP: f64 = 1.3;
/// Share of the largest residuals that is ignored: mixed pixels and stray returns.
const LEFT_OUT: f64 = 0.02;

/// Fits a raster; `None` where the sample has no native rows and columns, or too few of them.
pub(crate) fn fit(sample: &[SampledPoint]) -> Option<Native> {
    let native: Vec<([f32; 3], [u32; 2])> =
        sample.iter().filter_map(|s| Some((s.xyz, s.native?))).collect();
    if native.len() * 2 < sample.len() {
        return None;
    }
    let mut best: Option<Native> = None;
    for axis in Axis::ALL {
        let Some(fitted) = fit_axis(&native, axis) else {
            continue;
        };
        // Another axis than the usual one must be better by a tenth of a pixel.
        if best.is_none_or(|b| fitted.rms + 0.1 < b.rms) {
            best = Some(fitted);
        }
    }
    best
}

fn fit_axis(native: &[([f32; 3], [u32; 2])], axis: Axis) -> Option<Native> {
    let mut rows = Vec::with_capacity(native.len());
    let mut cols = Vec::with_capacity(native.len());
    for (xyz, [row, col]) in native {
        let [azimuth, elevation] = axis.angles(*xyz);
        rows.push((*row, elevation));
        if elevation.abs() < STEEP {
            cols.push((*col, azimuth));
        }
    }
    rows.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    cols.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let row = AngleLine::fit(&rows)?;
    let col = AngleLine::fit(&cols)?;
    let rms = row.rms(&rows).max(col.rms(&cols));
    let grid = AngularGrid {
        axis,
        row_step: row.slope.abs(),
        col_step: col.slope.abs(),
        elevation: row.angle,
        azimuth: col.angle,
    };
    Some(Native { grid, rms })
}

/// The line `angle + slope · (index − at)`, radians, modulo a turn.
#[derive(Debug, Clone, Copy)]
struct AngleLine {
    slope: f64,
    at: f64,
    angle: f64,
}

impl AngleLine {
    /// Fits a line to (index, angle), sorted by index.
    fn fit(points: &[(u32, f64)]) -> Option<Self> {
        let mut lines: Vec<(f64, f64)> = points
            .chunk_by(|a, b| a.0 == b.0)
            .map(|same| {
                // Relative to the first angle, so that a jump at ±π within the line has no effect.
                let mut angles: Vec<f64> = same.iter().map(|p| wrap(p.1 - same[0].1)).collect();
                (f64::from(same[0].0), same[0].1 + median(&mut angles).unwrap_or(0.0))
            })
            .collect();
        if lines.len() < MIN_LINES {
            return None;
        }
        let nearest = lines.windows(2).map(|w| w[1].0 - w[0].0).fold(f64::INFINITY, f64::min);
        let mut slopes: Vec<f64> = lines
            .windows(2)
            .filter(|w| w[1].0 - w[0].0 <= 4.0 * nearest)
            .map(|w| wrap(w[1].1 - w[0].1) / (w[1].0 - w[0].0))
            .collect();
        let slope = median(&mut slopes)?;
        for i in 1..lines.len() {
            let expected = lines[i - 1].1 + slope * (lines[i].0 - lines[i - 1].0);
            lines[i].1 = expected + wrap(lines[i].1 - expected);
        }
        let line = Self::least_squares(&lines, slope)?;
        (line.slope.is_finite() && line.slope.abs() > 1e-7).then_some(line)
    }

    /// Reweighted least squares about the middle index, which becomes the phase: there the rounding
    /// of the step to a whole number of columns has the least effect.
    fn least_squares(lines: &[(f64, f64)], slope: f64) -> Option<Self> {
        let at = ((lines[0].0 + lines[lines.len() - 1].0) / 2.0).round();
        let mut offsets: Vec<f64> = lines.iter().map(|l| l.1 - slope * (l.0 - at)).collect();
        let mut line = Self { slope, at, angle: median(&mut offsets)? };
        for _ in 0..8 {
            let residual = |l: &(f64, f64)| l.1 - line.angle - line.slope * (l.0 - at);
            let mut sizes: Vec<f64> = lines.iter().map(|l| residual(l).abs()).collect();
            let scale = 4.685 * 1.4826 * median(&mut sizes)? + 1e-9;
            let (mut s, mut sx, mut sy, mut sxx, mut sxy) = (0.0, 0.0, 0.0, 0.0, 0.0);
            for l in lines {
                let w = tukey(residual(l), scale);
                let x = l.0 - at;
                (s, sx, sy) = (s + w, sx + w * x, sy + w * l.1);
                (sxx, sxy) = (sxx + w * x * x, sxy + w * x * l.1);
            }
            let det = s * sxx - sx * sx;
            if det.abs() < 1e-12 {
                break;
            }
            line.slope = (s * sxy - sx * sy) / det;
            line.angle = (sy - line.slope * sx) / s;
        }
        Some(line)
    }

    /// Residual in pixels RMS, without the worst ones.
    fn rms(&self, points: &[(u32, f64)]) -> f64 {
        let mut sizes: Vec<f64> = points
            .iter()
            .map(|p| wrap(p.1 - self.angle - self.slope * (f64::from(p.0) - self.at)) / self.slope)
            .map(|r| r * r)
            .collect();
        sizes.sort_unstable_by(f64::total_cmp);
        let n = ((sizes.len() as f64) * (1.0 - LEFT_OUT)).ceil() as usize;
        (sizes[..n].iter().sum::<f64>() / n.max(1) as f64).sqrt()
    }
}
