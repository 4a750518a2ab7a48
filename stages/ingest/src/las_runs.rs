//! Reads the point records of a LAS or LAZ file in runs, from the file or from the decompressor.

use crate::las_header::LasHeader;
use crate::laz::Laz;
use crate::map::{Mapped, map};
use crate::reader::Extent;
use crate::settings::Settings;
use crate::units::{Choice, Units};
use contract::Result;
use std::borrow::Cow;
use std::path::Path;

/// Largest run of records that is decompressed from a stream at once, bytes. It holds more than a
/// strip of usual records.
const RUN_BYTES: usize = 16 << 20;

/// Number of records of this length that are decompressed from a stream at once. The length of a
/// stream is not stated, and a header may state records of 64 KiB, so that a strip of them would
/// take gigabytes.
pub(crate) fn at_once(record_len: usize) -> usize {
    (RUN_BYTES / record_len.max(1)).max(1)
}

/// The records of a file, whichever way they are stored.
pub(crate) struct LasRecords {
    pub(crate) map: Mapped,
    /// Header, checked, in metres.
    pub(crate) header: LasHeader,
    /// Units of the coordinates in the file.
    pub(crate) units: Units,
    /// How to decompress, where they are compressed.
    pub(crate) laz: Option<Laz>,
}

impl LasRecords {
    /// Opens a file and checks its header.
    pub(crate) fn open(path: &Path, settings: &Settings) -> Result<Self> {
        let map = map(path)?;
        let header = LasHeader::read(&map)?;
        let choice = Choice::read(&settings.units)?;
        let units = Units::of(&header.declared, choice.of(path))?;
        let header = header.in_metres(units.factors())?;
        let laz = if header.compressed { Some(Laz::read(&map, &header, settings)?) } else { None };
        Ok(Self { map, header, units, laz })
    }

    /// At most `n` records from `first` on; `(place of the first one, records)`. Where records are
    /// compressed, the run starts at the piece that holds `first`; where they are one stream,
    /// at the start of the file.
    pub(crate) fn run(&self, first: u64, n: usize) -> Result<(u64, Cow<'_, [u8]>)> {
        let n = n.min(usize::try_from(self.header.n_points.saturating_sub(first)).unwrap_or(n));
        let Some(laz) = &self.laz else {
            return Ok((first, Cow::Borrowed(self.mapped(first, n))));
        };
        if laz.pieces.is_empty() {
            let n = n.min(at_once(self.header.record_len));
            return Ok((0, Cow::Owned(laz.stream(&self.map)?.next(n)?)));
        }
        let mut at = laz.piece_of(first);
        let start = laz.pieces.get(at).map_or(first, |p| p.first);
        let mut records = Vec::new();
        let mut left = n;
        while let Some(piece) = laz.pieces.get(at).filter(|_| left > 0) {
            records.extend(laz.head(&self.map, piece, left)?);
            left = left.saturating_sub(piece.n_points as usize);
            at += 1;
        }
        Ok((start, Cow::Owned(records)))
    }

    /// Where [`LasRecords::run`] would start.
    pub(crate) fn start(&self, first: u64) -> u64 {
        let Some(laz) = &self.laz else { return first };
        laz.pieces.get(laz.piece_of(first)).map_or(0, |p| p.first)
    }

    /// Runs of records that can be read independently, with what lies between them: `n` points each
    /// in uncompressed files; `None` if the records are one stream.
    pub(crate) fn extents(&self, n: usize) -> Option<Box<dyn Iterator<Item = Extent> + Send + '_>> {
        let (header, n_bytes) = (&self.header, self.map.len() as u64);
        let Some(laz) = &self.laz else {
            let at = |place: u64| header.points_at as u64 + place * header.record_len as u64;
            let runs = (0..header.n_points).step_by(n).map(move |first| {
                let n_points = (n as u64).min(header.n_points - first);
                Extent { bytes: at(first)..at(first + n_points), first, n_points }
            });
            return Some(Box::new(Extent::cover(runs, n_bytes)));
        };
        let is_stream = laz.pieces.is_empty();
        (!is_stream).then(|| Box::new(Extent::cover(laz.pieces.iter().cloned(), n_bytes)) as _)
    }

    /// Records of an uncompressed file. In range, since the count was checked against the file's
    /// length.
    fn mapped(&self, first: u64, n: usize) -> &[u8] {
        let from = self.header.points_at + first as usize * self.header.record_len;
        &self.map[from..from + n * self.header.record_len]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_is_decompressed_in_runs_of_bounded_bytes() {
        for record_len in [20, 30, 67, 1000, usize::from(u16::MAX)] {
            let n = at_once(record_len);
            assert!(n >= 1 && n * record_len <= RUN_BYTES, "{n} records of {record_len} bytes");
        }
        assert!(at_once(67) > Settings::default().strip_points, "usual records: whole strips");
    }
}
