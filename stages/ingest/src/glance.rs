//! Reads some points of an open input, spread over it as well as its format allows. They suffice to
//! estimate the content of a plant without reading all points.

use crate::file::OpenFile;
use crate::reader::{Extent, FileReading, RawStrip, RawStrips, Want};
use crate::sources::Sources;
use contract::{Fan, InputId, Result};
use geometry::Point;

/// Size of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GlanceSample {
    /// Approximate largest number of points that are decoded.
    pub n_decoded: u64,
    /// Approximate largest number of points that are kept.
    pub n_kept: u64,
}

/// A sample of an input's points.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Glance {
    /// The points, world, metres.
    pub points: Vec<[f64; 3]>,
    /// Number of points that were decoded for it.
    pub n_decoded: u64,
}

impl Sources {
    /// Samples the points of an input: of a format that is read in pieces from every few pieces, of
    /// an E57 file from the beginning of each scan, of others from the beginning of the file.
    ///
    /// # Errors
    /// If the input is broken where it is read; the error names its path.
    pub fn glance(&self, input: InputId, sample: GlanceSample, fan: &dyn Fan) -> Result<Glance> {
        let (file, path) = self.open(input)?;
        self.glanced(file, sample, fan).map_err(|e| e.at(path.display()))
    }

    fn glanced(&self, file: &OpenFile, sample: GlanceSample, fan: &dyn Fan) -> Result<Glance> {
        let n_stated: u64 = file.reader.masks().iter().filter_map(|m| m.n_stated).sum();
        let every = sample.n_decoded.min(n_stated).div_ceil(sample.n_kept.max(1)).max(1);
        let found = match file.reader.read(Want::Coordinates)? {
            FileReading::ByExtent(extents) => {
                let all: Vec<Extent> = extents.filter(|e| e.n_points > 0).collect();
                let n: u64 = all.iter().map(|e| e.n_points).sum();
                let stride = n.div_ceil(sample.n_decoded.max(1)).max(1) as usize;
                let chosen: Vec<Extent> = all.into_iter().step_by(stride).collect();
                fan.fan(chosen, |extent| {
                    let bytes = file.reader.mapped().map_or(&[][..], |map| extent.of(map));
                    let strips = file.reader.decode(&extent, bytes, Want::Coordinates)?;
                    self.thinned(file, strips.into_iter().map(Ok), u64::MAX, every)
                })
            }
            FileReading::Straight(strips) => {
                let n_scans = file.reader.scans().len();
                let share = sample.n_decoded / n_scans.max(1) as u64;
                let scans: Option<Vec<RawStrips<'_>>> =
                    (0..n_scans).map(|scan| file.reader.read_scan(scan)).collect();
                match scans {
                    Some(scans) => fan.fan(scans, |scan| self.thinned(file, scan, share, every)),
                    None => vec![self.thinned(file, strips, sample.n_decoded, every)],
                }
            }
        };
        file.reader.check()?;
        found.into_iter().try_fold(Glance::default(), |mut all, part| {
            let part: Glance = part?;
            all.points.extend(part.points);
            all.n_decoded += part.n_decoded;
            Ok(all)
        })
    }

    /// Keeps one of every few points of the strips, until enough are decoded.
    fn thinned(
        &self,
        file: &OpenFile,
        strips: impl Iterator<Item = Result<RawStrip>>,
        most: u64,
        every: u64,
    ) -> Result<Glance> {
        let mut out = Glance::default();
        for strip in strips {
            let strip = file.number(strip?);
            let pose = self.scans[strip.scan.0 as usize].world_from_scan;
            let first = (every - out.n_decoded % every) % every;
            let kept = strip.xyz.iter().skip(first as usize).step_by(every as usize);
            out.points.extend(kept.map(|p| {
                let world: [f64; 3] = (pose * Point::from(p.map(f64::from))).coords.into();
                world
            }));
            out.n_decoded += strip.xyz.len() as u64;
            if out.n_decoded >= most {
                break;
            }
        }
        Ok(out)
    }
}
