//! Chooses the scan frame, from the stated pose and a few points, so that coordinates in it stay
//! small and its origin is the scanner where that is possible.

use contract::{Error, Result, ScannerPosition};
use geometry::{Aabb, Point, Pose};
use nalgebra::{Quaternion, Translation3, UnitQuaternion, Vector3};

/// Largest distance of a terrestrial scanner from what it measures, metres. Long-range scanners for
/// quarries reach 2 to 6 km, those for plants 0.4 km; map coordinates (easting, northing) are at
/// least tens of kilometres.
const FARTHEST_SCANNER: f64 = 8.0e3;
/// Distance from the scanner within which points are beams without return that the file writes as
/// its origin, metres: no scanner or camera measures within its own housing.
pub(crate) const NO_RETURN: f64 = 0.01;
/// The corresponding distance from the origin of a file whose scanner is unknown, metres: the
/// rounding of map coordinates.
const NO_POINT: f64 = 1e-6;

/// Conversion from a file's coordinates to those of the scan frame.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FileFrame {
    /// Rotation that is applied first; only where the scanner is unknown and the file states a
    /// rotation.
    rotation: Option<UnitQuaternion<f64>>,
    /// Subtracted after the rotation, metres.
    shift: [f64; 3],
    /// Pose of the scan frame in the world.
    pub(crate) world_from_scan: Pose,
    /// Whether the origin of the scan frame is the scanner.
    pub(crate) scanner_known: bool,
    /// Place where beams without return are written (scan frame, metres), and the distance within
    /// which points count as such, metres; 0 where there are none.
    no_return: ([f64; 3], f64),
}

impl FileFrame {
    /// How the scanner's position is known.
    pub(crate) fn position(&self) -> ScannerPosition {
        if self.scanner_known { ScannerPosition::Stated } else { ScannerPosition::Unknown }
    }

    /// The file's own frame, with the scanner at its origin.
    pub(crate) fn of_scanner(world_from_scan: Pose) -> Self {
        let no_return = ([0.0; 3], NO_RETURN);
        Self { rotation: None, shift: [0.0; 3], world_from_scan, scanner_known: true, no_return }
    }

    /// The frame of a scanner with this pose, for a file whose points are in the world.
    pub(crate) fn of_world(world_from_scan: Pose) -> Self {
        let scan_from_world = world_from_scan.inverse();
        let turned = scan_from_world.rotation.angle() > 0.0;
        Self {
            rotation: turned.then_some(scan_from_world.rotation),
            shift: (-scan_from_world.translation.vector).into(),
            ..Self::of_scanner(world_from_scan)
        }
    }

    /// A frame with world axes and an origin at whole metres near `near` (a point in the file
    /// frame), for points whose scanner is unknown.
    pub(crate) fn about(world_from_file: Pose, near: [f64; 3]) -> Self {
        let origin = (world_from_file * Point::from(near)).coords.map(f64::round);
        let turned = world_from_file.rotation.angle() > 0.0;
        Self {
            rotation: turned.then_some(world_from_file.rotation),
            shift: (origin - world_from_file.translation.vector).into(),
            world_from_scan: Pose::from_parts(
                Translation3::from(origin),
                UnitQuaternion::identity(),
            ),
            scanner_known: false,
            no_return: ([0.0; 3], 0.0),
        }
    }

    /// The same frame for a file that writes beams without return as its origin.
    pub(crate) fn without_origin(self) -> Self {
        let no_return = (self.scan_from_file([0.0; 3]), NO_POINT);
        Self { no_return, ..self }
    }

    /// The same frame for a file in which a point at the origin is a measured point.
    pub(crate) fn with_origin(self) -> Self {
        Self { no_return: ([0.0; 3], 0.0), ..self }
    }

    /// Whether a place in the scan frame marks a beam without return.
    #[inline]
    pub(crate) fn is_no_return(&self, p: [f64; 3]) -> bool {
        let (at, reach) = self.no_return;
        (0..3).map(|i| (p[i] - at[i]).powi(2)).sum::<f64>() < reach * reach
    }

    /// Converts a point of the file to the scan frame, metres.
    #[inline]
    pub(crate) fn scan_from_file(&self, p: [f64; 3]) -> [f64; 3] {
        let p = match &self.rotation {
            None => p,
            Some(rotation) => (rotation * Vector3::from(p)).into(),
        };
        [p[0] - self.shift[0], p[1] - self.shift[1], p[2] - self.shift[2]]
    }

    /// The shift between file and scan frame, metres, where they differ by nothing else.
    #[inline]
    pub(crate) fn shift_only(&self) -> Option<[f64; 3]> {
        self.rotation.is_none().then_some(self.shift)
    }
}

/// Whether a scanner at the origin can have measured these points (file frame): at least half of
/// them are within its reach.
pub(crate) fn within_reach(points: &[[f64; 3]]) -> bool {
    let near = points.iter().filter(|p| Vector3::from(**p).norm() <= FARTHEST_SCANNER).count();
    2 * near >= points.len()
}

/// A place near the points in the file frame: the centre of the stated bounds, else the median of
/// the points.
pub(crate) fn near(bounds: Option<&Aabb>, points: &[[f64; 3]]) -> [f64; 3] {
    let mut middle = [0.0; 3];
    if points.is_empty() {
        return bounds.map_or(middle, |b| b.center().coords.into());
    }
    for axis in 0..3 {
        let mut along: Vec<f64> = points.iter().map(|p| p[axis]).collect();
        along.sort_by(f64::total_cmp);
        middle[axis] = along[along.len() / 2];
    }
    match bounds {
        Some(b) if b.grown(1.0).contains(middle) => b.center().coords.into(),
        _ => middle,
    }
}

/// The rotation of a stated quaternion, normalised; refused where it is far from unit length.
pub(crate) fn rotation(wxyz: [f64; 4]) -> Result<UnitQuaternion<f64>> {
    let q = Quaternion::new(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
    let norm = q.norm();
    // Files carry 6 to 17 digits, so a deviation above one in a thousand is no rounding.
    if !norm.is_finite() || (norm - 1.0).abs() > 1e-3 {
        return Err(Error::bad_input(format!(
            "rotation of the pose is not a unit quaternion, its length is \"{norm}\""
        ))
        .hint("correct the pose in the software that wrote the file"));
    }
    Ok(UnitQuaternion::from_quaternion(q))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_keep_their_place_in_the_world() {
        let pose =
            Pose::new(Vector3::new(400_000.0, 5_600_000.0, 100.0), Vector3::new(0.1, -0.2, 0.7));
        let p = [312.25, -41.5, 7.0];
        let world = pose * Point::from(p);
        for frame in [FileFrame::of_scanner(pose), FileFrame::about(pose, [300.0, -40.0, 5.0])] {
            let back = frame.world_from_scan * Point::from(frame.scan_from_file(p));
            assert!((back - world).norm() < 1e-8, "{back} {world}");
        }
        let of_world = FileFrame::of_world(pose);
        let back = of_world.world_from_scan * Point::from(of_world.scan_from_file(p));
        assert!((back.coords - Vector3::from(p)).norm() < 1e-8 && of_world.scanner_known);
        let about = FileFrame::about(pose, [300.0, -40.0, 5.0]);
        assert!(Vector3::from(about.scan_from_file(p)).norm() < 20.0);
        assert_eq!(about.world_from_scan.rotation, UnitQuaternion::identity());
    }

    #[test]
    fn the_origin_is_no_return_where_it_is_the_scanner_or_marks_one() {
        let scanner = FileFrame::of_scanner(Pose::translation(1.0, 2.0, 3.0));
        assert!(
            scanner.is_no_return([0.0, 0.0, -0.009]) && !scanner.is_no_return([0.0, 0.02, 0.0])
        );
        let map = FileFrame::about(Pose::identity(), [400_000.0, 5_600_000.0, 80.0]);
        let origin = map.scan_from_file([0.0; 3]);
        assert!(!map.is_no_return(origin) && !map.is_no_return([0.0; 3]));
        let marked = map.without_origin();
        assert!(marked.is_no_return(origin) && !marked.is_no_return([0.0; 3]));
    }

    #[test]
    fn map_coordinates_are_not_a_scanner_frame() {
        assert!(within_reach(&[[3.0, 4.0, 0.0], [900.0, 0.0, 0.0], [1e9, 0.0, 0.0]]));
        assert!(!within_reach(&[[637_012.24, 849_028.31, 431.66]]));
        assert_eq!(
            near(None, &[[1e30, 0.0, 0.0], [5.0, 6.0, 7.0], [4.0, 6.0, 7.0]]),
            [5.0, 6.0, 7.0]
        );
    }

    #[test]
    fn no_rotation_is_refused() {
        assert!(rotation([0.0; 4]).is_err());
        assert!(rotation([f64::NAN, 0.0, 0.0, 0.0]).is_err());
        assert!(rotation([2.0, 0.0, 0.0, 0.0]).is_err());
        assert!(rotation([1.0 + 1e-5, 0.0, 0.0, 0.0]).is_ok());
    }
}
