//! The forms in which beams leave the simulator: a scan's frame, and its columns as a structure of
//! arrays.

use crate::scene::BeamRaster;
use contract::Label;
use geometry::{Pose, Vector, direction};

/// What a file says about a scan before its points.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanFrame {
    /// Name of the scan.
    pub name: String,
    /// Pose that files state: scene origin and registration error included.
    pub world_from_scan: Pose,
    /// True pose, scene origin included.
    pub true_world_from_scan: Pose,
    /// Directions of rows and columns in the scan frame.
    pub raster: BeamRaster,
    /// Number of rows, from the lowest elevation up.
    pub n_rows: u32,
    /// Number of columns, counter-clockwise.
    pub n_cols: u32,
}

/// Beams of some neighbouring columns of one scan, column by column, rows upwards: beam `i` is row
/// `i % n_rows` of column `first_col + i / n_rows`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SimColumns {
    /// First column.
    pub first_col: u32,
    /// Rows of each column.
    pub n_rows: u32,
    /// Whether the beam came back.
    pub hit: Vec<bool>,
    /// Measured range, metres; 0 where it did not come back.
    pub range: Vec<f64>,
    /// Measured point in the scan frame (range along the stated direction), metres; zero where it
    /// did not come back.
    pub xyz: Vec<[f64; 3]>,
    /// Strength of the return, 0..1.
    pub intensity: Vec<f32>,
    /// What the point belongs to; uncertain where the beam did not come back.
    pub label: Vec<Label>,
    /// Index of the thing it belongs to in [`crate::Truth::objects`]; 0 where the beam did not
    /// come back.
    pub object: Vec<u16>,
    /// Whether the range is a mean over surfaces more than 3 cm apart: the point may hang in the
    /// air, and its label is that of the nearest part.
    pub mixed: Vec<bool>,
}

impl SimColumns {
    /// Number of beams.
    #[must_use]
    pub fn len(&self) -> usize {
        self.hit.len()
    }

    /// Holds no beam.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.hit.is_empty()
    }

    /// Row and column of beam `i`.
    #[must_use]
    pub fn pixel(&self, i: usize) -> (u32, u32) {
        let n = self.n_rows.max(1) as usize;
        ((i % n) as u32, self.first_col + (i / n) as u32)
    }

    /// Number of beams that came back.
    #[must_use]
    pub fn n_points(&self) -> usize {
        self.hit.iter().filter(|h| **h).count()
    }

    pub(crate) fn push(&mut self, beam: Option<Return>, stated: &Vector) {
        let empty = Return {
            range: 0.0,
            intensity: 0.0,
            label: Label::UNCERTAIN,
            object: 0,
            is_mixed: false,
        };
        let r = beam.unwrap_or(empty);
        self.hit.push(beam.is_some());
        self.range.push(r.range);
        self.xyz.push((stated * r.range).into());
        self.intensity.push(r.intensity);
        self.label.push(r.label);
        self.object.push(r.object);
        self.mixed.push(r.is_mixed);
    }

    pub(crate) fn with_capacity(first_col: u32, n_rows: u32, n: usize) -> Self {
        Self {
            first_col,
            n_rows,
            hit: Vec::with_capacity(n),
            range: Vec::with_capacity(n),
            xyz: Vec::with_capacity(n),
            intensity: Vec::with_capacity(n),
            label: Vec::with_capacity(n),
            object: Vec::with_capacity(n),
            mixed: Vec::with_capacity(n),
        }
    }
}

/// A whole scan in memory.
#[derive(Debug, Clone)]
pub struct SimScan {
    /// What a file says about it.
    pub frame: ScanFrame,
    /// All its beams.
    pub columns: SimColumns,
}

/// One beam's answer.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Return {
    pub(crate) range: f64,
    pub(crate) intensity: f32,
    pub(crate) label: Label,
    pub(crate) object: u16,
    pub(crate) is_mixed: bool,
}

impl ScanFrame {
    /// Stated direction of a pixel's middle in the scan frame.
    #[must_use]
    pub fn direction(&self, row: u32, col: u32) -> [f64; 3] {
        direction::unit(self.raster.azimuth(col), self.raster.elevation(row))
    }
}
