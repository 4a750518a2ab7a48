//! Points of one tile as they come in; what of them waits in memory and what went to disk, out.

use super::catalogue::TileEntry;
use super::record::Record;
use super::spill::Segment;
use contract::TileAt;

/// Most points of one tile: bounds what a worker holds. A square of ground of a dense cloud, or a
/// lattice far coarser than its scan, may have more; then several tiles stand at the same
/// [`TileAt`], cut in the order of places.
pub const TILE_POINTS: usize = 1 << 21;

/// What is known of a tile.
pub(super) struct Buffer {
    pub(super) at: TileAt,
    /// In memory.
    pub(super) records: Vec<Record>,
    /// In the spill file.
    pub(super) segments: Vec<Segment>,
    /// In the tile file, as the end knows it.
    pub(super) written: Vec<TileEntry>,
    pub(super) is_written: bool,
    /// All that came so far.
    pub(super) n_points: usize,
    last_place: u64,
    pub(super) ascending: bool,
    /// Number of the last strip that had points for it.
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
        // Within a run places ascend, as they do in strips.
        let (Some(first), Some(last)) = (records.first(), records.last()) else { return };
        self.ascending &= self.n_points == 0 || first.place() > self.last_place;
        self.last_place = last.place();
        self.n_points += records.len();
        self.records.extend_from_slice(records);
    }

    /// Makes room for `n` more points, at first for `usual`; bytes that this takes. It grows by a
    /// quarter: what waits is most of the memory of a run.
    pub(super) fn make_room(&mut self, n: usize, usual: usize) -> usize {
        let (len, before) = (self.records.len(), self.records.capacity());
        if len + n > before {
            let more = if before == 0 { usual } else { len / 4 };
            self.records.reserve_exact(more.max(n));
        }
        (self.records.capacity() - before) * Record::BYTES
    }

    /// Whether some of it was brought to disk before.
    pub(super) fn comes_back(&self) -> bool {
        self.is_written || !self.segments.is_empty()
    }

    /// Whether all of it is written.
    pub(super) fn is_done(&self) -> bool {
        self.records.is_empty() && self.segments.is_empty()
    }
}
