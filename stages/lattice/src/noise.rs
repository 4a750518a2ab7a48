//! Estimates the range noise of a raster: that of the scanner's data sheet, or more where the tile
//! itself shows more.

use crate::Settings;

/// Number of bins of range, an octave each: the noise of depth cameras grows with range squared.
const N_BINS: usize = 16;
/// Exponent bits of 2⁻⁴ m, at which the first bin begins.
const FIRST_EXPONENT: u32 = 127 - 4;
/// Smallest number of samples of a bin that gives its own estimate.
const MIN_SAMPLES: usize = 48;
/// Quantile of the absolute second differences that is used: a low one, since edges and clutter
/// enlarge the upper ones.
const QUANTILE: f64 = 0.3;
/// The same quantile of |x| for a normal distribution with standard deviation 1.
const QUANTILE_OF_NORMAL: f32 = 0.3853;

/// Standard deviation of measured ranges as a function of range.
#[derive(Debug, Default)]
pub(crate) struct RangeNoise {
    base: f32,
    growth: f32,
    /// Ratio of measured to expected noise for each octave of range.
    factor: [f32; N_BINS],
    samples: Vec<Vec<f32>>,
}

#[inline]
fn bin(range: f32) -> usize {
    ((range.to_bits() >> 23).saturating_sub(FIRST_EXPONENT) as usize).min(N_BINS - 1)
}

impl RangeNoise {
    /// Standard deviation of a range, metres.
    #[inline]
    pub(crate) fn sigma(&self, range: f32) -> f32 {
        (self.base + self.growth * range) * self.factor[bin(range)]
    }

    /// Measures the noise from second differences of the inverse range along rows and along
    /// columns, which nearly vanish on a plane at any incidence. The larger of both counts, since
    /// some scanners have errors that are common to a line.
    pub(crate) fn measure(&mut self, xyzr: &[[f32; 4]], side: usize, settings: &Settings) {
        self.base = settings.noise as f32;
        self.growth = settings.noise_growth as f32;
        self.factor = [1.0; N_BINS];
        self.samples.resize(N_BINS, Vec::new());
        let limit = settings.noise_limit as f32;
        let mut factors = [None; N_BINS];
        for along in [1, side] {
            // Where the raster is finer than the data, direct neighbours are missing, and the
            // second next are used.
            for step in [1, 2] {
                self.samples.iter_mut().for_each(Vec::clear);
                self.sample(xyzr, side, step, along);
                if self.samples.iter().map(Vec::len).sum::<usize>() >= MIN_SAMPLES {
                    break;
                }
            }
            for (samples, factor) in self.samples.iter_mut().zip(&mut factors) {
                if samples.len() >= MIN_SAMPLES {
                    let at = (samples.len() as f64 * QUANTILE) as usize;
                    let value = *samples.select_nth_unstable_by(at, f32::total_cmp).1;
                    let value = (value / QUANTILE_OF_NORMAL).clamp(1.0, limit);
                    *factor = Some(factor.map_or(value, |f: f32| f.max(value)));
                }
            }
        }
        for b in 0..N_BINS {
            // A bin without enough samples takes the estimate of the nearest bin that has one.
            let nearest = (0..N_BINS)
                .filter(|&o| factors[o].is_some())
                .min_by_key(|&o| (o.abs_diff(b), o))
                .and_then(|o| factors[o]);
            self.factor[b] = nearest.unwrap_or(1.0);
        }
    }

    /// Collects second differences over neighbours `step` pixels apart, along rows (`along` = 1) or
    /// columns (`along` = length of a row).
    fn sample(&mut self, xyzr: &[[f32; 4]], side: usize, step: usize, along: usize) {
        // Every sixth pixel gives thousands of samples a tile at a small share of the work.
        let by = step * along;
        let (rows, cols) = if along == 1 { (0, step) } else { (step, 0) };
        for row in (rows..side - rows).step_by(3) {
            for col in (cols..side - cols).step_by(2) {
                let at = row * side + col;
                let (a, b, c) = (xyzr[at - by][3], xyzr[at][3], xyzr[at + by][3]);
                if a > 0.0 && b > 0.0 && c > 0.0 {
                    let second = 1.0 / a + 1.0 / c - 2.0 / b;
                    let expected = (self.base + self.growth * b) * 6_f32.sqrt();
                    self.samples[bin(b)].push(second.abs() * b * b / expected);
                }
            }
        }
    }
}
