//! Makes the scan and its seed from its description in an E57 file and from its first records. The
//! seed lists all that is odd about them.

use super::look::E57Look;
use super::scan::{Coordinates, E57Scan};
use crate::frame::{self, FileFrame};
use crate::oddities::no_returns_note;
use crate::reader::ScanSeed;
use crate::settings::Settings;
use contract::{Error, Kind, Result};
use e57::PointCloud;
use geometry::{Aabb, Point, Pose};
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use std::path::Path;

/// If the scanner's position is not known: share of sampled points at the origin of the file from
/// which on these are beams without return. A single one may have been measured.
const NO_RETURNS: f64 = 0.005;
/// Scans with fewer points are examples, and the origin may be one of their points.
const FEW: usize = 64;

impl E57Scan {
    /// Reads the description, and a few points to judge whether the origin can be the scanner.
    pub(super) fn new(
        path: &Path,
        cloud: &PointCloud,
        name: &str,
        metres: f64,
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
        let look = E57Look::at(&scan, path, settings)?;
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
            places: Vec::new(),
            raster: None,
            position: scan.frame.position(),
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

    /// Uses the span of the intensities if most of them lie outside their stated limits.
    fn suit_intensity(&mut self, look: &E57Look, is_stated: bool, notes: &mut Vec<String>) {
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

    /// The scan frame: the file's own where its origin can be the scanner, else one about the
    /// points.
    fn judge(
        &self,
        cloud: &PointCloud,
        pose: Pose,
        bounds: Option<&Aabb>,
        look: &E57Look,
        notes: &mut Vec<String>,
    ) -> FileFrame {
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
            let frame = FileFrame::of_scanner(pose);
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
        let frame = FileFrame::about(pose, frame::near(bounds, first));
        if (look.n_at_origin as f64) < NO_RETURNS * look.n_looked as f64 || look.n_at_origin < 2 {
            return frame;
        }
        notes.push(no_returns_note(look.n_at_origin, look.n_looked));
        frame.without_origin()
    }
}

/// World from the file's frame of a scan, metres; identity where the file states none.
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

/// Stated bounds in the file's frame, metres, where they are sane.
fn bounds(cloud: &PointCloud, metres: f64) -> Option<Aabb> {
    let b = cloud.get_cartesian_bounds()?;
    let [min, max] = [[b.x_min?, b.y_min?, b.z_min?], [b.x_max?, b.y_max?, b.z_max?]];
    let bounds = Aabb { min: min.map(|v| v * metres), max: max.map(|v| v * metres) };
    // Writers that do not know them write the largest number there is.
    let sane = bounds.min.iter().chain(&bounds.max).all(|v| v.abs() < 1e9);
    (sane && !bounds.is_empty()).then_some(bounds)
}
