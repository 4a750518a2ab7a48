//! Looks at the first records of a scan: where its points lie, whether beams without return are
//! among them, the step of its coordinates, and the range of its intensities.

use super::pages::Pages;
use super::points::{E57Points, WantedFields};
use super::scan::E57Scan;
use crate::frame::NO_RETURN;
use crate::settings::Settings;
use contract::Result;
use std::path::Path;

/// Number of records that are sampled, which takes a hundredth of a second.
const N_RECORDS: usize = 65_536;
/// Number of records that are decoded at once.
const BLOCK: usize = 4096;
/// Number of points by which it is judged whether the origin can be the scanner.
const N_JUDGED: usize = 64;

/// What the first records of a scan show; valid points only.
#[derive(Debug, Default)]
pub(super) struct E57Look {
    /// Points other than beams without return at the origin, file frame, metres.
    pub(super) points: Vec<[f64; 3]>,
    /// Number of points at the file's origin, and number of points looked at.
    pub(super) n_at_origin: usize,
    pub(super) n_looked: usize,
    /// Intensities as stored in the file.
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

    /// The first points, by which it is judged whether the origin can be the scanner.
    pub(super) fn first(&self) -> &[[f64; 3]] {
        &self.points[..self.points.len().min(N_JUDGED)]
    }

    /// The step of the coordinates, metres; `None` where it is fine enough.
    pub(super) fn step(&self) -> Option<f64> {
        crate::steps::coarse(&self.points)
    }
}
