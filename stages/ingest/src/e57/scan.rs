//! Reads from the description of one scan in an E57 file which of its fields hold coordinates,
//! intensity, rows and columns.

use crate::frame::FileFrame;
use crate::levels::Span;
use crate::reader::MaskSeed;
use contract::{Error, Result};
use e57::{PointCloud, Record, RecordDataType, RecordName, RecordValue};
use geometry::Pose;

/// Which fields hold the coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Coordinates {
    /// x, y, z.
    Cartesian([usize; 3]),
    /// Range, azimuth, elevation.
    Spherical([usize; 3]),
}

/// A field whose values are scaled to 0..65535.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Channel {
    /// Index of the field.
    pub(super) field: usize,
    /// The values that become 0 and 65535.
    pub(super) span: Span,
}

/// One scan of the file.
#[derive(Debug, Clone)]
pub(super) struct E57Scan {
    /// Offset of its points in the file.
    pub(super) file_offset: u64,
    /// Number of records that it announces.
    pub(super) n_records: u64,
    /// Fields of a record.
    pub(super) prototype: Vec<Record>,
    /// The coordinate fields; `None` for a scan without points that names none.
    pub(super) coordinates: Option<Coordinates>,
    /// The field that flags coordinates as invalid.
    pub(super) state: Option<usize>,
    /// Fields of row and column.
    pub(super) native: Option<[usize; 2]>,
    /// Field of the intensity.
    pub(super) intensity: Option<Channel>,
    /// Fields of the colour.
    pub(super) color: Option<[Channel; 3]>,
    /// Metres per unit of the file.
    pub(super) metres: f64,
    /// Conversion from the file's coordinates (metres) to the scan frame.
    pub(super) frame: FileFrame,
}

impl E57Scan {
    /// The mask of this scan.
    pub(super) fn mask(&self, name: &str) -> MaskSeed {
        let n_stated = Some(self.n_records);
        MaskSeed { name: name.into(), n_points: self.n_valid(), n_stated }
    }

    /// Number of points that the file does not flag as invalid, where it is known without reading
    /// them.
    pub(super) fn n_valid(&self) -> Option<u64> {
        match self.state.map(|field| &self.prototype[field].data_type) {
            None | Some(RecordDataType::Integer { min: 0, max: 0 }) => Some(self.n_records),
            Some(_) => (self.n_records == 0).then_some(0),
        }
    }

    /// Finds the fields by their names.
    pub(super) fn fields(cloud: &PointCloud) -> Result<Self> {
        let find = |name: RecordName| cloud.prototype.iter().position(|r| r.name == name);
        let three = |names: [RecordName; 3]| -> Option<[usize; 3]> {
            let [a, b, c] = names.map(find);
            Some([a?, b?, c?])
        };
        for (n, record) in cloud.prototype.iter().enumerate() {
            if find(record.name.clone()) != Some(n) {
                return Err(Error::bad_input(format!(
                    "scan names a field twice, \"{:?}\"",
                    record.name
                )));
            }
        }
        let cartesian =
            three([RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ]);
        let spherical = three([
            RecordName::SphericalRange,
            RecordName::SphericalAzimuth,
            RecordName::SphericalElevation,
        ]);
        let (coordinates, state) = match (cartesian, spherical) {
            (Some(xyz), _) => {
                (Some(Coordinates::Cartesian(xyz)), RecordName::CartesianInvalidState)
            }
            (None, Some(rae)) => {
                (Some(Coordinates::Spherical(rae)), RecordName::SphericalInvalidState)
            }
            (None, None) => (None, RecordName::CartesianInvalidState),
        };
        Ok(Self {
            file_offset: cloud.file_offset,
            n_records: cloud.records,
            prototype: cloud.prototype.clone(),
            coordinates,
            state: find(state),
            native: find(RecordName::RowIndex)
                .zip(find(RecordName::ColumnIndex))
                .map(|(row, col)| [row, col]),
            intensity: None,
            color: None,
            metres: 1.0,
            frame: FileFrame::of_scanner(Pose::identity()),
        })
    }

    /// Finds intensity, colour and their spans; returns whether the file states that of the
    /// intensity.
    pub(super) fn channels(&mut self, cloud: &PointCloud) -> bool {
        let channel = |name: RecordName, limits: Option<[&Option<RecordValue>; 2]>| {
            let field = cloud.prototype.iter().position(|r| r.name == name)?;
            let data_type = &cloud.prototype[field].data_type;
            let span = limits
                .and_then(|[min, max]| {
                    let value = |v: &Option<RecordValue>| v.as_ref()?.to_f64(data_type).ok();
                    Some([value(min)?, value(max)?])
                })
                .filter(is_span)
                .or_else(|| type_span(data_type).filter(is_span));
            let [min, max] = span.unwrap_or([0.0, 1.0]);
            Some((Channel { field, span: Span { min, max } }, span.is_some()))
        };
        let limits = cloud.intensity_limits.as_ref().map(|l| [&l.intensity_min, &l.intensity_max]);
        let intensity = channel(RecordName::Intensity, limits);
        self.intensity = intensity.map(|(channel, _)| channel);
        let limits = cloud.color_limits.as_ref();
        let red = channel(RecordName::ColorRed, limits.map(|l| [&l.red_min, &l.red_max]));
        let green = channel(RecordName::ColorGreen, limits.map(|l| [&l.green_min, &l.green_max]));
        let blue = channel(RecordName::ColorBlue, limits.map(|l| [&l.blue_min, &l.blue_max]));
        self.color = match (red, green, blue) {
            (Some((red, _)), Some((green, _)), Some((blue, _))) => Some([red, green, blue]),
            _ => None,
        };
        intensity.is_some_and(|(_, is_stated)| is_stated)
    }
}

/// Whether two values are finite limits in ascending order.
fn is_span(span: &[f64; 2]) -> bool {
    span.iter().all(|v| v.is_finite()) && span[1] > span[0]
}

/// The values that a field can hold, where its type bounds them.
fn type_span(data_type: &RecordDataType) -> Option<[f64; 2]> {
    match *data_type {
        RecordDataType::Single { min, max } => Some([f64::from(min?), f64::from(max?)]),
        RecordDataType::Double { min, max } => Some([min?, max?]),
        RecordDataType::Integer { min, max } => {
            (min > i64::MIN && max < i64::MAX).then_some([min as f64, max as f64])
        }
        RecordDataType::ScaledInteger { min, max, scale, offset } => {
            Some([min as f64 * scale + offset, max as f64 * scale + offset])
        }
    }
}
