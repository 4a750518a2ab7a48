//! Interprets the description of one scan of an E57 file: the meaning of its fields, pose and
//! frame.

use super::look::Look;
use crate::Settings;
use crate::frame::{self, Frame};
use crate::levels::Span;
use crate::oddities::no_returns_note;
use crate::reader::{MaskSeed, ScanSeed};
use contract::{Error, Kind, Result};
use e57::{PointCloud, Record, RecordDataType, RecordName, RecordValue};
use geometry::{Aabb, Point, Pose};
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use std::path::Path;

/// Share of points at the origin from which on they are taken for beams without return, in a scan
/// whose scanner is unknown: a single point there may have been measured.
const NO_RETURNS: f64 = 0.005;
/// A scan of fewer points is an example of a writer, in which the origin may be a real point.
const FEW: usize = 64;

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
    pub(super) frame: Frame,
}

impl E57Scan {
    /// Reads the description, and some points to judge whether the origin can be the scanner.
    pub(super) fn new(
        path: &Path,
        cloud: &PointCloud,
        (name, metres): (&str, f64),
        settings: &Settings,
    ) -> Result<(Self, ScanSeed)> {
        let mut notes = Vec::new();
        let pose = pose(cloud, metres)?;
        let mut scan = Self { metres, ..Self::fields(cloud)? };
        if scan.coordinates.is_none() && scan.n_records > 0 {
            return Err(Error::new(
                Kind::Unsupported,
                "scan has neither Cartesian nor spherical coordinates",
            ));
        }
        let is_stated = scan.channels(cloud);
        let bounds = bounds(cloud, metres);
        let look = Look::at(&scan, path, settings)?;
        scan.suit_intensity(&look, is_stated, &mut notes);
        scan.frame = scan.judge(cloud, pose, bounds.as_ref(), &look, &mut notes);
        let (step, n_valid) = (look.step(), scan.n_valid());
        let share = 1.0 - look.n_at_origin as f64 / look.n_looked.max(1) as f64;
        let likely = n_valid.filter(|_| share < 1.0).map(|n| (n as f64 * share) as u64);
        notes.extend(step.map(crate::steps::note));
        if scan.n_records == 0 {
            notes.push("scan has no points".into());
        } else if scan.native.is_none() && scan.frame.scanner_known {
            notes.push(
                "no rows and columns: the raster is rebuilt from the directions of the points"
                    .into(),
            );
        }
        let stated_bounds = bounds
            .map(|b| Aabb::of(b.corners().map(|corner| (pose * Point::from(corner)).coords.into())))
            .filter(|b| b.min.iter().chain(&b.max).all(|v| v.is_finite()));
        let seed = ScanSeed {
            name: name.into(),
            mask: 0,
            source_id: None,
            world_from_scan: scan.frame.world_from_scan,
            scanner_known: scan.frame.scanner_known,
            stated_bounds,
            stated_points: n_valid,
            likely_points: likely,
            notes,
            step,
        };
        Ok((scan, seed))
    }

    /// The mask of this scan.
    pub(super) fn mask(&self, name: &str) -> MaskSeed {
        let n_stated = Some(self.n_records);
        MaskSeed { name: name.into(), n_points: self.n_valid(), n_stated }
    }

    /// Number of points that the file does not flag as invalid, where it is known without reading
    /// them.
    fn n_valid(&self) -> Option<u64> {
        match self.state.map(|field| &self.prototype[field].data_type) {
            None | Some(RecordDataType::Integer { min: 0, max: 0 }) => Some(self.n_records),
            Some(_) => (self.n_records == 0).then_some(0),
        }
    }

    /// Finds the fields by their names.
    fn fields(cloud: &PointCloud) -> Result<Self> {
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
            frame: Frame::of_scanner(Pose::identity()),
        })
    }

    /// Finds intensity, colour and their spans; returns whether the file states that of the
    /// intensity.
    fn channels(&mut self, cloud: &PointCloud) -> bool {
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

    /// Replaces the span of the intensity by that of its values where most lie outside the limits.
    fn suit_intensity(&mut self, look: &Look, is_stated: bool, notes: &mut Vec<String>) {
        let Some(channel) = &mut self.intensity else { return };
        let (span, note) = channel.span.suited(&look.intensities, is_stated);
        channel.span = span;
        match note {
            Some(note) => notes.push(note),
            None if !is_stated => notes.push(
                "intensity has no stated limits: taken as 0 to 1, values outside are cut".into(),
            ),
            None => {}
        }
    }

    /// Chooses the scan frame: the file's own where its origin can be the scanner, else one with an
    /// origin near the points.
    fn judge(
        &self,
        cloud: &PointCloud,
        pose: Pose,
        bounds: Option<&Aabb>,
        look: &Look,
        notes: &mut Vec<String>,
    ) -> Frame {
        let first = look.first();
        let spherical = matches!(self.coordinates, Some(Coordinates::Spherical(_)));
        let claimed =
            spherical || self.native.is_some() || cloud.transform.is_some() || self.n_records == 0;
        if claimed && frame::within_reach(first) {
            if !spherical && self.native.is_none() && self.n_records > 0 && pose == Pose::identity()
            {
                notes.push(
                    "the pose is the identity and there are no rows and columns: were the scan merged from several, \
                     its free-space evidence would be wrong"
                        .into(),
                );
            }
            let frame = Frame::of_scanner(pose);
            if look.n_looked < FEW {
                return frame.with_origin();
            }
            if look.n_at_origin > 0 {
                notes.push(no_returns_note(look.n_at_origin, look.n_looked));
            }
            return frame;
        }
        notes.push(
            if claimed {
                "points lie farther from the scan's origin than any scanner reaches: the scanner is not known, \
                 so there is no free-space evidence"
            } else {
                "no pose, no rows and columns: it may be merged from several scans, so the scanner is not known \
                 and there is no free-space evidence"
            }
            .into(),
        );
        let frame = Frame::about(pose, frame::near(bounds, first));
        if (look.n_at_origin as f64) < NO_RETURNS * look.n_looked as f64 || look.n_at_origin < 2 {
            return frame;
        }
        notes.push(no_returns_note(look.n_at_origin, look.n_looked));
        frame.without_origin()
    }
}

/// The pose `world_from_file` of a scan, metres; identity where the file states none.
fn pose(cloud: &PointCloud, metres: f64) -> Result<Pose> {
    let Some(t) = &cloud.transform else { return Ok(Pose::identity()) };
    let translation = Vector3::new(t.translation.x, t.translation.y, t.translation.z) * metres;
    if !translation.iter().all(|v| v.is_finite()) {
        return Err(Error::bad_input(format!(
            "translation of the pose is no number, \"{translation:?}\""
        )));
    }
    let rotation: UnitQuaternion<f64> =
        frame::rotation([t.rotation.w, t.rotation.x, t.rotation.y, t.rotation.z])?;
    Ok(Pose::from_parts(Translation3::from(translation), rotation))
}

/// Stated bounds in the file frame, metres, where they are plausible.
fn bounds(cloud: &PointCloud, metres: f64) -> Option<Aabb> {
    let b = cloud.get_cartesian_bounds()?;
    let [min, max] = [[b.x_min?, b.y_min?, b.z_min?], [b.x_max?, b.y_max?, b.z_max?]];
    let bounds = Aabb { min: min.map(|v| v * metres), max: max.map(|v| v * metres) };
    // Writers that do not know the bounds write the largest number there is.
    let sane = bounds.min.iter().chain(&bounds.max).all(|v| v.abs() < 1e9);
    (sane && !bounds.is_empty()).then_some(bounds)
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
