//! The buffer of one tile while the store is filled: its points in memory, and what was already
//! written to disk.

use super::catalogue::TileEntry;
use super::record::Record;
use super::spill::SpilledSegment;
use contract::TileAt;

/// Most points of one tile; this bounds the memory of a worker. A ground square of a dense cloud,
/// or a pixel raster far coarser than its scan, may have more points; then several tiles share the
/// same [`TileAt`], divided in the order of places.
pub const TILE_POINTS: usize = 1 << 21;

/// Points and disk segments of one tile.
pub(super) struct Buffer {
    pub(super) at: TileAt,
    /// Records in memory.
    pub(super) records: Vec<Record>,
    /// Segments in the spill file.
    pub(super) segments: Vec<SpilledSegment>,
    /// Tiles already written to the tile file.
    pub(super) written: Vec<TileEntry>,
    pub(super) is_written: bool,
    /// Number of all points received so far.
    pub(super) n_points: usize,
    last_place: u64,
    pub(super) ascending: bool,
    /// Number of the last strip that had points for this tile.
    pub(super) touched: u64,
}

impl Buffer {
    pub(super) fn new(at: TileAt) -> Self {
        Self {
            at,
            records: Vec::new(),
            segments: Vec::new(),
            written: Vec::new(),
            n_points: 0,
            last_place: 0,
            ascending: true,
            is_written: false,
            touched: 0,
        }
    }

    pub(super) fn add(&mut self, records: &[Record]) {
        // Places ascend within a run of records, as they do in strips.
        let (Some(first), Some(last)) = (records.first(), records.last()) else { return };
        self.ascending &= self.n_points == 0 || first.place() > self.last_place;
        self.last_place = last.place();
        self.n_points += records.len();
        self.records.extend_from_slice(records);
    }

    /// Reserves room for `n` more points, at first for `usual` points, and returns the bytes that
    /// this takes. The room grows by a quarter, since waiting points are most of the memory of a
    /// run.
    pub(super) fn make_room(&mut self, n: usize, usual: usize) -> usize {
        let (len, before) = (self.records.len(), self.records.capacity());
        if len + n > before {
            let more = if before == 0 { usual } else { len / 4 };
            self.records.reserve_exact(more.max(n));
        }
        (self.records.capacity() - before) * Record::BYTES
    }

    /// Whether part of the tile was written to disk before.
    pub(super) fn comes_back(&self) -> bool {
        self.is_written || !self.segments.is_empty()
    }

    /// Whether all points of the tile are written.
    pub(super) fn is_done(&self) -> bool {
        self.records.is_empty() && self.segments.is_empty()
    }
}
