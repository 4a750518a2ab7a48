//! The files of records in the piece of an input, which become part of the tiles and clouds of the
//! result, and what all pieces with folders of their own have in common.

use crate::cache;
use contract::{Error, Kind, Result};
use export::{FileSum, LasSummary, WrittenFiles, atomic};
use geometry::Aabb;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Name of the file with the list of records.
const RECORDS: &str = "records.bin";

/// The records of an input, by the files of the result that they become part of.
#[derive(Serialize, Deserialize)]
pub(super) struct PieceRecords {
    pub(super) tiles: Vec<RecordFile>,
    /// Moving points, and fixed points where their cloud is requested.
    pub(super) clouds: [Option<RecordFile>; 2],
}

/// Name in the folder, length and checksum of a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct RecordedSum {
    pub(super) name: String,
    n_bytes: u64,
    crc32c: u32,
}

/// A file of records.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct RecordFile {
    pub(super) name: String,
    n_points: u64,
    bounds: Aabb,
    sum: Option<RecordedSum>,
}

impl RecordedSum {
    pub(super) fn of(folder: &Path, sum: &FileSum) -> Self {
        Self { name: name(folder, &sum.path), n_bytes: sum.n_bytes, crc32c: sum.crc32c }
    }

    pub(super) fn at(&self, path: PathBuf) -> FileSum {
        FileSum { path, n_bytes: self.n_bytes, crc32c: self.crc32c }
    }
}

impl RecordFile {
    pub(super) fn of(folder: &Path, file: &LasSummary) -> Self {
        let sum = file.sum.as_ref().map(|sum| RecordedSum::of(folder, sum));
        let (n_points, bounds) = (file.n_points, file.bounds);
        Self { name: name(folder, &file.path), n_points, bounds, sum }
    }

    /// The same file under another name.
    pub(super) fn at(&self, path: PathBuf) -> LasSummary {
        let sum = self.sum.as_ref().map(|sum| sum.at(path.clone()));
        LasSummary { path, n_points: self.n_points, bounds: self.bounds, sum }
    }
}

/// Path of a file below its folder, with `/`.
pub(super) fn name(folder: &Path, path: &Path) -> String {
    let parts = path.strip_prefix(folder).unwrap_or(path).components();
    let parts: Vec<_> = parts.map(|part| part.as_os_str().to_string_lossy()).collect();
    parts.join("/")
}

impl PieceRecords {
    pub(super) fn of(clouds: &WrittenFiles, folder: &Path) -> Self {
        let file = |file: &LasSummary| RecordFile::of(folder, file);
        Self {
            tiles: clouds.tiles.iter().map(file).collect(),
            clouds: [Some(file(&clouds.robots)), clouds.fixed.as_ref().map(file)],
        }
    }

    /// Writes them to the folder of the piece.
    pub(super) fn write(&self, folder: &Path) -> Result<()> {
        let path = folder.join(RECORDS);
        let bytes = cache::written(self).ok_or_else(|| {
            Error::new(Kind::Bug, "a list of records cannot be encoded").at(path.display())
        })?;
        atomic::write(&path, &bytes)
    }

    pub(super) fn read(folder: &Path) -> Result<Self> {
        read_piece(&folder.join(RECORDS))
    }

    /// Whether a folder is the piece of an input.
    pub(super) fn are_in(folder: &Path) -> bool {
        folder.join(RECORDS).is_file()
    }
}

/// Reads a file of a piece.
pub(super) fn read_piece<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let bytes = std::fs::read(path);
    let bytes = bytes.map_err(|e| Error::of_read("a piece cannot be read", path, e))?;
    cache::read(&bytes).ok_or_else(|| {
        let what = "a piece of the result is damaged: its bytes do not match their digest";
        let hint = "remove the folder of this file, and start the job again";
        Error::bad_input(what).at(path.display()).hint(hint)
    })
}

/// Gives a file of a piece its name in the result, too; a copy where the disk has no hard links.
pub(super) fn link(from: &Path, to: &Path) -> Result<()> {
    let made = to.parent().map_or(Ok(()), std::fs::create_dir_all);
    let linked = made
        .and_then(|()| std::fs::hard_link(from, to).or_else(|_| std::fs::copy(from, to).map(drop)));
    linked.map_err(|e| Error::of_file("a file of the result cannot be written", to, e))
}
