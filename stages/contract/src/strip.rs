//! A strip: consecutive points of one scan, in the order of the file.

use crate::{MaskId, ScanId, Weigh};

/// Consecutive points of one scan, in the order of the file. Points that the file flags as invalid
/// are left out.
#[derive(Debug, Clone, PartialEq)]
pub struct Strip {
    /// The scan of the points.
    pub scan: ScanId,
    /// The mask that labels the points.
    pub mask: MaskId,
    /// Smallest place in the mask of the points of this strip.
    pub first_place: u64,
    /// Place in the mask of each point, less `first_place`; ascending. Points with coordinates
    /// that are not finite are dropped and leave a gap.
    pub place: Vec<u32>,
    /// Coordinates in the scan frame, metres.
    pub xyz: Vec<[f32; 3]>,
    /// All other attributes of the points in the file, where requested.
    pub attributes: Option<Attributes>,
}

/// Attributes beside the coordinates, one entry a point of the strip. A column is empty where the
/// file lacks the attribute.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Attributes {
    /// World coordinates as the file states them (with its pose applied), metres.
    pub world: Vec<[f64; 3]>,
    /// Intensity, scaled to 0..65535.
    pub intensity: Vec<u16>,
    /// Red, green and blue, each scaled to 0..65535.
    pub color: Vec<[u16; 3]>,
    /// GPS time of LAS, unchanged.
    pub gps_time: Vec<f64>,
    /// Classification of LAS, unchanged.
    pub classification: Vec<u8>,
    /// Point source id of LAS, unchanged.
    pub source_id: Vec<u16>,
}

impl Strip {
    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.xyz.len()
    }

    /// Whether the strip has no points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.xyz.is_empty()
    }
}

impl Weigh for Strip {
    fn weight_bytes(&self) -> usize {
        let attributes = self.attributes.as_ref().map_or(0, |a| {
            a.world.len() * 24
                + a.intensity.len() * 2
                + a.color.len() * 6
                + a.gps_time.len() * 8
                + a.classification.len()
                + a.source_id.len() * 2
        });
        size_of::<Self>() + self.place.len() * 4 + self.xyz.len() * 12 + attributes
    }

    fn n_points(&self) -> u64 {
        self.len() as u64
    }
}
