//! What is given and what is found: windows of points, setups, and why there is none.

use geometry::{Pose, Vector};

/// Points that follow one another in a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ScanWindow {
    /// Place of the first point in its file.
    pub place: u64,
    /// What the file says of whose points these are (`point_source_id`, number of the scan).
    pub source: u32,
    /// Coordinates in one frame, metres.
    pub points: Vec<[f64; 3]>,
}

/// SetupLimits of the search. None of them decides whether a found setup is accepted.
#[derive(Debug, Clone, PartialEq)]
pub struct SetupLimits {
    /// Largest deviation of a run of points from its plane, metres RMS. Coarse old scanners have
    /// 10 mm.
    pub max_plane_rms: f64,
    /// Fewest points of a run: with fewer its plane is too uncertain.
    pub min_run_points: usize,
    /// Number of pairs of planes that are tried for one axis.
    pub n_pairs: usize,
    /// Largest number of setups.
    pub max_setups: usize,
}

impl Default for SetupLimits {
    fn default() -> Self {
        Self { max_plane_rms: 0.012, min_run_points: 40, n_pairs: 3_000, max_setups: 512 }
    }
}

/// How clear a setup is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SetupEvidence {
    /// Number of runs of points whose planes contain the axis.
    pub n_planes: usize,
    /// Number of points of which the elevations were compared with the comb.
    pub n_points: usize,
    /// Length of the mean phasor of the elevations on the comb: 1 where all lie on it, near 0 for
    /// elevations without order.
    pub coherence: f64,
    /// Number of separate directions (cells of a few degrees) with a phase of their own.
    pub n_cells: usize,
    /// Clearness of the comb: `|sum of phasors|²/(number)` over the cells. By chance it exceeds `z`
    /// with a probability of at most about `exp(-z)` a trial.
    pub clearness: f64,
    /// Standard deviation of the elevations about the comb, radians.
    pub elevation_sigma: f64,
    /// Standard deviation of the points about the planes of their columns, radians.
    pub azimuth_sigma: f64,
}

/// A place where a scanner stood.
#[derive(Debug, Clone, PartialEq)]
pub struct Setup {
    /// The scanner in the frame of the points: origin at the scanner, z along its axis; how it is
    /// turned about the axis is arbitrary.
    pub world_from_scanner: Pose,
    /// Standard deviation of the position along each axis of the world, metres.
    pub sigma: [f64; 3],
    /// Elevation of a row, and elevation between rows, radians.
    pub comb: [f64; 2],
    /// Azimuth between columns, radians, where neighbouring columns were seen.
    pub col_step: Option<f64>,
    /// Whether elevations beyond the zenith belong to the comb (columns that go on over the top),
    /// so that the file's own direction of columns tells the sides apart.
    pub(crate) by_direction: bool,
    /// How clear it is.
    pub evidence: SetupEvidence,
}

impl Setup {
    /// Position of the scanner in the frame of the points, metres.
    #[must_use]
    pub fn position(&self) -> [f64; 3] {
        self.world_from_scanner.translation.vector.into()
    }

    /// Largest standard deviation of the position along an axis, metres.
    #[must_use]
    pub fn largest_sigma(&self) -> f64 {
        self.sigma.iter().fold(0.0, |most, s| s.max(most))
    }

    /// Angle between the scanner's axis and the vertical, radians, at most a right angle.
    #[must_use]
    pub fn tilt(&self) -> f64 {
        let axis = self.world_from_scanner.rotation * Vector::z();
        axis.z.abs().min(1.0).acos()
    }
}

/// Why no setup was found, or no further one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// There are too few points to tell.
    FewPoints,
    /// Points that follow one another in the file do not lie in planes: they are not in the order
    /// in which a terrestrial scanner measures, or the scanner moved.
    NoColumns,
    /// Columns were found, but no axis that many of them share.
    NoAxis,
    /// An axis was found, but no place on it from which the elevations lie on a comb.
    NoComb,
}

impl Cause {
    /// The cause in words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::FewPoints => "too few points",
            Self::NoColumns => {
                "points are not in the order of the columns of a scanner that stands still \
                 (shuffled, thinned, sorted, measured by rows, or by a scanner that moved)"
            }
            Self::NoAxis => "columns of points share no axis about which a scanner would turn",
            Self::NoComb => {
                "from no place on the common axis of the columns are elevations equally spaced"
            }
        }
    }
}
