//! The output of the simulator: a scan's frame, and its columns of beams as a structure of arrays.

use crate::scene::BeamRaster;
use contract::Label;
use geometry::{Pose, Vector, direction};

/// The properties of a scan that files state before its points.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanFrame {
    /// Name of the scan.
    pub name: String,
    /// Pose of the scan that files state, with scene origin and registration error, metres.
    pub world_from_scan: Pose,
    /// True pose of the scan, with scene origin, metres.
    pub true_world_from_scan: Pose,
    /// Directions of rows and columns in the scan frame.
    pub raster: BeamRaster,
    /// Number of rows, counted from the lowest elevation.
    pub n_rows: u32,
    /// Number of columns, counter-clockwise.
    pub n_cols: u32,
}

/// Beams of some neighbouring columns of one scan, column by column, rows upwards: beam `i` is row
/// `i % n_rows` of column `first_col + i / n_rows`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SimColumns {
    /// Index of the first column.
    pub first_col: u32,
    /// Number of rows of each column.
    pub n_rows: u32,
    /// Whether the beam returned.
    pub hit: Vec<bool>,
    /// Measured range, metres; 0 for a beam without return.
    pub range: Vec<f64>,
    /// Measured point in the scan frame (the range along the stated direction), metres; zero for a
    /// beam without return.
    pub xyz: Vec<[f64; 3]>,
    /// Strength of the return, 0..1.
    pub intensity: Vec<f32>,
    /// True label of the point; uncertain for a beam without return.
    pub label: Vec<Label>,
    /// Index of the object that it belongs to in [`crate::Truth::objects`]; 0 for a beam without
    /// return.
    pub object: Vec<u16>,
    /// Whether the range is a mean over surfaces more than 3 cm apart. The point may then lie
    /// between surfaces; its label is that of the nearest part.
    pub mixed: Vec<bool>,
}

impl SimColumns {
    /// Number of beams.
    #[must_use]
    pub fn len(&self) -> usize {
        self.hit.len()
    }

    /// Whether there are no beams.
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

    /// Number of beams that returned.
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
    /// The properties that files state.
    pub frame: ScanFrame,
    /// All its beams.
    pub columns: SimColumns,
}

/// The result of one beam.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Return {
    pub(crate) range: f64,
    pub(crate) intensity: f32,
    pub(crate) label: Label,
    pub(crate) object: u16,
    pub(crate) is_mixed: bool,
}

impl ScanFrame {
    /// Stated direction through the middle of a pixel, unit length, scan frame.
    #[must_use]
    pub fn direction(&self, row: u32, col: u32) -> [f64; 3] {
        direction::unit(self.raster.azimuth(col), self.raster.elevation(row))
    }
}
