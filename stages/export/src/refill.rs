//! Copies the points of an earlier result's tile that are not superseded to a tile that is being
//! written, behind its new points. Records are copied byte for byte.

use crate::block::DirectReader;
use crate::chunks;
use crate::las::head;
use crate::record::{CLASSES, LasSettings, RecordExtent};
use crate::spool::{Blocks, Spool};
use contract::{Error, Label, PointKind, Result, fence};
use las::raw;
use laz::LasZipDecompressor;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

/// Kind of each LAS class.
pub(crate) const KINDS: [PointKind; 256] = {
    let mut kinds = [PointKind::Uncertain; 256];
    let mut i = 0;
    while i < CLASSES.len() {
        kinds[CLASSES[i].1 as usize] = CLASSES[i].0;
        i += 1;
    }
    kinds
};
/// Number of records that are read at a time; they stay in a core's own cache.
const PIECE: u64 = 1 << 12;

/// Number of bytes that are summed at a time.
const SUMMED: usize = 1 << 18;
/// Number of bytes that are buffered for a tile.
const WAITING: usize = 1 << 20;

/// A point of an earlier result.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OldPoint {
    /// World coordinates, metres.
    pub world: [f64; 3],
    /// Label in the earlier result.
    pub label: Label,
    /// LAS `point_source_id`: number of its scan, from 1, or that of its LAS file.
    pub source_id: u16,
}

/// Length and checksum of a tile, as a list of files states them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StatedTile {
    /// Length, bytes.
    pub n_bytes: u64,
    /// CRC-32C (Castagnoli) of all bytes.
    pub crc32c: u32,
}

impl Spool {
    /// Adds the points of a tile with the same record format for which `keep` returns true; `keep`
    /// is called piece by piece. If `stated` is given, the tile is compared with it while it is
    /// read.
    ///
    /// # Errors
    /// If the tile was not written by this program, differs from `stated` or cannot be read, or if
    /// the new tile cannot be written.
    pub fn take_from(
        &mut self,
        old: &Path,
        stated: Option<StatedTile>,
        keep: impl Fn(&[OldPoint]) -> Vec<bool>,
    ) -> Result<()> {
        let las = self.las().clone();
        let (record_len, mut blocks) = (las.record_len(), Blocks::new(WAITING));
        let (mut bytes, mut points) = (Vec::new(), Vec::new());
        let mut tile = RefillTile::open(old, &las, stated)?;
        while let Some(records) = tile.piece(&mut bytes)? {
            points.clear();
            points.extend(records.chunks_exact(record_len).map(|record| point(record, &las)));
            for run in runs(&keep(&points)) {
                let run = &records[run.start * record_len..run.end * record_len];
                let mut extent = RecordExtent::default();
                run.chunks_exact(record_len).for_each(|record| extent.add(steps(record)));
                self.push(run, &extent, &mut blocks)?;
            }
        }
        Ok(())
    }
}

/// Passes the points of a tile with records as `las` says to `take`, piece by piece. If `stated` is
/// given, the tile is compared with it while it is read; if that fails at the end, everything that
/// was taken is invalid.
///
/// # Errors
/// If the tile was not written by this program, differs from `stated` or cannot be read, or if
/// `take` ends the work.
pub fn read_tile(
    path: &Path,
    las: &LasSettings,
    stated: Option<StatedTile>,
    mut take: impl FnMut(&[OldPoint]) -> Result<()>,
) -> Result<()> {
    let (record_len, mut bytes, mut points) = (las.record_len(), Vec::new(), Vec::new());
    let mut tile = RefillTile::open(path, las, stated)?;
    while let Some(records) = tile.piece(&mut bytes)? {
        points.clear();
        points.extend(records.chunks_exact(record_len).map(|record| point(record, las)));
        take(&points)?;
    }
    Ok(())
}

/// The runs of consecutive records that stay.
fn runs(stays: &[bool]) -> impl Iterator<Item = Range<usize>> {
    let mut at = 0;
    let runs = stays.chunk_by(|a, b| a == b).map(move |run| {
        at += run.len();
        (run[0], at - run.len()..at)
    });
    runs.filter(|(stays, _)| *stays).map(|(_, run)| run)
}

/// Coordinates of a record, in steps.
#[inline]
fn steps(record: &[u8]) -> [i32; 3] {
    let int = |at: usize| {
        i32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]])
    };
    [int(0), int(4), int(8)]
}

#[inline]
fn point(record: &[u8], las: &LasSettings) -> OldPoint {
    let (q, steps) = (&las.quantum, steps(record));
    let metres = |i: usize| f64::from(steps[i]) * q.scale[i] + q.offset[i];
    let kind = KINDS[usize::from(record[16])];
    let at = if las.with_color { 36 } else { 30 };
    let index = |at: usize| u16::from_le_bytes([record[at], record[at + 1]]).wrapping_sub(1) as i16;
    let label = Label { kind, robot: index(at), link: index(at + 2) };
    let source_id = u16::from_le_bytes([record[20], record[21]]);
    OldPoint { world: [metres(0), metres(1), metres(2)], label, source_id }
}

/// A tile that is read piece by piece.
struct RefillTile<'a> {
    path: &'a Path,
    records: RefillRecords,
    record_len: usize,
    left: u64,
    /// The stated sum and the sum of what was read, if a sum is stated and the file is read
    /// sequentially.
    sum: Option<(StatedTile, StatedTile)>,
}

enum RefillRecords {
    /// A tile without points: its table of chunks is not read, whatever it states.
    None,
    Plain(DirectReader),
    Compressed(Box<LasZipDecompressor<'static, BufReader<File>>>),
}

impl<'a> RefillTile<'a> {
    fn open(path: &'a Path, las: &LasSettings, stated: Option<StatedTile>) -> Result<Self> {
        let failed = |e| Error::of_read("tile cannot be read", path, e);
        let foreign = || {
            let what =
                "this is not a tile of the earlier result: the format of its records differs";
            Error::bad_input(what).at(path.display()).hint("run the whole plant again")
        };
        let mut file = BufReader::new(File::open(path).map_err(failed)?);
        let header = raw::Header::read_from(&mut file).map_err(|e| foreign().because(e))?;
        let expected = head(las, &RecordExtent::default())?.len();
        let scales = [header.x_scale_factor, header.y_scale_factor, header.z_scale_factor];
        let is_ours = header.offset_to_point_data as usize == expected
            && usize::from(header.point_data_record_length) == las.record_len()
            && scales == las.quantum.scale;
        if !is_ours {
            return Err(foreign());
        }
        let left =
            header.large_file.map(|large| large.number_of_point_records).ok_or_else(foreign)?;
        let mut sum = None;
        let records = if las.compress {
            // Chunks are read by the table and not sequentially, so that the file is summed first.
            if let Some(stated) = stated {
                let read = sum_of(file.get_mut()).map_err(failed)?;
                compare(path, stated, read)?;
            }
            if left == 0 {
                return Ok(Self {
                    path,
                    records: RefillRecords::None,
                    record_len: las.record_len(),
                    left,
                    sum,
                });
            }
            let laz = crate::las::laz_vlr(las);
            let at = expected as u64;
            let fits = chunks::check(&mut file, at, &laz, las, left).map_err(failed)?;
            fits.map_err(|what| foreign().because(what))?;
            file.seek(SeekFrom::Start(at)).map_err(failed)?;
            let reader = decoded(path, || LasZipDecompressor::new(file, laz))?;
            let reader = reader.map_err(|e| foreign().because(e))?;
            RefillRecords::Compressed(Box::new(reader))
        } else {
            if let Some(stated) = stated {
                let mut head = vec![0; expected];
                file.seek(SeekFrom::Start(0))
                    .and_then(|_| file.read_exact(&mut head))
                    .map_err(failed)?;
                let read = StatedTile { n_bytes: expected as u64, crc32c: crc32c::crc32c(&head) };
                sum = Some((stated, read));
            }
            RefillRecords::Plain(
                DirectReader::new(file.into_inner(), expected as u64).map_err(failed)?,
            )
        };
        Ok(Self { path, records, record_len: las.record_len(), left, sum })
    }

    /// The next records, read into `bytes`; `None` at the end.
    fn piece<'b>(&mut self, bytes: &'b mut Vec<u8>) -> Result<Option<&'b [u8]>> {
        let n = self.left.min(PIECE);
        if n == 0 {
            return match self.sum {
                Some((stated, read)) => compare(self.path, stated, read).map(|()| None),
                None => Ok(None),
            };
        }
        bytes.resize(n as usize * self.record_len, 0);
        let read = match &mut self.records {
            RefillRecords::None => Ok(()),
            RefillRecords::Plain(file) => file.read_exact(bytes),
            RefillRecords::Compressed(reader) => {
                decoded(self.path, || reader.decompress_many(bytes))?
            }
        };
        read.map_err(|e| Error::of_read("tile cannot be read", self.path, e))?;
        if let Some((_, read)) = &mut self.sum {
            read.n_bytes += bytes.len() as u64;
            read.crc32c = crc32c::crc32c_append(read.crc32c, bytes);
        }
        self.left -= n;
        Ok(Some(bytes))
    }
}

/// The outcome of a decoder, which may panic where the bytes of a tile were changed.
///
/// # Errors
/// If it panics.
pub(crate) fn decoded<T>(tile: &Path, decode: impl FnOnce() -> T) -> Result<T> {
    fence::fenced(decode).map_err(|panic| {
        Error::bad_input("tile cannot be decoded")
            .because(panic)
            .at(tile.display())
            .hint("`stillpoint verify` names all files that are wrong; run the same job again")
    })
}

/// Length and checksum of a whole file.
fn sum_of(file: &mut File) -> std::io::Result<StatedTile> {
    let (mut bytes, mut sum) = (vec![0; SUMMED], StatedTile { n_bytes: 0, crc32c: 0 });
    file.seek(SeekFrom::Start(0))?;
    loop {
        let n = file.read(&mut bytes)?;
        if n == 0 {
            return Ok(sum);
        }
        sum.n_bytes += n as u64;
        sum.crc32c = crc32c::crc32c_append(sum.crc32c, &bytes[..n]);
    }
}

/// Refuses a tile whose length or checksum differs from the stated one.
fn compare(path: &Path, stated: StatedTile, read: StatedTile) -> Result<()> {
    if stated == read {
        return Ok(());
    }
    Err(Error::bad_input("its bytes are not those that were written")
        .at(path.display())
        .hint("`stillpoint verify` names all files that are wrong; run the same job again"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decoder_that_panics_is_an_error_of_its_tile() {
        let broken = decoded(Path::new("tiles/0_0.laz"), || -> u8 { panic!("index out of range") });
        let said = broken.expect_err("it panics");
        assert_eq!(said.kind(), contract::Kind::BadInput);
        let said = said.to_string();
        assert!(said.contains("0_0.laz") && said.contains("index out of range"), "{said}");
        assert_eq!(decoded(Path::new("tiles/0_0.laz"), || 7).ok(), Some(7));
    }
}
