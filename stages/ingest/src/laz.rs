//! Decompresses the point records of LAZ files, in file order. Every number that the decoder trusts
//! (chunk table, layer sizes, counts) is first checked against the length of the file.

use crate::las_header::LasHeader;
use crate::reader::{Extent, Want};
use crate::settings::Settings;
use contract::{Error, Kind, Result, fence};
use laz::laszip::{ChunkTable, ChunkTableEntry, CompressorType};
use laz::{DecompressionSelection, LasZipDecompressor, LazItemRecordBuilder, LazItemType, LazVlr};
use std::io::Cursor;
use std::ops::Range;

/// Largest compression ratio of a piece; real ones stay below, and a larger claim would cost
/// memory.
const MAX_RATIO: u64 = 250;
/// Size of a decompressed piece up to which any ratio is accepted, bytes: 50,000 equal points take
/// next to no space.
const SMALL_PIECE: u64 = 4 << 20;

/// How the points of a LAZ file are decompressed.
#[derive(Debug, Clone)]
pub(crate) struct Laz {
    vlr: LazVlr,
    record_len: usize,
    points_at: usize,
    n_points: u64,
    layered: bool,
    /// Independently compressed runs of points (LAZ calls them chunks); empty where the file is
    /// one stream that can only be read from its start.
    pub(crate) pieces: Vec<Extent>,
}

fn damaged(what: impl Into<String>) -> Error {
    Error::bad_input(what).hint("the file is damaged; copy or compress it again")
}

impl Laz {
    /// Reads and checks the LASzip record and the table of pieces.
    pub(crate) fn read(data: &[u8], header: &LasHeader, settings: &Settings) -> Result<Self> {
        let (at, n) = header.laszip.ok_or_else(|| damaged("the LASzip record is missing"))?;
        let (vlr, compressor) =
            read_vlr(&data[at..at + n], header).map_err(|e| e.at("LASzip record"))?;
        let mut laz = Self {
            vlr,
            record_len: header.record_len,
            points_at: header.points_at,
            n_points: header.n_points,
            layered: compressor == CompressorType::LayeredChunked,
            pieces: Vec::new(),
        };
        if compressor == CompressorType::PointWise || laz.n_points == 0 {
            return Ok(laz);
        }
        let table = laz.read_table(data).map_err(|e| e.at("chunk table"));
        let pieces = match table {
            Ok(table) => table,
            // A stream without table can still be read from its start, unless the size of its
            // pieces is unknown.
            Err(_) if laz.readable_without_table(data) => return Ok(laz),
            Err(error) => return Err(error),
        };
        let most = pieces.iter().map(|p| p.n_points).max().unwrap_or(0);
        if most.saturating_mul(laz.record_len as u64) <= settings.max_laz_chunk_bytes {
            laz.pieces = pieces;
        } else if laz.layered || laz.vlr.uses_variable_size_chunks() {
            return Err(Error::new(Kind::OverBudget, format!("a chunk has \"{most}\" points"))
                .at("chunk table")
                .hint("compress the file again with the usual chunk size of 50000 points"));
        }
        Ok(laz)
    }

    /// Whether the file can be read without table: a writer that could not seek leaves −1 as the
    /// offset of the table, and no table.
    fn readable_without_table(&self, data: &[u8]) -> bool {
        let place = data.get(self.points_at..self.points_at + 8);
        place == Some(&(-1_i64).to_le_bytes())
            && !self.layered
            && !self.vlr.uses_variable_size_chunks()
    }

    fn read_table(&self, data: &[u8]) -> Result<Vec<Extent>> {
        let start = self.points_at + ChunkTable::OFFSET_SIZE;
        let table_at = self.table_at(data)?;
        let header = data
            .get(table_at..table_at + 8)
            .ok_or_else(|| damaged("the chunk table lies outside the file"))?;
        let n = u64::from(u32::from_le_bytes([header[4], header[5], header[6], header[7]]));
        // Each chunk starts with one uncompressed record, which bounds their number.
        let most = ((table_at - start) / self.record_len) as u64;
        if n > most {
            return Err(damaged(format!(
                "at most {most} chunks fit into the file, stated are \"{n}\""
            )));
        }
        let size = u64::from(self.vlr.chunk_size());
        let varying = self.vlr.uses_variable_size_chunks();
        if !varying && n != self.n_points.div_ceil(size) {
            return Err(damaged(format!(
                "{} points cannot be in \"{n}\" chunks of {size}",
                self.n_points
            )));
        }
        let mut source = Cursor::new(data);
        source.set_position(table_at as u64);
        let table =
            guarded("reading the chunk table", || ChunkTable::read(&mut &mut source, varying))?;
        let entries = table.as_ref().iter().map(|e| {
            let point_count = if varying { e.point_count } else { size };
            ChunkTableEntry { point_count, ..*e }
        });
        self.pieces_of(entries, start, table_at)
    }

    fn pieces_of(
        &self,
        table: impl Iterator<Item = ChunkTableEntry>,
        start: usize,
        end: usize,
    ) -> Result<Vec<Extent>> {
        let (mut at, mut first) = (start, 0_u64);
        let mut pieces = Vec::new();
        for (i, entry) in table.enumerate() {
            let n_bytes = usize::try_from(entry.byte_count).unwrap_or(usize::MAX);
            let n_points = entry.point_count.min(self.n_points.saturating_sub(first));
            let fits = n_bytes <= end - at && (n_bytes >= self.record_len || n_points == 0);
            if !fits || (self.vlr.uses_variable_size_chunks() && n_points != entry.point_count) {
                return Err(damaged(format!(
                    "chunk {i} of {} points cannot have \"{}\" bytes here",
                    entry.point_count, entry.byte_count
                )));
            }
            if n_points * self.record_len as u64 > SMALL_PIECE + MAX_RATIO * n_bytes as u64 {
                return Err(damaged(format!(
                    "{n_bytes} bytes of chunk {i} cannot hold \"{n_points}\" points"
                )));
            }
            pieces.push(Extent { bytes: at as u64..(at + n_bytes) as u64, first, n_points });
            at += n_bytes;
            first += n_points;
        }
        if first != self.n_points {
            return Err(damaged(format!(
                "the chunks hold {first} points, stated are \"{}\"",
                self.n_points
            )));
        }
        pieces.retain(|p| p.n_points > 0);
        Ok(pieces)
    }

    fn table_at(&self, data: &[u8]) -> Result<usize> {
        let at = |from: usize| -> Option<usize> {
            let bytes: [u8; 8] = data.get(from..from + 8)?.try_into().ok()?;
            let at = usize::try_from(i64::from_le_bytes(bytes)).ok()?;
            (at >= self.points_at + ChunkTable::OFFSET_SIZE && at <= data.len() - 8).then_some(at)
        };
        // A writer that could not seek back leaves the offset at the end of the file.
        let stated = at(self.points_at).or_else(|| at(data.len().checked_sub(8)?));
        stated.ok_or_else(|| damaged("the chunk table is missing or lies outside the file"))
    }

    /// Index of the piece that holds a place, or after which the place would come.
    pub(crate) fn piece_of(&self, place: u64) -> usize {
        self.pieces.partition_point(|p| p.first + p.n_points <= place)
    }

    /// Decompresses the first `n` points of a piece.
    pub(crate) fn head(&self, data: &[u8], piece: &Extent, n: usize) -> Result<Vec<u8>> {
        let part = Extent { n_points: piece.n_points.min(n as u64), ..piece.clone() };
        self.decompress(part.of(data), &part, Want::Everything)
    }

    /// Decompresses a whole piece from its bytes.
    pub(crate) fn decompress(&self, bytes: &[u8], piece: &Extent, want: Want) -> Result<Vec<u8>> {
        let Extent { bytes: Range { start, .. }, first, n_points } = piece;
        let end = first + n_points;
        let place = || format!("chunk at byte {start}, points {first} to {end}");
        self.check_layers(bytes, *n_points).map_err(|e| e.at(place()))?;
        let mut records = vec![0; *n_points as usize * self.record_len];
        let table = [ChunkTableEntry { point_count: *n_points, byte_count: bytes.len() as u64 }];
        guarded("decompressing", || {
            let (vlr, fields) = (&self.vlr, selection(want));
            laz::par_decompress_selective(bytes, &mut records, vlr, &table, fields)
        })
        .map_err(|e| e.at(place()))?;
        Ok(records)
    }

    /// Checks the layer sizes that a layered piece states, since the decoder allocates as much as
    /// they say.
    fn check_layers(&self, bytes: &[u8], n_expected: u64) -> Result<()> {
        if !self.layered {
            return Ok(());
        }
        let n_layers: usize = self.vlr.items().iter().map(|i| layers(i.item_type())).sum();
        let head = self.record_len + 4 + 4 * n_layers;
        if bytes.len() < head {
            return Err(damaged(format!(
                "a chunk has at least {head} bytes, this one has \"{}\"",
                bytes.len()
            )));
        }
        let number = |at: usize| {
            u64::from(u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]))
        };
        let n_points = number(self.record_len);
        if n_points < n_expected {
            return Err(damaged(format!(
                "{n_expected} points are expected, the chunk has \"{n_points}\""
            )));
        }
        let total: u64 = (0..n_layers).map(|i| number(self.record_len + 4 + 4 * i)).sum();
        if total > (bytes.len() - head) as u64 {
            return Err(damaged(format!(
                "its layers would have \"{total}\" bytes, there are {}",
                bytes.len() - head
            )));
        }
        Ok(())
    }

    /// A reader that starts at the beginning of a file that is one stream.
    pub(crate) fn stream<'a>(&self, data: &'a [u8]) -> Result<LazStream<'a>> {
        let mut source = Cursor::new(data);
        source.set_position(self.points_at as u64);
        let vlr = self.vlr.clone();
        let inner = guarded("starting the decoder", || LasZipDecompressor::new(source, vlr))?;
        Ok(LazStream { inner, record_len: self.record_len })
    }
}

/// A LAZ file that can only be read from its start.
pub(crate) struct LazStream<'a> {
    inner: LasZipDecompressor<'a, Cursor<&'a [u8]>>,
    record_len: usize,
}

impl LazStream<'_> {
    /// The next `n` records.
    pub(crate) fn next(&mut self, n: usize) -> Result<Vec<u8>> {
        let mut records = vec![0; n * self.record_len];
        guarded("decompressing", || self.inner.decompress_many(&mut records))?;
        Ok(records)
    }
}

/// Runs the decoder and catches its panics, which damaged files cause.
fn guarded<T, E>(doing: &str, run: impl FnOnce() -> std::result::Result<T, E>) -> Result<T>
where
    E: std::error::Error + Send + Sync + 'static,
{
    match fence::fenced(run) {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(cause)) => Err(damaged(format!("{doing} failed")).because(cause)),
        Err(words) => Err(damaged(format!("{doing} broke off")).because(words)),
    }
}

fn layers(item: LazItemType) -> usize {
    match item {
        LazItemType::Point14 => 9,
        LazItemType::RGBNIR14 => 2,
        LazItemType::Byte14(n) => usize::from(n),
        _ => 1,
    }
}

/// The fields to decompress; layered formats allow the others to stay compressed.
fn selection(want: Want) -> DecompressionSelection {
    match want {
        Want::Everything => DecompressionSelection::all(),
        Want::Coordinates => DecompressionSelection::base()
            .decompress_z()
            .decompress_flags()
            .decompress_point_source_id(),
    }
}

/// Reads the LASzip record. Its items must match the point format, since the decoder trusts them.
fn read_vlr(payload: &[u8], header: &LasHeader) -> Result<(LazVlr, CompressorType)> {
    let mut payload = payload.to_vec();
    if payload.len() < 34 {
        return Err(damaged(format!("34 bytes are needed, there are \"{}\"", payload.len())));
    }
    let compressor = match u16::from_le_bytes([payload[0], payload[1]]) {
        1 => CompressorType::PointWise,
        2 => CompressorType::PointWiseChunked,
        3 => CompressorType::LayeredChunked,
        other => {
            return Err(Error::new(Kind::Unsupported, format!("compressor type \"{other}\""))
                .hint("types 1 to 3 are known; decompress the file to LAS"));
        }
    };
    let n_items = usize::from(u16::from_le_bytes([payload[32], payload[33]]));
    if payload.len() < 34 + 6 * n_items {
        return Err(damaged(format!("{} bytes cannot hold \"{n_items}\" items", payload.len())));
    }
    if compressor == CompressorType::PointWise {
        // LASzip 1 leaves the chunk size zero, which the decoder would take for varying sizes.
        payload[12..16].copy_from_slice(&50_000_u32.to_le_bytes());
    }
    let vlr = LazVlr::read_from(payload.as_slice()).map_err(|cause| {
        Error::new(Kind::Unsupported, "the compression is not known").because(cause)
    })?;
    let extra =
        header.record_len - crate::las_layout::RecordLayout::of(header.format).map_or(0, |l| l.len);
    let expected =
        LazItemRecordBuilder::default_for_point_format_id(header.format, extra as u16)
            .map_err(|cause| damaged("the compression does not fit the points").because(cause))?;
    let same = |a: &laz::LazItem, b: &laz::LazItem| {
        a.item_type() == b.item_type()
            && a.size() == b.size()
            && (a.version() > 2) == (b.version() > 2)
    };
    let layered = compressor == CompressorType::LayeredChunked;
    let fits = vlr.items().len() == expected.len()
        && vlr.items().iter().zip(&expected).all(|(a, b)| same(a, b))
        && expected.first().is_some_and(|i| (i.version() > 2) == layered);
    if !fits {
        return Err(damaged(format!(
            "its items do not fit records of point format \"{}\"",
            header.format
        )));
    }
    Ok((vlr, compressor))
}
