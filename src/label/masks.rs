//! Writes the masks: three label arrays for each mask, in the order of the file, with an entry for
//! every point except those that the file itself marks as invalid.

use super::label_strips::LabelledStrip;
use contract::{Error, Kind, Mask, Result};
use export::{FileSum, LabelColumns, MaskWriter};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Numbers of entries of one mask.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(crate) struct MaskCount {
    pub(crate) n_points: u64,
    pub(crate) n_dropped: u64,
    pub(crate) n_moving: u64,
}

/// Writes the masks of all inputs.
pub(crate) struct Masks {
    out: PathBuf,
    /// Masks in the order of their numbers, which need not begin with 0.
    masks: Vec<Mask>,
    open: Vec<Option<Open>>,
    counts: Vec<MaskCount>,
}

/// A mask that is being written. Strips of several scans of one LAS file share a mask, and their
/// places interleave within one piece of the file: labels wait in a window until a strip begins
/// after all of them.
struct Open {
    writer: MaskWriter,
    /// Labels of the places from `writer.len()` on; places without a point stay uncertain.
    window: LabelColumns,
    n_named: u64,
}

impl Masks {
    pub(crate) fn new(out: &Path, masks: &[Mask]) -> Self {
        Self {
            out: out.to_path_buf(),
            masks: masks.to_vec(),
            open: masks.iter().map(|_| None).collect(),
            counts: vec![MaskCount::default(); masks.len()],
        }
    }

    /// Adds the labels of a strip's points.
    pub(crate) fn add(&mut self, strip: &LabelledStrip) -> Result<()> {
        let at = (strip.mask.0 - self.masks[0].id.0) as usize;
        let slot = &mut self.open[at];
        let open = match slot {
            Some(open) => open,
            None => slot.insert(Open::create(&self.out, &self.masks[at])?),
        };
        self.counts[at].n_moving += strip.n_moving;
        open.add(strip)
    }

    /// Finishes all masks; places that the file states after its last point become uncertain.
    pub(crate) fn finish(self) -> Result<(Vec<MaskCount>, Vec<FileSum>)> {
        let Self { out, masks, open, mut counts } = self;
        let mut digests = Vec::new();
        for ((mask, open), count) in masks.iter().zip(open).zip(&mut counts) {
            let mut open = match open {
                Some(open) => open,
                None => Open::create(&out, mask)?,
            };
            open.flush(u64::MAX)?;
            let missing = mask.n_points.unwrap_or(0).saturating_sub(open.writer.len());
            open.pad(missing)?;
            count.n_points = open.writer.len();
            count.n_dropped = count.n_points - open.n_named;
            digests.extend(open.writer.finish()?);
        }
        Ok((counts, digests))
    }
}

/// Number of labels that are padded at a time.
const PAD: usize = 1 << 16;

impl Open {
    fn create(out: &Path, mask: &Mask) -> Result<Self> {
        let (writer, window) = (MaskWriter::create(out, mask.id)?, LabelColumns::default());
        Ok(Self { writer, window, n_named: 0 })
    }

    fn add(&mut self, strip: &LabelledStrip) -> Result<()> {
        let n = strip.place.len();
        if strip.first_place >= self.writer.len() + self.window.len() as u64 {
            self.flush(strip.first_place)?;
        }
        let Some(start) = strip.first_place.checked_sub(self.writer.len()) else {
            return Err(Error::new(
                Kind::Bug,
                "a strip arrived after the labels of its places had been written",
            ));
        };
        self.n_named += n as u64;
        // Most strips have all places from their first to their last, without another strip in
        // between.
        let is_dense = strip.place.last().is_none_or(|last| *last as usize + 1 == n);
        if is_dense && start == 0 && self.window.is_empty() {
            return self.writer.push(&strip.labels);
        }
        let end = start as usize + strip.place.last().map_or(0, |last| *last as usize + 1);
        if end > self.window.len() {
            self.window.pad(end);
        }
        for (i, place) in strip.place.iter().enumerate() {
            self.window.set(start as usize + *place as usize, &strip.labels, i);
        }
        Ok(())
    }

    /// Writes the window, then uncertain labels up to `place`.
    fn flush(&mut self, place: u64) -> Result<()> {
        self.writer.push(&self.window)?;
        self.window.clear();
        if place == u64::MAX { Ok(()) } else { self.pad(place.saturating_sub(self.writer.len())) }
    }

    fn pad(&mut self, mut n: u64) -> Result<()> {
        let mut uncertain = LabelColumns::default();
        while n > 0 {
            let some = n.min(PAD as u64) as usize;
            uncertain.clear();
            uncertain.pad(some);
            self.writer.push(&uncertain)?;
            n -= some as u64;
        }
        Ok(())
    }
}
