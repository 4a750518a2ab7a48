//! The catalogue of a store: the entries of all tiles, written to and read from a file with a
//! checksum.
//!
//! The file has a header of 64 bytes (magic 8, version u32, zero u32, length of the archive u64,
//! its BLAKE3 digest 32, zeros), then an `rkyv` archive of exactly that length and nothing more,
//! since `rkyv` may read trailing bytes as another archive.

use super::layout::{ALIGN, layout};
use super::record::N_LEVELS;
use contract::{Error, Result, ScanId, TileAt, Weigh};
use export::atomic;
use geometry::Aabb;
use rkyv::{Archive, Deserialize, Serialize};
use std::path::Path;

/// Name of the catalogue file in the folder of a store.
pub(super) const CATALOGUE: &str = "catalogue.rkyv";
/// Name of the file that holds all tiles.
pub(super) const TILES: &str = "tiles.bin";
/// Length of the header of both files, bytes.
pub(super) const HEADER_BYTES: u64 = 64;
/// Version of both formats; increased with every change of either.
const VERSION: u32 = 2;
const CATALOGUE_MAGIC: &[u8; 8] = b"STILLCAT";
const TILES_MAGIC: &[u8; 8] = b"STILLTIL";

/// Entry of one tile in the catalogue.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TileEntry {
    /// Scan, row and column of the tile.
    pub at: TileAt,
    /// Number of points.
    pub n_points: u64,
    /// Smallest place (index in the mask) of its points.
    pub first_place: u64,
    /// Bounds of its points in the world frame, metres.
    pub bounds: Aabb,
    /// Distance from the origin of the scan within which about four fifths of its points lie,
    /// metres; 0 for a tile with few points.
    pub range: f32,
    /// Offset of its bytes in the tile file.
    pub(super) offset: u64,
    /// Number of points of each level, coarsest level first.
    pub(super) n_of: [u32; N_LEVELS],
    /// CRC-32C of the bytes of each level.
    pub(super) checksums: [u32; N_LEVELS],
}

impl TileEntry {
    /// Length of its `n_levels` coarsest levels, bytes.
    pub(super) fn n_bytes(&self, n_levels: usize) -> u64 {
        self.n_of.iter().take(n_levels).map(|n| layout(u64::from(*n))[3]).sum()
    }
}

impl Weigh for TileEntry {
    fn weight_bytes(&self) -> usize {
        size_of::<Self>()
    }

    fn n_points(&self) -> u64 {
        self.n_points
    }
}

/// A [`TileEntry`] as it is archived.
#[derive(Archive, Serialize, Deserialize)]
struct TileRow {
    at: [u32; 3],
    n_of: [u32; N_LEVELS],
    checksums: [u32; N_LEVELS],
    n_points: u64,
    first_place: u64,
    offset: u64,
    range: f32,
    bounds: [[f64; 3]; 2],
}

/// Content of the archive.
#[derive(Archive, Serialize, Deserialize)]
struct TileRows {
    /// Length of the tile file, bytes.
    n_tile_bytes: u64,
    rows: Vec<TileRow>,
}

/// The header of the tile file.
pub(super) fn tiles_header() -> [u8; HEADER_BYTES as usize] {
    let mut header = [0; HEADER_BYTES as usize];
    header[..8].copy_from_slice(TILES_MAGIC);
    header[8..12].copy_from_slice(&VERSION.to_le_bytes());
    header
}

/// Writes the catalogue of a tile file of `n_tile_bytes` bytes. Scans are numbered from the `first`
/// scan of the store, since another run may number them differently.
pub(super) fn write(
    path: &Path,
    entries: &[TileEntry],
    n_tile_bytes: u64,
    first: u32,
) -> Result<()> {
    let rows = entries.iter().map(|e| TileRow {
        at: [e.at.scan.0 - first, e.at.row, e.at.col],
        n_of: e.n_of,
        checksums: e.checksums,
        n_points: e.n_points,
        first_place: e.first_place,
        offset: e.offset,
        range: e.range,
        bounds: [e.bounds.min, e.bounds.max],
    });
    let rows = TileRows { n_tile_bytes, rows: rows.collect() };
    let archive = rkyv::to_bytes::<rkyv::rancor::Error>(&rows).map_err(|e| {
        Error::new(contract::Kind::Bug, "the catalogue cannot be archived").because(e)
    })?;
    let mut bytes = Vec::with_capacity(HEADER_BYTES as usize + archive.len());
    bytes.extend_from_slice(CATALOGUE_MAGIC);
    bytes.extend_from_slice(&VERSION.to_le_bytes());
    bytes.extend_from_slice(&[0; 4]);
    bytes.extend_from_slice(&(archive.len() as u64).to_le_bytes());
    bytes.extend_from_slice(blake3::hash(&archive).as_bytes());
    bytes.resize(HEADER_BYTES as usize, 0);
    bytes.extend_from_slice(&archive);
    atomic::write(path, &bytes)
}

/// Digest of the content of some tiles of one store, independent of its folder; scans are numbered
/// from the store's first scan.
pub(super) fn digest(entries: &[TileEntry]) -> String {
    let first = entries.first().map_or(0, |e| e.at.scan.0);
    let mut hasher = blake3::Hasher::new();
    for e in entries {
        for n in [e.at.scan.0 - first, e.at.row, e.at.col].iter().chain(&e.n_of).chain(&e.checksums)
        {
            hasher.update(&n.to_le_bytes());
        }
        hasher.update(&e.first_place.to_le_bytes());
        hasher.update(&e.range.to_le_bytes());
        for bound in e.bounds.min.iter().chain(&e.bounds.max) {
            hasher.update(&bound.to_le_bytes());
        }
    }
    format!("blake3:{}", hasher.finalize().to_hex())
}

/// Reads and checks a catalogue whose scans are numbered from `first`; returns the entries and the
/// length of the tile file.
pub(super) fn read(path: &Path, first: u32) -> Result<(Vec<TileEntry>, u64)> {
    let bytes = std::fs::read(path)
        .map_err(|e| Error::of_read("the catalogue of the store cannot be read", path, e))?;
    let (mut entries, n) = parse(&bytes).map_err(|e| e.at(path.display()))?;
    for entry in &mut entries {
        let Some(scan) = entry.at.scan.0.checked_add(first) else {
            return Err(broken("the catalogue of the store is inconsistent").at(path.display()));
        };
        entry.at.scan = ScanId(scan);
    }
    Ok((entries, n))
}

fn parse(bytes: &[u8]) -> Result<(Vec<TileEntry>, u64)> {
    let torn = |what: &str| Err(broken(what));
    let Some((header, archive)) = bytes.split_at_checked(HEADER_BYTES as usize) else {
        return torn("the catalogue is shorter than its header");
    };
    if header[..8] != *CATALOGUE_MAGIC {
        return torn("this file is not the catalogue of a store");
    }
    if header[8..16] != (u64::from(VERSION)).to_le_bytes() {
        return torn("the catalogue was written by another version of the store");
    }
    if header[16..24] != (archive.len() as u64).to_le_bytes() {
        return torn("the catalogue is truncated: its length differs from its header");
    }
    if header[24..56] != *blake3::hash(archive).as_bytes() || header[56..] != [0; 8] {
        return torn("the catalogue is damaged: its digest differs from its header");
    }
    let mut aligned = rkyv::util::AlignedVec::<64>::with_capacity(archive.len());
    aligned.extend_from_slice(archive);
    let rows = rkyv::from_bytes::<TileRows, rkyv::rancor::Error>(&aligned)
        .map_err(|e| broken("the catalogue is damaged").because(e))?;
    let mut entries: Vec<TileEntry> = Vec::with_capacity(rows.rows.len());
    for row in &rows.rows {
        let [scan, tile_row, col] = row.at;
        let at = TileAt { scan: ScanId(scan), row: tile_row, col };
        let sorted = entries.last().is_none_or(|e| (e.at, e.first_place) < (at, row.first_place));
        let n_points: u64 = row.n_of.iter().map(|n| u64::from(*n)).sum();
        if !sorted || row.n_points != n_points || !row.offset.is_multiple_of(ALIGN) {
            return torn("the catalogue of the store is inconsistent");
        }
        entries.push(TileEntry {
            at,
            n_points: row.n_points,
            first_place: row.first_place,
            bounds: Aabb { min: row.bounds[0], max: row.bounds[1] },
            range: row.range,
            offset: row.offset,
            n_of: row.n_of,
            checksums: row.checksums,
        });
    }
    // Tiles must not overlap in the file. Gaps are allowed: they belong to tiles that were written
    // twice.
    let mut spans: Vec<(u64, u64)> =
        entries.iter().map(|e| (e.offset, e.n_bytes(N_LEVELS))).collect();
    spans.sort_unstable();
    let mut end = Some(HEADER_BYTES);
    for (offset, n) in spans {
        end = end.filter(|end| offset >= *end).and_then(|_| offset.checked_add(n));
    }
    match end {
        Some(end) if end <= rows.n_tile_bytes => Ok((entries, rows.n_tile_bytes)),
        _ => torn("the catalogue of the store is inconsistent"),
    }
}

/// The error for a store that cannot be used.
pub(super) fn broken(what: impl Into<String>) -> Error {
    Error::bad_input(what).hint("remove the store; the next run makes it again from the scans")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries() -> Vec<TileEntry> {
        let mut offset = HEADER_BYTES;
        (0..5)
            .map(|i| {
                let entry = TileEntry {
                    at: TileAt { scan: ScanId(i / 2), row: 3, col: i },
                    n_points: u64::from(i) * 100,
                    n_of: [i, 9 * i, 20 * i, 70 * i],
                    first_place: 7,
                    bounds: Aabb::of([[1.0, 2.0, f64::from(i)]]),
                    range: 2.5,
                    offset,
                    checksums: [9 + i, 8, 7, i],
                };
                offset += entry.n_bytes(N_LEVELS);
                entry
            })
            .collect()
    }

    fn file() -> Vec<u8> {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("catalogue");
        let entries = entries();
        let end = entries[4].offset + entries[4].n_bytes(N_LEVELS);
        write(&path, &entries, end, 0).expect("writes");
        assert!(read(&path, 0).expect("reads") == (entries, end));
        std::fs::read(path).expect("a file")
    }

    #[test]
    fn every_torn_or_flipped_catalogue_is_refused() {
        let bytes = file();
        for n in 0..bytes.len() {
            assert!(parse(&bytes[..n]).is_err(), "{n} bytes");
        }
        assert!(parse(&[bytes.as_slice(), &[0; 16]].concat()).is_err(), "trailing zeros");
        for i in 0..bytes.len() * 8 {
            let mut flipped = bytes.clone();
            flipped[i / 8] ^= 1 << (i % 8);
            assert!(parse(&flipped).is_err(), "bit {i}");
        }
    }
}
