//! Collects the points of each tile from memory, from the spill file and from tiles that were
//! written early, and returns them in parts of at most [`TILE_POINTS`] points, in the order of
//! tiles.

use super::buffer::{Buffer, TILE_POINTS};
use super::encode::decode;
use super::file::Early;
use super::record::{N_LEVELS, Record, TilePart};
use super::spill::{Spill, SpilledSegment};
use contract::{Result, TileAt};

/// Largest difference between places of one tile: places are stored as 32-bit differences from the
/// first.
pub(super) const LONGEST_SPAN: u64 = u32::MAX as u64;

/// Difference between the largest and the smallest place of the records.
pub(super) fn span(records: &[Record]) -> u64 {
    let places = || records.iter().map(Record::place);
    places().max().zip(places().min()).map_or(0, |(max, min)| max - min)
}

/// Iterator over the tiles, each in parts of at most [`TILE_POINTS`] points.
pub(super) struct Parts {
    buffers: std::vec::IntoIter<Buffer>,
    spill: Option<Spill>,
    /// File of tiles that were written before all of their points had come.
    early: Option<Early>,
    current: Option<Current>,
}

/// The tile that is being read back.
struct Current {
    at: TileAt,
    /// Segments still to be read.
    segments: std::vec::IntoIter<SpilledSegment>,
    /// Records that were in memory; they follow all segments.
    last: Vec<Record>,
    /// Records that were read but not returned yet.
    ahead: Vec<Record>,
}

impl Parts {
    pub(super) fn new(buffers: Vec<Buffer>, spill: Option<Spill>, early: Option<Early>) -> Self {
        Self { buffers: buffers.into_iter(), spill, early, current: None }
    }

    fn part(&mut self) -> Result<Option<TilePart>> {
        loop {
            let current = match &mut self.current {
                Some(current) => current,
                None => {
                    let Some(buffer) = self.buffers.next() else {
                        return Ok(None);
                    };
                    let begun = self.begin(buffer)?;
                    self.current.insert(begun)
                }
            };
            let at = current.at;
            let records = current.records(&mut self.spill)?;
            if records.is_empty() {
                self.current = None;
                continue;
            }
            return Ok(Some(TilePart { at, records }));
        }
    }

    fn begin(&mut self, buffer: Buffer) -> Result<Current> {
        let Buffer { at, records, segments, written, mut ascending, n_points, .. } = buffer;
        let mut ahead = Vec::new();
        for entry in &written {
            let file = self.early.as_mut().expect("a tile was written to a file");
            let tile = decode(entry, N_LEVELS, &file.read(entry)?);
            ahead.extend((0..tile.len()).map(|i| {
                let place = tile.first_place + u64::from(tile.place[i]);
                Record::new(tile.xyz[i], place, tile.pixel[i])
            }));
            // A written tile is sorted by pixel, not by place.
            ascending = false;
        }
        let spill = &mut self.spill;
        let mut current = Current { at, segments: segments.into_iter(), last: records, ahead };
        if !ascending && n_points > TILE_POINTS {
            // Too many points that are out of order, which is rare: the parts are divided by the
            // order of places.
            current.fill(usize::MAX, spill)?;
            current.ahead.sort_unstable_by_key(Record::place);
        }
        Ok(current)
    }
}

impl Current {
    /// Reads until `n` records are in `ahead`, or no more are left.
    fn fill(&mut self, n: usize, spill: &mut Option<Spill>) -> Result<()> {
        while self.ahead.len() < n {
            if let Some(segment) = self.segments.next() {
                let spill = spill.as_mut().expect("a segment has a spill file");
                spill.read(&segment, &mut self.ahead)?;
            } else if self.last.is_empty() {
                break;
            } else if self.ahead.is_empty() {
                self.ahead = std::mem::take(&mut self.last);
            } else {
                self.ahead.append(&mut self.last);
                self.last = Vec::new();
            }
        }
        Ok(())
    }

    /// The records of the next part, whose places span less than 2³².
    fn records(&mut self, spill: &mut Option<Spill>) -> Result<Vec<Record>> {
        self.fill(TILE_POINTS, spill)?;
        let mut n = self.ahead.len().min(TILE_POINTS);
        if span(&self.ahead[..n]) > LONGEST_SPAN {
            self.ahead.sort_unstable_by_key(Record::place);
            let end = self.ahead[0].place() + LONGEST_SPAN;
            n = self.ahead[..n].partition_point(|r| r.place() <= end);
        }
        if n == self.ahead.len() {
            return Ok(std::mem::take(&mut self.ahead));
        }
        let rest = self.ahead.split_off(n);
        Ok(std::mem::replace(&mut self.ahead, rest))
    }
}

impl Iterator for Parts {
    type Item = Result<TilePart>;

    fn next(&mut self) -> Option<Self::Item> {
        self.part().transpose()
    }
}
