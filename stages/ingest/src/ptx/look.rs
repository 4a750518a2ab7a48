//! Looks at some lines of a block: where its points lie, whether beams without return are among
//! them, the step of its coordinates, and the range of its intensities.

use crate::frame::NO_RETURN;
use crate::levels::Span;
use crate::text::numbers;

/// Number of first points by which it is judged whether the origin can be the scanner.
const N_JUDGED: usize = 64;
/// Approximate number of further lines that are sampled, evenly spread.
const N_LOOKED: u64 = 4096;

/// What the sampled lines of a block show.
#[derive(Debug)]
pub(super) struct PtxLook {
    /// Distance between the sampled lines with a point.
    every: u64,
    /// Metres per unit of the file.
    metres: f64,
    /// Points other than beams without return at the scanner, file frame, metres.
    pub(super) points: Vec<[f64; 3]>,
    /// Number of those at the beginning of the block.
    n_first: usize,
    /// Number of points at the scanner, and number of points looked at.
    pub(super) n_at_origin: usize,
    pub(super) n_looked: usize,
    /// Intensities as stored in the file.
    intensities: Vec<f64>,
}

impl PtxLook {
    /// Starts to look at a block of `n_lines` lines; `metres` is the length of the file's unit.
    pub(super) fn new(n_lines: u64, metres: f64) -> Self {
        let every = n_lines.div_ceil(N_LOOKED).max(1);
        let (points, intensities) = (Vec::new(), Vec::new());
        Self { every, metres, points, n_first: 0, n_at_origin: 0, n_looked: 0, intensities }
    }

    /// Takes the `n`th line with a point, which holds `n_columns` values. A word that is no number
    /// is refused when points are read; here its line is only skipped.
    pub(super) fn add(&mut self, n: u64, line: &[u8], n_columns: usize) {
        let is_first = self.points.len() < N_JUDGED;
        if !is_first && !n.is_multiple_of(self.every) {
            return;
        }
        let mut values = [f64::NAN; 4];
        let is_read = numbers(line, &mut values).is_ok();
        let p = [values[0], values[1], values[2]].map(|v| v * self.metres);
        if !is_read || p.iter().any(|v| !v.is_finite()) {
            return;
        }
        self.n_looked += 1;
        if p.iter().all(|v| v.abs() < NO_RETURN) {
            self.n_at_origin += 1;
            return;
        }
        self.points.push(p);
        self.n_first += usize::from(is_first);
        if let 4 | 7 = n_columns {
            self.intensities.push(values[3]);
        }
    }

    /// The first points, by which it is judged whether the origin can be the scanner.
    pub(super) fn first(&self) -> &[[f64; 3]] {
        &self.points[..self.n_first]
    }

    /// The step of the coordinates, metres; `None` where it is fine enough.
    pub(super) fn step(&self) -> Option<f64> {
        crate::steps::coarse(&self.points)
    }

    /// The intensities that become 0 and 65535, and a message where they are not from 0 to 1, as
    /// the format says.
    pub(super) fn intensity(&self) -> (Span, Option<String>) {
        Span { min: 0.0, max: 1.0 }.suited(&self.intensities, false)
    }
}
