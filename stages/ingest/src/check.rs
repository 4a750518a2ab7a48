//! Helpers for tests: read files whole, keep places and world coordinates, and damage copies.

use crate::reader::{self, Reader, Want};
use crate::settings::Settings;
use contract::{Attributes, Result};
use geometry::Point;
use rand::Rng;
use rand_xoshiro::SplitMix64;
use std::path::{Path, PathBuf};

/// The points that were read of one scan.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Read {
    /// Length of the mask as given by the strips.
    pub(crate) n_places: u64,
    /// Places in the mask.
    pub(crate) place: Vec<u64>,
    /// Scan frame, metres.
    pub(crate) xyz: Vec<[f32; 3]>,
    /// World, metres.
    pub(crate) world: Vec<[f64; 3]>,
    /// Attributes, if they were requested.
    pub(crate) attributes: Attributes,
}

impl Read {
    /// Mean, smallest and largest world coordinates.
    pub(crate) fn summary(&self) -> [[f64; 3]; 3] {
        let mut out = [[0.0; 3], [f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for p in &self.world {
            for i in 0..3 {
                out[0][i] += p[i] / self.world.len() as f64;
                out[1][i] = out[1][i].min(p[i]);
                out[2][i] = out[2][i].max(p[i]);
            }
        }
        out
    }
}

/// Reads all scans of an open file, and checks the properties that every strip must have.
pub(crate) fn read_all(reader: &dyn Reader, want: Want, settings: &Settings) -> Result<Vec<Read>> {
    let mut out = vec![Read::default(); reader.scans().len()];
    for strip in reader::strips(reader, want)? {
        let strip = strip?;
        assert!(strip.xyz.len() <= settings.strip_points);
        assert_eq!(strip.place.len(), strip.xyz.len());
        out[strip.scan].n_places = match strip.place.last() {
            Some(last) => strip.first_place + u64::from(*last) + 1,
            None => strip.first_place,
        };
        if strip.xyz.is_empty() {
            continue;
        }
        assert!(strip.place[0] == 0 && strip.place.is_sorted_by(|a, b| a < b));
        let read = &mut out[strip.scan];
        assert!(read.place.last().is_none_or(|last| *last < strip.first_place));
        read.place.extend(strip.place.iter().map(|p| strip.first_place + u64::from(*p)));
        let pose = reader.scans()[strip.scan].world_from_scan;
        read.world.extend(
            strip
                .xyz
                .iter()
                .map(|p| <[f64; 3]>::from((pose * Point::from(p.map(f64::from))).coords)),
        );
        if let Some(a) = strip.attributes {
            assert_eq!(a.world.len(), strip.xyz.len());
            read.attributes.world.extend(a.world);
            read.attributes.intensity.extend(a.intensity);
            read.attributes.color.extend(a.color);
        }
        read.xyz.extend(strip.xyz);
    }
    for (read, scan) in out.iter_mut().zip(reader.scans()) {
        read.n_places = reader.masks()[scan.mask].n_points.unwrap_or(read.n_places);
    }
    Ok(out)
}

/// A folder of shared scans; `None`, with a message, where this machine does not have it.
pub(crate) fn shared(folder: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scans").join(folder);
    if !path.is_dir() {
        skipped(folder);
        return None;
    }
    Some(path)
}

#[allow(clippy::print_stdout)] // the test says that it did not run
pub(crate) fn skipped(folder: &str) {
    println!("skipped: no shared scans '{folder}'");
}

/// A file that is removed when the test ends.
pub(crate) struct ScratchFile(pub(crate) PathBuf);

impl ScratchFile {
    /// Creates a file with this name, which must be unique over all tests.
    pub(crate) fn new(name: &str, bytes: &[u8]) -> Self {
        let path =
            std::env::temp_dir().join(format!("stillpoint-ingest-{}-{name}", std::process::id()));
        std::fs::write(&path, bytes).expect("the temporary folder can be written");
        Self(path)
    }
}

impl Drop for ScratchFile {
    fn drop(&mut self) {
        let _gone = std::fs::remove_file(&self.0);
    }
}

/// A number below `n`, for breaking files.
pub(crate) fn below(random: &mut SplitMix64, n: usize) -> usize {
    (random.next_u64() % n as u64) as usize
}
