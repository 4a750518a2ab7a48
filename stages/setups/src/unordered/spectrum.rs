//! Whether angles of many cells lie on combs of one step, whatever the phase in each cell.

use geometry::fourier::{self, Complex32, Fft};
use std::sync::Arc;

/// Histograms of angles in cells, and the sum of their spectra.
pub(crate) struct CellSpectrum {
    fft: Arc<dyn Fft<f32>>,
    n_bins: usize,
    /// Width of a cell, radians.
    width: f64,
    counts: Vec<u16>,
    n: Vec<u32>,
    used: Vec<u32>,
    buffer: Vec<Complex32>,
    scratch: Vec<Complex32>,
    power: Vec<f64>,
}

/// The clearest comb of a spectrum.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CombPeak {
    /// How many standard deviations the power lies above that of angles without order.
    pub(crate) z: f64,
    /// Step, radians.
    pub(crate) step: f64,
}

/// Longest and shortest step of a comb, radians.
const STEPS: [f64; 2] = [0.0106, 0.00026];
/// Fewest angles of a cell.
const IN_CELL: u32 = 6;

impl CellSpectrum {
    /// For cells of a width in radians.
    pub(crate) fn new(n_cells: usize, n_bins: usize, width: f64) -> Self {
        let fft = fourier::forward(n_bins);
        let scratch = vec![Complex32::default(); fft.get_inplace_scratch_len()];
        Self {
            fft,
            n_bins,
            width,
            counts: vec![0; n_cells * n_bins],
            n: vec![0; n_cells],
            used: Vec::new(),
            buffer: vec![Complex32::default(); n_bins],
            scratch,
            power: vec![0.0; n_bins / 2],
        }
    }

    /// Adds an angle within its cell, 0 to the width.
    pub(crate) fn add(&mut self, cell: usize, angle: f64) {
        let bin = ((angle / self.width * self.n_bins as f64) as usize).min(self.n_bins - 1);
        if self.n[cell] == 0 {
            self.used.push(cell as u32);
        }
        self.n[cell] += 1;
        let slot = &mut self.counts[cell * self.n_bins + bin];
        *slot = slot.saturating_add(1);
    }

    /// The clearest comb, and empties the cells.
    pub(crate) fn clearest(&mut self) -> CombPeak {
        self.used.sort_unstable();
        let used = std::mem::take(&mut self.used);
        self.power.fill(0.0);
        let full: Vec<usize> =
            used.iter().map(|c| *c as usize).filter(|c| self.n[*c] >= IN_CELL).collect();
        for pair in full.chunks(2) {
            self.sum(pair);
        }
        for cell in used {
            let cell = cell as usize;
            self.n[cell] = 0;
            self.counts[cell * self.n_bins..(cell + 1) * self.n_bins].fill(0);
        }
        let cells = full.len().max(1) as f64;
        let first = (self.width / STEPS[0]).ceil() as usize;
        let last = ((self.width / STEPS[1]) as usize).min(self.n_bins / 2 - 1);
        let most = (first..=last).max_by(|a, b| self.power[*a].total_cmp(&self.power[*b]));
        let Some(most) = most else { return CombPeak { z: 0.0, step: 1.0 } };
        let z = (self.power[most] - cells) / cells.sqrt();
        let p = |k: usize| self.power.get(k).map_or(0.0, |p| (p - cells).max(0.0));
        let sum = p(most - 1) + p(most) + p(most + 1);
        let off = if sum > 0.0 { (p(most + 1) - p(most - 1)) / sum } else { 0.0 };
        CombPeak { z, step: self.width / (most as f64 + off) }
    }

    /// Adds the spectra of one or two cells: one is the real part of the transform, the other the
    /// imaginary one.
    fn sum(&mut self, pair: &[usize]) {
        let n = self.n_bins;
        let counts = |cell: usize| &self.counts[cell * n..(cell + 1) * n];
        let first = counts(pair[0]);
        for (i, value) in self.buffer.iter_mut().enumerate() {
            let second = pair.get(1).map_or(0, |cell| counts(*cell)[i]);
            *value = Complex32::new(f32::from(first[i]), f32::from(second));
        }
        self.fft.process_with_scratch(&mut self.buffer, &mut self.scratch);
        let of = |i: usize| self.n[pair[i]] as f32;
        let (n0, n1) = (of(0), pair.get(1).map_or(1.0, |_| of(1)));
        for k in 1..n / 2 {
            let (z, w) = (self.buffer[k], self.buffer[n - k].conj());
            let power = 0.25 * ((z + w).norm_sqr() / n0 + (z - w).norm_sqr() / n1);
            self.power[k] += f64::from(power);
        }
    }
}
