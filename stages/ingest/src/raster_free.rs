//! Estimates a raster from the directions of points without native rows and columns. Points in the
//! order of measurement give both steps; depth images and shuffled points give the density only.

use crate::angular_grid::{AngularGrid, Axis, median, wrap};
use crate::reader::SampledPoint;
use std::f64::consts::TAU;

/// Distance between points that follow one another in the file, in spacings of the sample, above
/// which the points count as shuffled.
const SHUFFLED: f64 = 4.0;
/// Largest deviation of a step from the direction of a line at which it runs along it, share of the
/// step.
const ALONG: f64 = 0.35;
/// Share of steps along the line from which on there are lines; random order gives 0.23.
const LINES: f64 = 0.6;
/// Lines about another axis than z must have at most this part of the bend of those about z.
const STRAIGHTER: f64 = 0.6;
/// Bend of lines about z (step across the line as share of the step along it) below which they are
/// accepted without trying other axes.
const STRAIGHT: f64 = 1e-4;
/// Elevation above which directions are ignored where azimuth matters, radians (75°).
const STEEP: f64 = 1.3;
/// Angle below which two points have the same direction (several returns of one beam), radians.
const SAME: f64 = 1e-6;

/// Fits a raster; `None` only where all points have the same direction.
pub(crate) fn fit(sample: &[SampledPoint], n_total: Option<u64>) -> Option<AngularGrid> {
    let about_z: Vec<[f64; 2]> = sample.iter().map(|s| Axis::Z.angles(s.xyz)).collect();
    let spacing = spacing(&about_z)?;
    let steps = consecutive(sample);
    let along = mode(&steps, SAME, 1.0);
    let ordered = along.filter(|s| *s < SHUFFLED * spacing);
    let Some(along) = ordered else {
        let share = n_total.map_or(1.0, |n| (sample.len() as f64 / n as f64).min(1.0));
        return Some(square(&about_z, spacing * share.sqrt()));
    };
    let lines = Axis::ALL.map(|axis| ScanLines::find(sample, &steps, along, axis));
    let mut best = &lines[0];
    for other in &lines[1..] {
        if best.bend > STRAIGHT && other.bend < STRAIGHTER * best.bend {
            best = other;
        }
    }
    if best.share < LINES {
        return Some(square(&about_z, spacing));
    }
    Some(best.grid(along))
}

/// A raster with the same step in both directions.
fn square(angles: &[[f64; 2]], step: f64) -> AngularGrid {
    let [azimuth, elevation] = angles[angles.len() / 2];
    AngularGrid { axis: Axis::Z, row_step: step, col_step: step, elevation, azimuth }
}

/// Angles between points that follow one another, radians.
fn consecutive(sample: &[SampledPoint]) -> Vec<f64> {
    let unit = |s: &SampledPoint| nalgebra::Vector3::from(s.xyz.map(f64::from)).normalize();
    sample.windows(2).map(|w| (unit(&w[1]) - unit(&w[0])).norm()).collect()
}

/// How consecutive points follow one another, seen about one axis.
struct ScanLines {
    axis: Axis,
    angles: Vec<[f64; 2]>,
    /// Whether elevation changes along a line, and not azimuth.
    upright: bool,
    /// Share of steps that run along a line.
    share: f64,
    /// Median step across the line, share of the step.
    bend: f64,
}

impl ScanLines {
    fn find(sample: &[SampledPoint], steps: &[f64], along: f64, axis: Axis) -> Self {
        let angles: Vec<[f64; 2]> = sample.iter().map(|s| axis.angles(s.xyz)).collect();
        let (mut up, mut round) = (Vec::new(), Vec::new());
        for (i, step) in steps.iter().enumerate() {
            if *step < 0.5 * along || *step > 2.0 * along {
                continue;
            }
            let [a, b] = [angles[i], angles[i + 1]];
            up.push((wrap(b[0] - a[0]) * b[1].cos() / step).abs());
            round.push(((b[1] - a[1]) / step).abs());
        }
        let bends = [&mut up, &mut round].map(|b| median(b).unwrap_or(1.0));
        let upright = bends[0] <= bends[1];
        let across = if upright { &up } else { &round };
        let share =
            across.iter().filter(|b| **b < ALONG).count() as f64 / across.len().max(1) as f64;
        Self { axis, angles, upright, share, bend: bends[usize::from(!upright)] }
    }

    /// Steps along and across the lines, and the phase where it is well determined.
    fn grid(&self, guess: f64) -> AngularGrid {
        let (u, v) = if self.upright { (1, 0) } else { (0, 1) };
        let flat: Vec<[f64; 2]> =
            self.angles.iter().copied().filter(|a| a[1].abs() < STEEP).collect();
        let angles = if flat.len() * 2 > self.angles.len() { &flat } else { &self.angles };
        let steps: Vec<f64> = angles
            .windows(2)
            .filter(|w| wrap(w[1][v] - w[0][v]).abs() < 2.0 * guess / w[0][1].cos().max(0.2))
            .map(|w| wrap(w[1][u] - w[0][u]).abs())
            .collect();
        let mut along = mode(&steps, SAME, 4.0 * guess / 0.2).unwrap_or(guess);
        let mut across = across(angles, u, v, along).unwrap_or(along);
        // Not finer than about one point a pixel, whatever the order of the points suggests.
        if let Some(spacing) = spacing(angles) {
            let ratio = along * across / (spacing * spacing);
            if !(0.5..=2.5).contains(&ratio) {
                (along, across) = (along / ratio.sqrt(), across / ratio.sqrt());
            }
        }
        let (along, along_phase) = sharpen(angles, u, along);
        let (across, across_phase) = sharpen(angles, v, across);
        let (row_step, elevation, col_step, azimuth) = if self.upright {
            (along, along_phase, across, across_phase)
        } else {
            (across, across_phase, along, along_phase)
        };
        AngularGrid { axis: self.axis, row_step, col_step, elevation, azimuth }
    }
}

/// Spacing of lines along coordinate `v`, from points that are neighbours along `u`; `None` where
/// the sample holds too few lines.
fn across(angles: &[[f64; 2]], u: usize, v: usize, along: f64) -> Option<f64> {
    /// Distance above which lines are not neighbours, in steps along the line.
    const FAR: f64 = 12.0;
    let mut cells: Vec<(i64, f64)> =
        angles.iter().map(|a| ((a[u] / along).floor() as i64, a[v])).collect();
    cells.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let gaps: Vec<f64> = cells
        .windows(2)
        .filter(|w| w[0].0 == w[1].0)
        .map(|w| w[1].1 - w[0].1)
        .filter(|gap| *gap < FAR * along)
        .collect();
    // Points of one line that share a cell differ only by jitter, which must not be taken for the
    // spacing.
    (gaps.len() * 10 > angles.len()).then(|| mode(&gaps, 0.15 * along, FAR * along)).flatten()
}

/// The most frequent value in a range: the median of the values about the fullest bin of a
/// logarithmic histogram.
fn mode(values: &[f64], min: f64, max: f64) -> Option<f64> {
    /// Ratio of the limits of neighbouring bins.
    const RATIO: f64 = 1.06;
    let n_bins = ((max / min).ln() / RATIO.ln()).ceil().max(1.0) as usize;
    let mut bins = vec![0_u32; n_bins + 2];
    for value in values.iter().filter(|v| **v > min && **v < max) {
        bins[((value / min).ln() / RATIO.ln()) as usize + 1] += 1;
    }
    let smooth = |i: usize| bins[i - 1] + 2 * bins[i] + bins[i + 1];
    let fullest = (1..=n_bins).max_by_key(|i| (smooth(*i), std::cmp::Reverse(*i)))?;
    let middle = min * RATIO.powf(fullest as f64 - 0.5);
    let mut near: Vec<f64> =
        values.iter().copied().filter(|v| (0.85..1.18).contains(&(v / middle))).collect();
    median(&mut near)
}

/// Spacing of the points if they lay on a square raster of azimuth and elevation, from the number
/// of points in the smallest suitable cells. `None` where all points have the same direction.
fn spacing(angles: &[[f64; 2]]) -> Option<f64> {
    /// Number of points in a cell from which on its count is certain to 20 %.
    const ENOUGH: usize = 30;
    /// Number of points in a cell below which edges of lines are counted instead of their spacing.
    const FEW: usize = 8;
    let mut found = None;
    let mut edge = 16.0_f64.to_radians();
    // 16° halved 14 times: 0.001°, finer than any scanner.
    for _ in 0..15 {
        let mut cells: Vec<(i64, i64)> = angles
            .iter()
            .filter(|a| a[1].abs() < STEEP)
            .map(|a| ((a[0] / edge).floor() as i64, (a[1] / edge).floor() as i64))
            .collect();
        cells.sort_unstable();
        let mut counts: Vec<usize> =
            cells.chunk_by(|a, b| a == b).flat_map(|c| vec![c.len(); c.len()]).collect();
        if counts.is_empty() {
            break;
        }
        // The upper quartile over points: cells at the rim of the sample are only partly filled.
        let at = counts.len() * 3 / 4;
        let count = *counts.select_nth_unstable(at).1;
        if count < FEW || (found.is_some() && count < ENOUGH) {
            break;
        }
        found = Some(edge / (count as f64).sqrt());
        edge /= 2.0;
    }
    found
}

/// Lengths of the mean phasor at equally spaced frequencies. Each value's phasor is rotated by the
/// same angle at every step, without a sine or cosine (thousands of rotations leave an error of
/// 10⁻¹²).
struct PhasorSweep {
    now: [Vec<f64>; 2],
    turn: [Vec<f64>; 2],
}

impl PhasorSweep {
    fn new(values: &[f64], low: f64, first: f64, apart: f64) -> Self {
        let phasors = |f: f64| {
            let turn = |v: &f64| TAU * f * (v - low);
            let [cos, sin]: [fn(f64) -> f64; 2] = [f64::cos, f64::sin];
            [cos, sin].map(|part| values.iter().map(|v| part(turn(v))).collect())
        };
        Self { now: phasors(first), turn: phasors(apart) }
    }

    /// The length of the mean phasor at the next frequency.
    fn next(&mut self) -> f64 {
        let ([re, im], [cos, sin]) = (&mut self.now, &self.turn);
        let length = f64::hypot(re.iter().sum(), im.iter().sum()) / re.len() as f64;
        for (((re, im), cos), sin) in re.iter_mut().zip(im).zip(cos).zip(sin) {
            (*re, *im) = (*re * cos - *im * sin, *re * sin + *im * cos);
        }
        length
    }
}

/// The step near `step` that fits the angles best, and the middle of a pixel near their median.
/// Where the angles are too irregular for a phase, the step is kept and the phase is arbitrary.
fn sharpen(angles: &[[f64; 2]], axis: usize, step: f64) -> (f64, f64) {
    /// Number of points that are used: enough for a hundredth of a pixel.
    const POINTS: usize = 4_000;
    /// Largest relative difference of the step from the guess.
    const REACH: f64 = 0.03;
    /// Length of the mean phasor from which on pixels hold one point each: a jitter of 0.17 pixels.
    const SHARP: f64 = 0.55;
    let every = angles.len().div_ceil(POINTS);
    let values: Vec<f64> = angles.iter().step_by(every).map(|a| a[axis]).collect();
    let (low, high) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |m, v| (m.0.min(*v), m.1.max(*v)));
    let middle = values[values.len() / 2];
    let apart = 0.2 / (high - low).max(step);
    let n = ((REACH / step) / apart).ceil().min(4_000.0) as i32;
    let sharpest = |about: f64, apart: f64, n: i32| -> (f64, f64) {
        let mut sweep = PhasorSweep::new(&values, low, about - f64::from(n) * apart, apart);
        let mut best = (0.0, about);
        for i in -n..=n {
            let length = sweep.next();
            if length > best.0 {
                best = (length, about + f64::from(i) * apart);
            }
        }
        best
    };
    let (length, f) = sharpest(sharpest(1.0 / step, apart, n).1, apart / 20.0, 10);
    if length < SHARP {
        return (step, middle);
    }
    let turn = |v: &f64| TAU * f * (v - low);
    let (cos, sin) =
        values.iter().fold((0.0, 0.0), |s, v| (s.0 + turn(v).cos(), s.1 + turn(v).sin()));
    let (phase, found) = (low + sin.atan2(cos) / (TAU * f), 1.0 / f);
    (found, phase + ((middle - phase) / found).round() * found)
}
