//! An open input in; some of its points, spread over it as well as its format lets, out: enough to
//! guess what stands in a plant without reading all of it.

use crate::file::OpenFile;
use crate::reader::{Extent, FileReading, RawStrip, RawStrips, Want};
use crate::sources::Sources;
use contract::{Fan, InputId, Result};
use geometry::Point;

/// How much is looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GlanceSample {
    /// Points that are decoded, about, at most.
    pub n_decoded: u64,
    /// Points that are kept of those, about, at most.
    pub n_kept: u64,
}

/// What was seen of an input.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Glance {
    /// Points, world, metres.
    pub points: Vec<[f64; 3]>,
    /// Points that were decoded to choose them from.
    pub n_decoded: u64,
}

impl Sources {
    /// Looks at points of an input: of formats that are read in pieces at every few pieces, of E57
    /// files at the beginning of each scan, of others at the beginning of the file.
    ///
    /// # Errors
    /// An input that is broken where it was looked at, with its path.
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

    /// Every so many of the points of strips, until so many are decoded.
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
