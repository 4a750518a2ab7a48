//! The first records of a scan in; what they say of it out: where its points lie, whether beams
//! without return are among them, how coarse its coordinates are, and what its intensities span.

use super::pages::Pages;
use super::points::{E57Points, WantedFields};
use super::scan::E57Scan;
use crate::Settings;
use crate::frame::NO_RETURN;
use contract::Result;
use std::path::Path;

/// Records that are looked at: a hundredth of a second.
const N_RECORDS: usize = 65_536;
/// Records that are decoded at once.
const BLOCK: usize = 4096;
/// Points that the scanner's reach is judged by.
const N_JUDGED: usize = 64;

/// What a look at a scan shows; valid points only.
#[derive(Debug, Default)]
pub(super) struct E57Look {
    /// Points that are no returns at the origin, file's frame.
    pub(super) points: Vec<[f64; 3]>,
    /// How many lie at the file's origin, and how many were looked at.
    pub(super) n_at_origin: usize,
    pub(super) n_looked: usize,
    /// As the file has them.
    pub(super) intensities: Vec<f64>,
}

impl E57Look {
    /// Looks at the first records of a scan.
    pub(super) fn at(scan: &E57Scan, path: &Path, settings: &Settings) -> Result<Self> {
        let mut look = Self::default();
        if scan.n_records == 0 {
            return Ok(look);
        }
        let mut points = E57Points::open(scan, Pages::open(path)?, WantedFields::Attributes)?;
        let mut n_seen = 0;
        while n_seen < N_RECORDS {
            let n = points.next_block(settings.strip_points.min(BLOCK))?;
            if n == 0 {
                break;
            }
            n_seen += n;
            for i in (0..n).filter(|i| points.is_valid(*i)) {
                look.add(points.xyz(i), points.raw_intensity(i));
            }
        }
        Ok(look)
    }

    fn add(&mut self, p: [f64; 3], intensity: Option<f64>) {
        if p.iter().any(|v| !v.is_finite()) {
            return;
        }
        self.n_looked += 1;
        if p.iter().all(|v| v.abs() < NO_RETURN) {
            self.n_at_origin += 1;
            return;
        }
        self.points.push(p);
        self.intensities.extend(intensity);
    }

    /// Points that the scanner's reach is judged by: the first ones.
    pub(super) fn first(&self) -> &[[f64; 3]] {
        &self.points[..self.points.len().min(N_JUDGED)]
    }

    /// The step of the coordinates, metres, where it is coarse.
    pub(super) fn step(&self) -> Option<f64> {
        crate::steps::coarse(&self.points)
    }
}
