//! Reads scans and points of PTX (gridded text) files. Each scan is a block: columns, rows, four
//! lines with the scanner's position and axes, the same as a 4 × 4 matrix, then a line a pixel,
//! column by column.

mod blocks;
mod file;
mod look;
mod strips;
#[cfg(test)]
mod tests;

use crate::oddities::Oddities;
use crate::reader::{FileReading, MaskSeed, Reader, SampledPoint, ScanSeed, Want};
use crate::settings::Settings;
use crate::units::{Choice, Units};
use contract::{Format, Result};
use file::PtxFile;
use std::path::Path;

/// Opens a PTX file. All lines are counted, since only so the scans after the first can be found.
pub(crate) fn open(path: &Path, settings: &Settings) -> Result<Box<dyn Reader>> {
    let mut file = PtxFile {
        path: path.to_path_buf(),
        settings: settings.clone(),
        masks: Vec::new(),
        scans: Vec::new(),
        blocks: Vec::new(),
        units: Units::of_nothing(Choice::read(&settings.units)?.of(path))?,
        oddities: Vec::new(),
    };
    for (block, notes) in blocks::find(path, file.units.horizontal.metres)? {
        let name = format!("scan {}", file.blocks.len() + 1);
        let n_points = Some(block.n_valid);
        file.masks.push(MaskSeed { name: name.clone(), n_points, n_stated: n_points });
        file.scans.push(ScanSeed {
            name,
            mask: file.blocks.len(),
            source_id: None,
            world_from_scan: block.frame.world_from_scan,
            scanner_known: block.frame.scanner_known,
            places: Vec::new(),
            raster: None,
            position: block.frame.position(),
            stated_bounds: None,
            stated_points: Some(block.n_valid),
            likely_points: None,
            notes,
            step: block.step,
        });
        file.blocks.push(block);
        file.oddities.push(Oddities::default());
    }
    Ok(Box::new(file))
}

impl Reader for PtxFile {
    fn format(&self) -> Format {
        Format::Ptx
    }

    fn masks(&self) -> &[MaskSeed] {
        &self.masks
    }

    fn scans(&self) -> &[ScanSeed] {
        &self.scans
    }

    fn sample(&self, scan: usize, n: usize) -> Result<Vec<SampledPoint>> {
        strips::sample(self, scan, n)
    }

    fn spread(&self, scan: usize, n: usize, most: u64) -> Result<Vec<[f32; 3]>> {
        strips::spread(self, scan, n, most)
    }

    fn read(&self, want: Want) -> Result<FileReading<'_>> {
        Ok(FileReading::Straight(Box::new(strips::PtxStrips::new(self, want))))
    }

    fn units(&self) -> &Units {
        &self.units
    }

    fn oddities(&self, scan: usize) -> Option<&Oddities> {
        self.oddities.get(scan)
    }

    fn has_color(&self) -> bool {
        // x y z, then intensity, then red green blue.
        self.blocks.iter().any(|block| block.n_columns >= 6)
    }

    fn facts(&self) -> Vec<(String, String)> {
        let mut facts = vec![
            ("version".into(), "PTX".into()),
            ("records".into(), self.blocks.iter().map(|b| b.n_lines).sum::<u64>().to_string()),
        ];
        for (n, block) in self.blocks.iter().enumerate() {
            let holds = match block.n_columns {
                4 => ", intensity",
                6 => ", colour",
                7 => ", intensity, colour",
                _ => "",
            };
            facts.push((
                format!("scan {} fields", n + 1),
                format!(
                    "{} records, {} columns of {} rows, Cartesian{holds}, pose",
                    block.n_lines,
                    block.n_lines.checked_div(block.n_rows).unwrap_or(0),
                    block.n_rows
                ),
            ));
        }
        facts
    }
}
