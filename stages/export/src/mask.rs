//! Writes and reads the labels of a mask as three NumPy arrays, in the order of the input.

use crate::npy::{self, NpyWriter};
use crate::summed::FileSum;
use contract::{Error, Label, MaskId, PointKind, Result};
use std::path::{Path, PathBuf};

/// Paths of the files of one mask, relative to the output folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MaskFiles {
    /// Array of kinds, u8.
    pub kind: String,
    /// Array of robots, i16.
    pub robot: String,
    /// Array of links, i16.
    pub link: String,
}

impl MaskFiles {
    /// Path of the list of places of a mask that later scans supersede.
    #[must_use]
    pub fn superseded(mask: MaskId) -> String {
        format!("labels/{}.superseded.npy", mask.0)
    }

    /// Paths of the files of a mask.
    #[must_use]
    pub fn of(mask: MaskId) -> Self {
        let name = |what: &str| format!("labels/{}.{what}.npy", mask.0);
        Self { kind: name("kind"), robot: name("robot"), link: name("link") }
    }
}

/// Labels as three columns.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct LabelColumns {
    kind: Vec<u8>,
    robot: Vec<i16>,
    link: Vec<i16>,
}

impl LabelColumns {
    /// The columns of these labels.
    #[must_use]
    pub fn of(labels: &[Label]) -> Self {
        Self {
            kind: labels.iter().map(|l| l.kind as u8).collect(),
            robot: labels.iter().map(|l| l.robot).collect(),
            link: labels.iter().map(|l| l.link).collect(),
        }
    }

    /// Number of labels.
    #[must_use]
    pub fn len(&self) -> usize {
        self.kind.len()
    }

    /// Whether there are no labels.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.kind.is_empty()
    }

    /// Extends the columns to `n` labels with uncertain ones.
    pub fn pad(&mut self, n: usize) {
        self.kind.resize(n, Label::UNCERTAIN.kind as u8);
        self.robot.resize(n, Label::UNCERTAIN.robot);
        self.link.resize(n, Label::UNCERTAIN.link);
    }

    /// Copies label `i` of `from` to position `at`.
    pub fn set(&mut self, at: usize, from: &Self, i: usize) {
        self.kind[at] = from.kind[i];
        self.robot[at] = from.robot[i];
        self.link[at] = from.link[i];
    }

    /// Removes all labels and keeps the memory.
    pub fn clear(&mut self) {
        self.kind.clear();
        self.robot.clear();
        self.link.clear();
    }

    /// Memory of the columns, bytes.
    #[must_use]
    pub fn weight_bytes(&self) -> usize {
        self.len() * 5
    }
}

/// Reads ranges of the labels of a mask.
#[derive(Debug, Clone)]
pub struct MaskReader {
    paths: [PathBuf; 3],
}

impl MaskReader {
    /// A reader of these files (kind, robot, link) in an output folder.
    #[must_use]
    pub fn new(out: &Path, [kind, robot, link]: [&str; 3]) -> Self {
        Self { paths: [kind, robot, link].map(|name| out.join(name)) }
    }

    /// The labels of `n` places from `first` on.
    ///
    /// # Errors
    /// If a file is missing or too short.
    pub fn range(&self, first: u64, n: usize) -> Result<MaskRange<'_>> {
        let [kind, robot, link] = [1, 2, 2];
        let read = |at: usize, len: usize| npy::read_bytes(&self.paths[at], first, n, len);
        let (kind, robot, link) = (read(0, kind)?, read(1, robot)?, read(2, link)?);
        Ok(MaskRange { path: &self.paths[0], kind, robot, link })
    }
}

/// The labels of consecutive places.
#[derive(Debug)]
pub struct MaskRange<'a> {
    path: &'a Path,
    kind: Vec<u8>,
    robot: Vec<u8>,
    link: Vec<u8>,
}

impl MaskRange<'_> {
    /// The label of place `first + i`.
    ///
    /// # Errors
    /// If the file holds a number that is no kind.
    #[inline]
    pub fn label(&self, i: usize) -> Result<Label> {
        let broken = || Error::bad_input(format!("there is no kind \"{}\"", self.kind[i]));
        let kind = PointKind::of(self.kind[i]).ok_or_else(|| broken().at(self.path.display()))?;
        let wide = |bytes: &[u8]| i16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]]);
        Ok(Label { kind, robot: wide(&self.robot), link: wide(&self.link) })
    }
}

/// Writes `labels/N.kind.npy`, `labels/N.robot.npy` and `labels/N.link.npy`.
pub struct MaskWriter {
    kind: NpyWriter<u8>,
    robot: NpyWriter<i16>,
    link: NpyWriter<i16>,
}

impl MaskWriter {
    /// Opens the three files in the output folder.
    ///
    /// # Errors
    /// If a file cannot be created.
    pub fn create(out: &Path, mask: MaskId) -> Result<Self> {
        let files = MaskFiles::of(mask);
        Ok(Self {
            kind: NpyWriter::create(out.join(files.kind))?,
            robot: NpyWriter::create(out.join(files.robot))?,
            link: NpyWriter::create(out.join(files.link))?,
        })
    }

    /// Number of entries so far, which is the place of the next one.
    #[must_use]
    pub fn len(&self) -> u64 {
        self.kind.len()
    }

    /// Whether there are no entries.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.kind.is_empty()
    }

    /// Appends the labels of the next points.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn push(&mut self, labels: &LabelColumns) -> Result<()> {
        self.kind.push(&labels.kind)?;
        self.robot.push(&labels.robot)?;
        self.link.push(&labels.link)
    }

    /// Finishes the files and returns their checksums.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn finish(self) -> Result<[FileSum; 3]> {
        Ok([self.kind.finish()?, self.robot.finish()?, self.link.finish()?])
    }
}
