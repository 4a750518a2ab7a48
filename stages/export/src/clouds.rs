//! Packed strips in, in any order; the cloud of all that moves, and that of all that does not, out.

use crate::las::{LasSummary, LasWriter};
use crate::pack::Packed;
use crate::record::LasSettings;
use crate::settings::Settings;
use crate::summed::FileSum;
use contract::Result;
use std::path::Path;

/// What [`Tiles`](crate::Tiles) and [`Clouds`] wrote.
#[derive(Debug, Clone, PartialEq)]
pub struct WrittenFiles {
    /// Tiles, by row then column.
    pub tiles: Vec<LasSummary>,
    /// Links and attachments.
    pub robots: LasSummary,
    /// All the rest, where asked for.
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
    /// Opens the clouds under the output folder, of records as `las` has them.
    ///
    /// # Errors
    /// A file that cannot be made.
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
    /// A file that cannot be written.
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

    /// Finishes the files; with the tiles, all that was written.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn finish(self) -> Result<(LasSummary, Option<LasSummary>)> {
        Ok((self.robots.finish()?, self.fixed.map(LasWriter::finish).transpose()?))
    }
}
