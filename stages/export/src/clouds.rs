//! Writes two clouds: one of all points that move, and one of all others.

use crate::las::{LasSummary, LasWriter};
use crate::pack::Packed;
use crate::record::LasSettings;
use crate::settings::Settings;
use crate::summed::FileSum;
use contract::Result;
use std::path::Path;

/// The files that [`Tiles`](crate::Tiles) and [`Clouds`] wrote.
#[derive(Debug, Clone, PartialEq)]
pub struct WrittenFiles {
    /// The tiles, sorted by row, then column.
    pub tiles: Vec<LasSummary>,
    /// The cloud of links and attachments.
    pub robots: LasSummary,
    /// The cloud of all other points, if it was requested.
    pub fixed: Option<LasSummary>,
}

impl WrittenFiles {
    /// Checksums of the files, where they are known.
    pub fn sums(&self) -> impl Iterator<Item = &FileSum> {
        let all = self.tiles.iter().chain([&self.robots]).chain(&self.fixed);
        all.filter_map(|summary| summary.sum.as_ref())
    }
}

/// Writes labelled clouds under `OUT/clouds`.
pub struct Clouds {
    record_len: usize,
    robots: LasWriter,
    fixed: Option<LasWriter>,
}

impl Clouds {
    /// Opens the clouds in the output folder `out`, with records as `las` says.
    ///
    /// # Errors
    /// If a file cannot be created.
    pub fn create(out: &Path, las: &LasSettings, settings: &Settings) -> Result<Self> {
        let open = |name: &str| {
            LasWriter::create(out.join(format!("clouds/{name}.{}", las.ending())), las.clone())
        };
        let (robots, fixed) =
            (open("robots")?, settings.fixed_cloud.then(|| open("fixed")).transpose()?);
        Ok(Self { record_len: las.record_len(), robots, fixed })
    }

    /// Adds a packed strip.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn add(&mut self, packed: &Packed) -> Result<()> {
        for (run, records) in packed.runs(self.record_len) {
            if run.moves {
                self.robots.push_records(records, &run.extent)?;
            } else if let Some(fixed) = &mut self.fixed {
                fixed.push_records(records, &run.extent)?;
            }
        }
        Ok(())
    }

    /// Finishes the files and returns their summaries: that of the moving points, and that of the
    /// others if it was requested.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn finish(self) -> Result<(LasSummary, Option<LasSummary>)> {
        Ok((self.robots.finish()?, self.fixed.map(LasWriter::finish).transpose()?))
    }
}
