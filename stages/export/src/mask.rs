//! The labels of one mask: labels in the order of the input in, three arrays out.

use crate::npy::NpyWriter;
use contract::{Label, MaskId, Result};
use std::path::Path;

/// The files of one mask, relative to the output folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MaskFiles {
    /// Kinds, u8.
    pub kind: String,
    /// Robots, i16.
    pub robot: String,
    /// Links, i16.
    pub link: String,
}

impl MaskFiles {
    /// Names of the files of a mask.
    #[must_use]
    pub fn of(mask: MaskId) -> Self {
        let name = |what: &str| format!("labels/{}.{what}.npy", mask.0);
        Self { kind: name("kind"), robot: name("robot"), link: name("link") }
    }
}

/// Writes `labels/N.kind.npy`, `labels/N.robot.npy` and `labels/N.link.npy`.
pub struct MaskWriter {
    kind: NpyWriter<u8>,
    robot: NpyWriter<i16>,
    link: NpyWriter<i16>,
}

impl MaskWriter {
    /// Opens the three files under the output folder.
    pub fn create(out: &Path, mask: MaskId) -> Result<Self> {
        let files = MaskFiles::of(mask);
        Ok(Self {
            kind: NpyWriter::create(out.join(files.kind))?,
            robot: NpyWriter::create(out.join(files.robot))?,
            link: NpyWriter::create(out.join(files.link))?,
        })
    }

    /// Number of entries so far: the place of the next.
    #[must_use]
    pub fn len(&self) -> u64 {
        self.kind.len()
    }

    /// Holds no entry.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.kind.is_empty()
    }

    /// Appends the labels of the next points.
    pub fn push(&mut self, labels: &[Label]) -> Result<()> {
        self.kind.push(labels.iter().map(|l| l.kind as u8))?;
        self.robot.push(labels.iter().map(|l| l.robot))?;
        self.link.push(labels.iter().map(|l| l.link))
    }

    /// Fills up to `place` with uncertain entries: points that were dropped keep their place.
    pub fn skip_to(&mut self, place: u64) -> Result<()> {
        const STEP: u64 = 1 << 16;
        while self.len() < place {
            let n = (place - self.len()).min(STEP) as usize;
            self.kind.push(std::iter::repeat_n(Label::UNCERTAIN.kind as u8, n))?;
            self.robot.push(std::iter::repeat_n(Label::UNCERTAIN.robot, n))?;
            self.link.push(std::iter::repeat_n(Label::UNCERTAIN.link, n))?;
        }
        Ok(())
    }

    /// Gives the files their names. Returns the number of entries.
    pub fn finish(self) -> Result<u64> {
        self.kind.finish()?;
        self.robot.finish()?;
        self.link.finish()
    }
}
