//! What is found in points without order, and why nothing is.

use contract::PointRaster;
use geometry::Pose;

/// A place where a scanner stood, found from points in no order.
#[derive(Debug, Clone, PartialEq)]
pub struct RasterSetup {
    /// The scanner in the frame of the points: origin at the scanner, z along its axis; how it is
    /// turned about the axis is arbitrary.
    pub world_from_scanner: Pose,
    /// Standard deviation of the position along each axis of the world, metres.
    pub sigma: [f64; 3],
    /// Azimuth between columns and elevation between rows, radians; either may be a part of the
    /// true step.
    pub steps: [f64; 2],
    /// The raster that its points are told by; `None` where these scatter so much that as many of
    /// others would pass for them.
    pub raster: Option<PointRaster>,
    /// How clear it is.
    pub evidence: RasterEvidence,
}

/// How clear a setup is that was found from points in no order. Pairs are of azimuths and of
/// elevations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RasterEvidence {
    /// Power of the comb of azimuths on the floor about the place above chance, in standard
    /// deviations of chance.
    pub floor_clearness: f64,
    /// Length of the mean phasor of the points on the floor: azimuths of all, elevations of those
    /// in its columns.
    pub coherence: [f64; 2],
    /// Clearness of the combs over directions all round, as [`crate::SetupEvidence::clearness`].
    pub clearness: [f64; 2],
    /// Number of separate directions.
    pub n_cells: usize,
    /// Share of the points that lie on both combs beyond those that chance puts there.
    pub share: f64,
    /// Share of the points that lie beside both combs as those of others do.
    pub beside: f64,
    /// Standard deviations of the angles about the combs, radians.
    pub angle_sigmas: [f64; 2],
}

/// Why no setup was found in points without order, or none for some of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UnorderedCause {
    /// There is no level floor with enough points.
    NoFloor,
    /// The points of the floor show no raster about any place.
    NoPattern,
    /// Some places look like those of a scanner, but from none do azimuths and elevations lie on
    /// combs.
    NoComb,
    /// Setups were found, but explain a part of the points only.
    Part,
}

/// What was found in points without order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FoundRasters {
    /// The setups, those with more points first.
    pub setups: Vec<RasterSetup>,
    /// Whether all points are those of the only setup.
    pub is_alone: bool,
    /// Why there is none, or none for some points.
    pub cause: Option<UnorderedCause>,
    /// Share of the points that the setups explain.
    pub explained: f64,
}

impl FoundRasters {
    /// About the share of the points that are surely those of a setup: they are on its raster and
    /// beside those of all others.
    #[must_use]
    pub fn told(&self, setup: usize) -> f64 {
        let Some(own) = self.setups.get(setup) else { return 0.0 };
        let others = self.setups.iter().enumerate().filter(|(i, _)| *i != setup);
        let rasters = others.filter_map(|(_, other)| other.raster.as_ref());
        let beside = rasters.map(|raster| 1.0 - 4.0 * raster.apart[0] * raster.apart[1]);
        own.evidence.share * beside.product::<f64>()
    }
}

impl UnorderedCause {
    /// The cause in words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::NoFloor => {
                "without order scanners are found from the floor about them, and there is no level floor with enough points"
            }
            Self::NoPattern => {
                "the points of the floor show the pattern of a raster about no place (too few \
                 points, centroids of large voxels, scanners above 4 m, or a scanner that moved)"
            }
            Self::NoComb => {
                "from no place do azimuths and elevations lie on the raster of a scanner that stood \
                 still"
            }
            Self::Part => "the scanners that were found explain a part of the points only",
        }
    }
}
