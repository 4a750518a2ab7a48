//! Reads and checks the scanner poses (`world_from_scan`) of a `--scanners` file in TOML or JSON.

use crate::regular::read_text;
use crate::settings::Settings;
use contract::{Error, Kind, Result};
use geometry::Pose;
use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use serde::Deserialize;
use std::collections::BTreeMap;
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
        const HINT: &str =
            "an entry has position, and may have name, point_source_id and quaternion_wxyz";
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
            let twin = known.insert((entry.point_source_id, entry.name.clone()), i);
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
        let [x, y, z] = self.position;
        Ok(KnownScanner {
            point_source_id: self.point_source_id,
            name: self.name,
            world_from_scan: Pose::from_parts(Translation3::new(x, y, z), turn),
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
    fn wrong_entries_are_named() {
        for (text, word) in [
            ("[[scanner]]\nposition = [0, 0, nan]", "finite"),
            ("[[scanner]]\nposition = [0, 0, 0]\nquaternion_wxyz = [0, 0, 0, 0]", "rotation"),
            ("[[scanner]]\nposition = [0, 0, 0]\npose = 1", "pose"),
            ("[[scanner]]\nposition = [0, 0]", "TOML"),
            ("[[scanner]]\nposition = [0,0,0]\npoint_source_id = 70000", "TOML"),
            ("[[scanner]]\nposition = [0,0,0]\n[[scanner]]\nposition = [0,0,0]", "same name"),
            ("{", "JSON"),
            ("", "scanner"),
        ] {
            let error = KnownScanners::parse(text).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }
}
