//! Points in memory as inputs: arrays of another program, each with the position of its scanner.
//! They are read as a LAS file of one scanner is, so that the same points give the same scans.

use crate::frame::NO_RETURN;
use crate::looked::KeepNone;
use crate::oddities::Oddities;
use crate::place_look::PlaceLook;
use crate::reader::{FileReading, MaskSeed, RawStrip, Reader, SampledPoint, ScanSeed, Want};
use crate::settings::Settings;
use crate::sources::Sources;
use crate::units::Units;
use crate::{sampling, steps};
use contract::{Attributes, Error, Fan, Format, Kind, Result, ScannerPosition};
use geometry::Pose;
use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

/// Largest number of arrays: scans are told apart by 16 bits in written clouds.
const MAX_ARRAYS: usize = u16::MAX as usize;

/// The points of one scanner.
#[derive(Debug, Clone, PartialEq)]
pub struct ArrayScan {
    name: String,
    /// Whether the origin of the scan frame is the scanner.
    scanner_known: bool,
    world_from_scan: Pose,
    /// Scan frame, metres; what is no number stays so, and is dropped when it is read.
    xyz: Vec<[f32; 3]>,
    look: Vec<[f64; 3]>,
}

impl ArrayScan {
    /// Takes `n` points of the world, metres, of which `point` gives each. `scanner` is the pose of
    /// their scanner in the world, metres, if it is known: rows of rotation and position.
    ///
    /// # Errors
    /// `BadInput` where there is no point; `Usage` where the pose is none.
    pub fn new(
        name: impl Into<String>,
        scanner: Option<[[f64; 4]; 3]>,
        n: usize,
        point: impl Fn(usize) -> [f64; 3],
    ) -> Result<Self> {
        let name = name.into();
        if n == 0 {
            return Err(Error::bad_input("there are no points in it").at(name));
        }
        let scanner = scanner.map(pose).transpose().map_err(|e| e.at(&name))?;
        let is_finite = |p: &[f64; 3]| p.iter().all(|v| v.is_finite());
        let places = PlaceLook::windows(n as u64).flat_map(|first| {
            let first = first as usize;
            first..(first + PlaceLook::IN_WINDOW).min(n)
        });
        let look: Vec<[f64; 3]> = places.map(&point).filter(is_finite).collect();
        let near = || {
            let [x, y, z] = PlaceLook::new(look.clone(), None).origin;
            Pose::translation(x, y, z)
        };
        let world_from_scan = scanner.unwrap_or_else(near);
        let scan_from_world = world_from_scan.rotation.inverse().to_rotation_matrix();
        let local = |i: usize| {
            let from_scanner = Vector3::from(point(i)) - world_from_scan.translation.vector;
            (scan_from_world * from_scanner).map(|v| v as f32).into()
        };
        let xyz = (0..n).map(local).collect();
        Ok(Self { name, scanner_known: scanner.is_some(), world_from_scan, xyz, look })
    }

    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.xyz.len()
    }

    /// Whether it has no points; it never is.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.xyz.is_empty()
    }
}

/// Largest deviation of a rotation's matrix from one: poses come with six digits or more.
const LARGEST_SKEW: f64 = 1e-4;

/// A pose from rows of rotation and position.
fn pose(rows: [[f64; 4]; 3]) -> Result<Pose> {
    let turn = Matrix3::from_fn(|i, j| rows[i][j]);
    let at = Vector3::from_fn(|i, _| rows[i][3]);
    let skew = (turn * turn.transpose() - Matrix3::identity()).abs().max();
    // What is no number fails the comparison as well.
    let is_turn = skew <= LARGEST_SKEW && turn.determinant() > 0.0;
    if !is_turn || at.iter().any(|v| !v.is_finite()) {
        let what = "the scanner's pose is no rotation and place";
        let error = Error::new(Kind::Usage, what);
        return Err(error.hint("give its position, or world from scan as a matrix of 4 x 4"));
    }
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn));
    Ok(Pose::from_parts(Translation3::from(at), turn))
}

/// Opens arrays as inputs of one scan each: estimates their lattices and checks their scanners.
///
/// # Errors
/// For the first array whose scanner cannot have measured it, by its name; where there is none, or
/// more than 65,535.
pub fn open_arrays(scans: Vec<ArrayScan>, settings: &Settings, fan: &dyn Fan) -> Result<Sources> {
    if scans.is_empty() || scans.len() > MAX_ARRAYS {
        let what = format!("there must be 1 to {MAX_ARRAYS} arrays, not \"{}\"", scans.len());
        return Err(Error::new(Kind::Usage, what));
    }
    let mut sources = Sources::empty();
    for scan in scans {
        let (name, n_bytes) = (scan.name.clone(), size_of_val(&scan.xyz[..]) as u64);
        let reader = ArrayReader::new(scan, settings).map_err(|e| e.at(&name))?;
        sources.add_reader(name.into(), n_bytes, Box::new(reader));
    }
    sources.find_lattices(settings, &KeepNone, fan)?;
    Ok(sources)
}

/// An array that is read as a file is.
struct ArrayReader {
    xyz: Vec<[f32; 3]>,
    masks: [MaskSeed; 1],
    scans: [ScanSeed; 1],
    units: Units,
    max_range: f32,
    strip_points: usize,
    no_return: f32,
    oddities: Oddities,
}

impl ArrayReader {
    fn new(array: ArrayScan, settings: &Settings) -> Result<Self> {
        let ArrayScan { name, scanner_known, world_from_scan, xyz, look } = array;
        let n_points = Some(xyz.len() as u64);
        let step = steps::coarse(&look);
        let mut scan = ScanSeed {
            name: name.clone(),
            mask: 0,
            source_id: None,
            places: Vec::new(),
            raster: None,
            position: match scanner_known {
                true => ScannerPosition::Given,
                false => ScannerPosition::Unknown,
            },
            world_from_scan,
            scanner_known,
            stated_bounds: None,
            stated_points: n_points,
            likely_points: None,
            notes: step.map(steps::note).into_iter().collect(),
            step,
        };
        PlaceLook::new(look, None).check(&mut scan, settings)?;
        Ok(Self {
            xyz,
            masks: [MaskSeed { name, n_points, n_stated: n_points }],
            scans: [scan],
            units: Units::of_format(None)?,
            max_range: settings.max_range as f32,
            strip_points: settings.strip_points.max(1),
            no_return: if scanner_known { NO_RETURN as f32 } else { 0.0 },
            oddities: Oddities::default(),
        })
    }

    /// The points among `n` from a place on that are numbers, in range and not at the scanner.
    fn strip(&self, from: u64, n: usize, want: Want) -> RawStrip {
        let from = (from as usize).min(self.xyz.len());
        let run = &self.xyz[from..(from + n).min(self.xyz.len())];
        let reach = |p: &[f32; 3]| p.iter().fold(0.0_f32, |most, v| most.max(v.abs()));
        // What is no number fails the comparison with each coordinate.
        let is_near = |p: &[f32; 3]| p.iter().all(|v| v.abs() <= self.max_range);
        let is_good = |p: &[f32; 3]| is_near(p) && reach(p) >= self.no_return;
        let places = run.iter().zip(0_u32..).filter(|(p, _)| is_good(p));
        let (xyz, place): (Vec<[f32; 3]>, Vec<u32>) = places.map(|(p, at)| (*p, at)).unzip();
        let attributes = (want == Want::Everything).then(Attributes::default);
        RawStrip { scan: 0, first_place: from as u64, place, xyz, attributes }
    }
}

impl Reader for ArrayReader {
    fn format(&self) -> Format {
        Format::Memory
    }

    fn masks(&self) -> &[MaskSeed] {
        &self.masks
    }

    fn scans(&self) -> &[ScanSeed] {
        &self.scans
    }

    fn sample(&self, _scan: usize, n: usize) -> Result<Vec<SampledPoint>> {
        sampling::sample(self.extent(), n, |from, length| {
            Ok(self.strip(from, length, Want::Coordinates).xyz)
        })
    }

    fn spread(&self, _scan: usize, n: usize, most: u64) -> Result<Vec<[f32; 3]>> {
        sampling::spread(self.extent(), n, most, |from, length| {
            Ok(self.strip(from, length, Want::Coordinates).into_points().collect())
        })
    }

    fn read(&self, want: Want) -> Result<FileReading<'_>> {
        let places = (0..self.xyz.len() as u64).step_by(self.strip_points);
        let strips = places.map(move |from| self.strip(from, self.strip_points, want));
        Ok(FileReading::Straight(Box::new(strips.filter(|s| !s.xyz.is_empty()).map(Ok))))
    }

    fn units(&self) -> &Units {
        &self.units
    }

    fn has_color(&self) -> bool {
        false
    }

    fn oddities(&self, _scan: usize) -> Option<&Oddities> {
        Some(&self.oddities)
    }

    fn facts(&self) -> Vec<(String, String)> {
        vec![("records".into(), self.xyz.len().to_string())]
    }
}

impl ArrayReader {
    /// The first and the last place.
    fn extent(&self) -> (u64, u64) {
        (0, self.xyz.len() as u64 - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::{InputId, OneByOne};

    fn opened(scanner: Option<[f64; 3]>, points: &[[f64; 3]]) -> Result<Sources> {
        // A quarter turn about the vertical: the scan's x is the world's y.
        let turn = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        let row = |at: [f64; 3], i: usize| [turn[i][0], turn[i][1], turn[i][2], at[i]];
        let scanner = scanner.map(|at| [0, 1, 2].map(|i| row(at, i)));
        let scan = ArrayScan::new("array 0", scanner, points.len(), |i| points[i])?;
        open_arrays(vec![scan], &Settings::default(), &OneByOne)
    }

    #[test]
    fn points_keep_their_places_and_odd_ones_are_dropped() {
        let scanner = [1e5, 2e5, 10.0];
        let points = [
            [1e5 + 1.0, 2e5, 10.0],
            [f64::NAN, 0.0, 0.0],
            scanner,
            [1e5, 2e5 - 2.5, f64::INFINITY],
            [1e5, 2e5 - 2.5, 11.0],
        ];
        let sources = opened(Some(scanner), &points).expect("opens");
        let mut strips = sources.strips(InputId(0), Want::Coordinates).expect("an input");
        let strip = strips.next().expect("a strip").expect("reads");
        assert_eq!((strip.first_place, &strip.place[..]), (0, &[0, 4][..]));
        let wanted = [[0.0, -1.0, 0.0], [-2.5, 0.0, 1.0_f32]];
        let pairs = strip.xyz.iter().flatten().zip(wanted.iter().flatten());
        assert!(pairs.clone().count() == 6 && pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-6));
        assert!(strips.next().is_none());
        assert!(sources.check_sizes().is_ok());
    }

    #[test]
    fn arrays_that_cannot_be_used_are_named() {
        let error = opened(None, &[]).map(|_| ()).expect_err("no points").to_string();
        assert!(error.contains("array 0") && error.contains("no points"), "{error}");
        let far = opened(Some([1e7, 0.0, 0.0]), &[[0.0; 3], [1.0; 3]]);
        assert_eq!(far.map(|_| ()).expect_err("far away").kind(), Kind::Usage);
        let odd = opened(Some([f64::NAN, 0.0, 0.0]), &[[0.0; 3]]);
        assert_eq!(odd.map(|_| ()).expect_err("no number").kind(), Kind::Usage);
        let unknown = opened(None, &[[5.2, 1.0, 0.0]; 3]).expect("opens");
        assert_eq!(unknown.scans[0].world_from_scan.translation.vector.x, 5.0);
        assert!(!unknown.scans[0].has_beams());
    }
}
