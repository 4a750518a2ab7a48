//! Reads and checks the scanner poses (`world_from_scan`) of a `--scanners` file in TOML or JSON.

use crate::regular::read_text;
use crate::settings::Settings;
use contract::{Error, Kind, PointRaster, Result, ScannerPosition};
use geometry::Pose;
use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

/// Largest number of entries of a file: LAS can tell no more sources apart.
const MAX_SCANNERS: usize = 1 << 16;

/// A scanner whose pose the user gives.
#[derive(Debug, Clone, PartialEq)]
pub struct KnownScanner {
    /// Point source id of its points in a LAS file.
    pub point_source_id: Option<u16>,
    /// Name of its scan, or name of its file without suffix.
    pub name: Option<String>,
    /// Pose of the scanner in the world, metres.
    pub world_from_scan: Pose,
    /// Standard deviation of a position that was found from the points, along each axis of the
    /// world, metres.
    pub sigma: Option<[f64; 3]>,
    /// First and last places of the stretches of its points in a LAS file, ascending, where no
    /// source id tells them apart; else empty.
    pub places: Vec<[u64; 2]>,
    /// The raster of its points in a LAS file, where neither a source id nor their order tells them
    /// apart.
    pub raster: Option<PointRaster>,
}

impl KnownScanner {
    /// How the position is known.
    #[must_use]
    pub fn position(&self) -> ScannerPosition {
        self.sigma.map_or(ScannerPosition::Given, |sigma| ScannerPosition::Found { sigma })
    }
}

/// Scanner poses from the user, for formats that carry none.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct KnownScanners {
    /// The entries, in the order of the file.
    pub entries: Vec<KnownScanner>,
}

/// Scanner poses for files that state none.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ScannersFile {
    /// The scanners, in any order.
    scanner: Vec<ScannerText>,
}

/// One scanner.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ScannerText {
    /// `point_source_id` of the scanner's points; not needed where there is one scanner.
    point_source_id: Option<u16>,
    /// Name of its scan.
    name: Option<String>,
    /// Position of the scanner in the world, metres.
    position: [f64; 3],
    /// Rotation `world_from_scan`, unit quaternion; no rotation without it.
    quaternion_wxyz: Option<[f64; 4]>,
    /// Standard deviation of a position that was found from the points, along x, y, z, metres;
    /// without it the position counts as given.
    sigma: Option<[f64; 3]>,
    /// Places of the scanner's points in a LAS or LAZ file, where no `point_source_id` tells them
    /// apart: first and last of each stretch, counted from 0, ascending.
    #[serde(default)]
    places: Vec<[u64; 2]>,
    /// The raster of the scanner's beams as it was found, where neither a `point_source_id` nor the
    /// order of a LAS or LAZ file tells its points apart.
    raster: Option<RasterText>,
}

/// The raster of a scanner's beams: its points lie on it, and clearly beside those of the others.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RasterText {
    /// Azimuth between columns and elevation between rows, degrees.
    steps_deg: [f64; 2],
    /// Azimuth of a column in each of so many equal sectors from −180° on, as a share of the step.
    columns: Vec<f64>,
    /// Elevation of a row in each of so many equal bands from −90° on, as a share of the step.
    rows: Vec<f64>,
    /// Deviation of azimuth and elevation up to which a point counts as on the raster, steps.
    within: [f64; 2],
    /// Deviation up to which a point on the raster of another scanner may be of this one, steps.
    apart: [f64; 2],
}

impl KnownScanners {
    /// Reads a file: JSON if it starts with `{`, else TOML.
    ///
    /// # Errors
    /// If the file cannot be read, or if an entry has an unknown key, a value that is not finite,
    /// or the same name and id as another; the error names the place.
    pub fn read(path: &Path, settings: &Settings) -> Result<Self> {
        let text = read_text(path, settings.max_scanners_bytes, "ingest.max_scanners_bytes")?;
        Self::parse(&text).map_err(|e| e.at(path.display()))
    }

    /// Reads the text of a `--scanners` file.
    ///
    /// # Errors
    /// As [`KnownScanners::read`].
    pub fn parse(text: &str) -> Result<Self> {
        const HINT: &str = "an entry has position, and may have name, point_source_id, quaternion_wxyz, sigma, places and raster";
        let file: ScannersFile = if text.trim_start().starts_with('{') {
            serde_json::from_str(text)
                .map_err(|e| Error::bad_input("wrong JSON").because(e).hint(HINT))?
        } else {
            toml::from_str(text)
                .map_err(|e| Error::bad_input("wrong TOML").because(e).hint(HINT))?
        };
        if file.scanner.len() > MAX_SCANNERS {
            return Err(Error::bad_input(format!(
                "a plant has at most {MAX_SCANNERS} scanners, not \"{}\"",
                file.scanner.len()
            )));
        }
        let mut entries: Vec<KnownScanner> = Vec::new();
        let mut known = BTreeMap::new();
        for (i, entry) in file.scanner.into_iter().enumerate() {
            let entry = entry.check().map_err(|e| e.at(format!("scanner {}", i + 1)))?;
            let key = (entry.point_source_id, entry.name.clone(), entry.places.first().copied());
            // Scanners of one file that rasters tell apart share all that names them.
            let twin = if entry.raster.is_some() { None } else { known.insert(key, i) };
            if let Some(twin) = twin {
                return Err(Error::new(
                    Kind::BadInput,
                    format!("has the same name and point_source_id as scanner \"{}\"", twin + 1),
                )
                .at(format!("scanner {}", i + 1)));
            }
            entries.push(entry);
        }
        Ok(Self { entries })
    }
}

impl KnownScanner {
    /// The entry of a file in TOML, with remarks for people before it.
    #[must_use]
    pub fn to_toml(&self, remarks: &[String]) -> String {
        let mut text: String = remarks.iter().map(|remark| format!("# {remark}\n")).collect();
        text.push_str("[[scanner]]\n");
        let mut add = |key: &str, value: Option<String>| {
            text.extend(value.map(|value| format!("{key} = {value}\n")));
        };
        add("point_source_id", self.point_source_id.map(|id| id.to_string()));
        add("name", self.name.clone().map(|name| toml::Value::String(name).to_string()));
        let (at, q) = (self.world_from_scan.translation, self.world_from_scan.rotation);
        add("position", Some(format!("{:?}", [at.x, at.y, at.z])));
        add("quaternion_wxyz", Some(format!("{:?}", [q.w, q.i, q.j, q.k])));
        add("sigma", self.sigma.map(|sigma| format!("{sigma:?}")));
        let pairs: Vec<String> = self.places.iter().map(|pair| format!("{pair:?}")).collect();
        // Lines of a length that people can look at.
        let lines: Vec<String> = pairs.chunks(6).map(|line| line.join(", ")).collect();
        let is_by_place = !self.places.is_empty();
        add("places", is_by_place.then(|| format!("[\n  {},\n]", lines.join(",\n  "))));
        if let Some(raster) = &self.raster {
            let list = |values: &[f64]| {
                let all: Vec<String> = values.iter().map(|v| format!("{v:?}")).collect();
                let lines: Vec<String> = all.chunks(12).map(|line| line.join(", ")).collect();
                format!("[\n  {},\n]", lines.join(",\n  "))
            };
            let (r, [columns, rows]) = (raster, &raster.phases);
            text.push_str("[scanner.raster]\n");
            let _ = writeln!(text, "steps_deg = {:?}", r.steps.map(f64::to_degrees));
            let _ = writeln!(text, "columns = {}\nrows = {}", list(columns), list(rows));
            let _ = writeln!(text, "within = {:?}\napart = {:?}", r.within, r.apart);
        }
        text
    }
}

impl ScannerText {
    fn check(self) -> Result<KnownScanner> {
        if let Some(bad) = self.position.iter().find(|v| !v.is_finite()) {
            return Err(Error::bad_input(format!("position must be finite, not \"{bad}\"")));
        }
        let turn = match self.quaternion_wxyz {
            None => UnitQuaternion::identity(),
            Some(q) => {
                let [w, x, y, z] = q;
                let norm = (w * w + x * x + y * y + z * z).sqrt();
                if !norm.is_finite() || norm < 1e-6 {
                    return Err(Error::bad_input(format!(
                        "quaternion_wxyz is no rotation: \"{q:?}\""
                    )));
                }
                UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
            }
        };
        if let Some(bad) = self.sigma.iter().flatten().find(|v| !(v.is_finite() && **v >= 0.0)) {
            return Err(Error::bad_input(format!("sigma must be positive, not \"{bad}\"")));
        }
        let ends = || self.places.windows(2).map(|w| (w[0][1], w[1][0]));
        let is_in_order = ends().all(|(last, next)| last < next);
        if !is_in_order || self.places.iter().any(|[first, last]| first > last) {
            return Err(Error::bad_input(
                "places must be pairs of first and last place, each after the one before",
            ));
        }
        let raster = self.raster.map(RasterText::check).transpose()?;
        let [x, y, z] = self.position;
        Ok(KnownScanner {
            point_source_id: self.point_source_id,
            name: self.name,
            world_from_scan: Pose::from_parts(Translation3::new(x, y, z), turn),
            sigma: self.sigma,
            places: self.places,
            raster,
        })
    }
}

impl RasterText {
    fn check(self) -> Result<PointRaster> {
        /// Steps of scanners, with a margin, degrees.
        const STEPS: std::ops::RangeInclusive<f64> = 1e-4..=10.0;
        let bad = |what: String| Error::bad_input(what).at("raster");
        if let Some(step) = self.steps_deg.iter().find(|step| !STEPS.contains(*step)) {
            return Err(bad(format!("steps_deg must be from 0.0001 to 10, not \"{step}\"")));
        }
        let is_list = |phases: &[f64]| {
            (1..=PointRaster::MOST_PHASES).contains(&phases.len())
                && phases.iter().all(|v| v.is_finite())
        };
        if !is_list(&self.columns) || !is_list(&self.rows) {
            let most = PointRaster::MOST_PHASES;
            return Err(bad(format!("columns and rows must be lists of 1 to {most} numbers")));
        }
        let both = self.within.iter().chain(&self.apart);
        if let Some(value) = both.clone().find(|v| !(0.0..=0.5).contains(*v)) {
            return Err(bad(format!("within and apart must be from 0 to 0.5, not \"{value}\"")));
        }
        Ok(PointRaster {
            steps: self.steps_deg.map(f64::to_radians),
            phases: [self.columns, self.rows],
            within: self.within,
            apart: self.apart,
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // tests may panic
mod tests {
    use super::*;

    #[test]
    fn toml_and_json_say_the_same() {
        let toml = "[[scanner]]\npoint_source_id = 1\nname = 'a'\nposition = [4.9, 1, 1.5]\n\
                    quaternion_wxyz = [0.876, 0, 0, 0.482]\n[[scanner]]\nposition = [0, 0, 0.0]\n";
        let json = r#"{"scanner": [{"point_source_id": 1, "name": "a", "position": [4.9, 1, 1.5],
                       "quaternion_wxyz": [0.876, 0, 0, 0.482]}, {"position": [0, 0, 0]}]}"#;
        let (a, b) = (KnownScanners::parse(toml).unwrap(), KnownScanners::parse(json).unwrap());
        assert_eq!(a, b);
        assert_eq!(a.entries.len(), 2);
        assert!((a.entries[0].world_from_scan.rotation.norm() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn as_many_scanners_as_there_can_be_are_soon_read() {
        let entry = |i: usize| format!("[[scanner]]\nname = 's{i}'\nposition = [0, 0, 0]\n");
        let text = |n: usize| (0..n).map(entry).collect::<String>();
        assert_eq!(KnownScanners::parse(&text(MAX_SCANNERS)).unwrap().entries.len(), MAX_SCANNERS);
        let error = KnownScanners::parse(&text(MAX_SCANNERS + 1)).unwrap_err().to_string();
        assert!(error.contains("not \"65537\""), "{error}");
    }

    #[test]
    fn what_is_written_reads_back() {
        let text = "[[scanner]]\nname = 'a\"b'\nposition = [4.9, 1e-7, 5000000.25]\n\
                    quaternion_wxyz = [0.6, 0, 0, 0.8]\nsigma = [1e-4, 2e-4, 3e-5]\n\
                    places = [[0, 7], [9, 9], [11, 12345678901]]\n\
                    [[scanner]]\npoint_source_id = 7\nposition = [0, 0, 0.5]\n\
                    [[scanner]]\nname = 'c'\nposition = [0, 0, 1]\n[scanner.raster]\n\
                    steps_deg = [0.1, 0.05]\ncolumns = [0.5, 0.25]\nrows = [0]\n\
                    within = [0.06, 0.1]\napart = [0.2, 0.25]\n\
                    [[scanner]]\nname = 'c'\nposition = [4, 0, 1]\n[scanner.raster]\n\
                    steps_deg = [0.3, 0.3]\ncolumns = [0.5]\nrows = [0.1]\n\
                    within = [0.06, 0.1]\napart = [0.2, 0.25]\n";
        let read = KnownScanners::parse(text).unwrap();
        let remarks = ["found from 3 planes".to_string()];
        let again: String = read.entries.iter().map(|e| e.to_toml(&remarks) + "\n").collect();
        assert_eq!(KnownScanners::parse(&again).unwrap(), read);
        assert!(again.starts_with("# found from 3 planes\n[[scanner]]\n"));
    }

    #[test]
    fn wrong_entries_are_named() {
        let raster = |step: &str, columns: &str, within: &str| {
            format!(
                "[[scanner]]\nposition = [0, 0, 0]\n[scanner.raster]\nsteps_deg = [{step}, 0.1]\n\
                 columns = {columns}\nrows = [0]\nwithin = [{within}, 0.1]\napart = [0.2, 0.2]"
            )
        };
        for (text, word) in [
            ("[[scanner]]\nposition = [0, 0, nan]", "finite"),
            ("[[scanner]]\nposition = [0, 0, 0]\nquaternion_wxyz = [0, 0, 0, 0]", "rotation"),
            ("[[scanner]]\nposition = [0, 0, 0]\npose = 1", "pose"),
            ("[[scanner]]\nposition = [0, 0]", "TOML"),
            ("[[scanner]]\nposition = [0,0,0]\npoint_source_id = 70000", "TOML"),
            ("[[scanner]]\nposition = [0,0,0]\n[[scanner]]\nposition = [0,0,0]", "same name"),
            ("[[scanner]]\nposition = [0,0,0]\nsigma = [1e-4, -1e-4, 0]", "sigma"),
            ("[[scanner]]\nposition = [0,0,0]\nplaces = [[5, 9], [9, 12]]", "places"),
            ("[[scanner]]\nposition = [0,0,0]\nplaces = [[5, 4]]", "places"),
            ("[[scanner]]\nposition = [0,0,0]\nraster = {}", "steps_deg"),
            (&raster("0.1", "[0.5]", "0.6"), "0.6"),
            (&raster("0", "[0.5]", "0.1"), "steps_deg"),
            (&raster("nan", "[0.5]", "0.1"), "steps_deg"),
            (&raster("0.1", "[]", "0.1"), "columns"),
            (&raster("0.1", "[inf]", "0.1"), "columns"),
            ("{", "JSON"),
            ("", "scanner"),
        ] {
            let error = KnownScanners::parse(text).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }
}
