//! Some lines of a block in; what they say of all out: where its points lie, whether beams without
//! return are among them, how coarse its coordinates are, and what its intensities span.

use crate::frame::NO_RETURN;
use crate::levels::Span;
use crate::text::numbers;

/// First points of a block, by which the scanner's reach is judged.
const N_JUDGED: usize = 64;
/// About so many lines of a block are looked at besides, evenly spread.
const N_LOOKED: u64 = 4096;

/// What those lines show.
#[derive(Debug)]
pub(super) struct PtxLook {
    /// Every so manieth line with a point is looked at.
    every: u64,
    /// Metres of one unit of the file.
    metres: f64,
    /// Coordinates of points that are no returns at the scanner, file's frame, metres.
    pub(super) points: Vec<[f64; 3]>,
    /// How many of those are of the block's beginning.
    n_first: usize,
    /// How many lie at the scanner, and how many were looked at.
    pub(super) n_at_origin: usize,
    pub(super) n_looked: usize,
    /// As the file has them.
    intensities: Vec<f64>,
}

impl PtxLook {
    /// At a block of so many lines, in a unit of so many metres.
    pub(super) fn new(n_lines: u64, metres: f64) -> Self {
        let every = n_lines.div_ceil(N_LOOKED).max(1);
        let (points, intensities) = (Vec::new(), Vec::new());
        Self { every, metres, points, n_first: 0, n_at_origin: 0, n_looked: 0, intensities }
    }

    /// Takes a line with a point, the `n`th of them, of so many numbers; what is no number is
    /// refused when points are read, here it is only left out.
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

    /// Points that the scanner's reach is judged by: the first ones.
    pub(super) fn first(&self) -> &[[f64; 3]] {
        &self.points[..self.n_first]
    }

    /// The step of the coordinates, metres, where it is coarse.
    pub(super) fn step(&self) -> Option<f64> {
        crate::steps::coarse(&self.points)
    }

    /// Which intensities become 0 and 65535, and what is odd about that: the format has them from 0
    /// to 1.
    pub(super) fn intensity(&self) -> (Span, Option<String>) {
        Span { min: 0.0, max: 1.0 }.suited(&self.intensities, false)
    }
}
