//! A strip: consecutive points of one scan as they were read, in the order of the file.

use crate::{MaskId, ScanId, Weigh};

/// Consecutive points of one scan, in the order of the file; points that the file flags as invalid
/// are not in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Strip {
    /// Whose points these are.
    pub scan: ScanId,
    /// The mask that labels them.
    pub mask: MaskId,
    /// Place in the mask of the smallest place here.
    pub first_place: u64,
    /// Place in the mask of each point, less `first_place`; ascending. Points that were dropped
    /// (not a number, not finite) leave a gap.
    pub place: Vec<u32>,
    /// Scan frame, metres.
    pub xyz: Vec<[f32; 3]>,
    /// Everything else that the file says of the points; only where asked for.
    pub attributes: Option<Attributes>,
}

/// Columns beside the coordinates, one entry a point of the strip; a column that the file lacks is
/// empty.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Attributes {
    /// World coordinates as the file states them (with its pose applied), metres.
    pub world: Vec<[f64; 3]>,
    /// 0..65535.
    pub intensity: Vec<u16>,
    /// 0..65535 a channel.
    pub color: Vec<[u16; 3]>,
    /// LAS GPS time.
    pub gps_time: Vec<f64>,
    /// LAS classification as read.
    pub classification: Vec<u8>,
    /// LAS point source id.
    pub source_id: Vec<u16>,
}

impl Strip {
    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.xyz.len()
    }

    /// Holds no point.
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
