//! Finds the entries of `--scanners` that belong to a scan or a LAS file, and those that belong to
//! none.

use crate::las_scans::LasScanner;
use crate::scanners::{KnownScanner, KnownScanners};
use std::path::{Path, PathBuf};

/// The scanners that the user gave, and which of them were used.
pub(crate) struct Poses<'a> {
    entries: &'a [KnownScanner],
    used: Vec<bool>,
    /// File names of the inputs without suffix.
    stems: Vec<String>,
    /// Whether there are several inputs, so that an entry may belong to another one.
    several: bool,
}

impl<'a> Poses<'a> {
    pub(crate) fn new(scanners: &'a KnownScanners, paths: &[PathBuf]) -> Self {
        Self {
            entries: &scanners.entries,
            used: vec![false; scanners.entries.len()],
            stems: paths.iter().map(|p| stem(p)).collect(),
            several: paths.len() > 1,
        }
    }

    pub(crate) fn by_scan_name(&mut self, name: &str) -> Option<&'a KnownScanner> {
        // A raster tells points of LAS files apart only: the scan is not all of one scanner.
        let is_own = |e: &KnownScanner| e.name.as_deref() == Some(name) && e.raster.is_none();
        let at = self.entries.iter().position(is_own)?;
        self.used[at] = true;
        Some(&self.entries[at])
    }

    /// The scanners of a LAS or LAZ file: entries with its name; else those with a source id whose
    /// name is not that of another input; else the only entry.
    pub(crate) fn of_las(&mut self, path: &Path) -> Vec<LasScanner> {
        let stem = stem(path);
        let named = |e: &KnownScanner| e.name.as_deref() == Some(stem.as_str());
        let for_another =
            |e: &KnownScanner| e.name.as_ref().is_some_and(|n| self.stems.contains(n));
        let by_id = |e: &KnownScanner| e.point_source_id.is_some() && !for_another(e);
        let only = |e: &KnownScanner| {
            self.entries.len() == 1 && e.point_source_id.is_none() && !for_another(e)
        };
        let is_part = |e: &KnownScanner| !e.places.is_empty() || e.raster.is_some();
        let by_part =
            |e: &KnownScanner| is_part(e) && (named(e) || (!self.several && !for_another(e)));
        let is_whole = |e: &KnownScanner| e.point_source_id.is_none() && !is_part(e);
        let whole = |e: &KnownScanner| named(e) && is_whole(e);
        let chosen: Vec<usize> = match self.entries.iter().position(whole) {
            Some(at) => vec![at],
            None => {
                let fits = |e: &KnownScanner| {
                    (named(e) && e.point_source_id.is_some()) || by_id(e) || only(e) || by_part(e)
                };
                (0..self.entries.len()).filter(|i| fits(&self.entries[*i])).collect()
            }
        };
        let mut scanners: Vec<LasScanner> = Vec::new();
        for at in chosen {
            let entry = &self.entries[at];
            self.used[at] = true;
            // An entry with this file's name takes precedence over one that only shares the id.
            let is_twin = |s: &LasScanner| {
                let is_whole = s.places.is_empty() && s.raster.is_none();
                s.source_id == entry.point_source_id && is_whole && !is_part(entry)
            };
            let twin = scanners.iter().position(is_twin);
            let scanner = LasScanner {
                source_id: entry.point_source_id,
                name: entry.name.clone(),
                pose: entry.world_from_scan,
                position: entry.position(),
                places: entry.places.clone(),
                raster: entry.raster.clone(),
                may_be_elsewhere: self.several && !named(entry),
            };
            match twin {
                Some(twin) if named(entry) => scanners[twin] = scanner,
                Some(_) => {}
                None => scanners.push(scanner),
            }
        }
        scanners
    }

    pub(crate) fn unused(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        for (i, entry) in self.entries.iter().enumerate().filter(|(i, _)| !self.used[*i]) {
            let id = entry
                .point_source_id
                .map_or_else(String::new, |id| format!(", point_source_id {id}"));
            let name = entry.name.as_deref().unwrap_or("no name");
            warnings.push(format!(
                "scanner {} ({name}{id}) of --scanners matches no scan and no file",
                i + 1
            ));
        }
        warnings
    }
}

fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned())
}
