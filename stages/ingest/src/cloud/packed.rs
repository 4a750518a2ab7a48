//! Compressed records of a PCD file: all values of the first field, then all of the next.

use super::binary::{BinarySlot, Scalar};
use super::fields::Slots;
use super::header::too_short;
use super::lzf::{AHEAD, LzfIndex, LzfStream};
use contract::{Error, Result};

/// Number of records that are decompressed at once.
const AT_ONCE: usize = 1024;

/// One block of compressed records.
#[derive(Debug)]
pub(super) struct PackedBody {
    /// Compressed bytes in the file.
    bytes: std::ops::Range<usize>,
    n: u64,
    slots: Vec<BinarySlot>,
    index: LzfIndex,
}

impl PackedBody {
    /// Opens the block at `start`, of `n` records of `record` bytes: decompresses it once, without
    /// keeping it.
    pub(super) fn open(
        file: &[u8],
        start: u64,
        n: u64,
        record: usize,
        slots: Vec<BinarySlot>,
    ) -> Result<Self> {
        let at = start as usize;
        let sizes = file.get(at..at + 8).ok_or_else(|| too_short(n))?;
        let size = |i: usize| u32::from_le_bytes([0, 1, 2, 3].map(|b| sizes[i + b]));
        let [packed, whole] = [size(0), size(4)].map(u64::from);
        if n.checked_mul(record as u64) != Some(whole) {
            let what = format!("compressed points have not the length of all points, \"{whole}\"");
            return Err(Error::bad_input(what)
                .at(format!("byte {}", at + 4))
                .hint("the header is wrong or the file damaged; export it again"));
        }
        let bytes = at + 8..at + 8 + packed as usize;
        let block = file.get(bytes.clone()).ok_or_else(|| too_short(n))?;
        let index = LzfIndex::of(block, whole).map_err(|e| e.at(format!("byte {}", at + 8)))?;
        Ok(Self { bytes, n, slots, index })
    }

    /// Byte after the block.
    pub(super) fn end(&self) -> u64 {
        self.bytes.end as u64
    }

    /// The records from the `first` on.
    pub(super) fn streams<'a>(&'a self, file: &'a [u8], first: u64) -> Result<PackedStreams<'a>> {
        let block = &file[self.bytes.clone()];
        let of = |slot: &BinarySlot| {
            let place = slot.offset as u64 * self.n + first * slot.stride as u64;
            Ok((self.index.stream(block, place)?, *slot))
        };
        Ok(PackedStreams { streams: self.slots.iter().map(of).collect::<Result<_>>()? })
    }
}

/// Streams of the values that are kept, at the same record.
pub(super) struct PackedStreams<'a> {
    streams: Vec<(LzfStream<'a>, BinarySlot)>,
}

impl PackedStreams<'_> {
    /// Appends up to `n` records, of which there are as many.
    pub(super) fn more(&mut self, n: usize, out: &mut Vec<Slots>) -> Result<()> {
        let from = out.len();
        let longest = self.streams.iter().map(|(_, slot)| slot.stride).max().unwrap_or(1);
        let n = n.min(AT_ONCE).min(AHEAD / longest).max(1);
        out.resize(from + n, Slots::default());
        for (stream, slot) in &mut self.streams {
            let scalar: Scalar = slot.scalar;
            let values = stream.take(slot.stride * n)?.chunks_exact(slot.stride);
            for (record, value) in out[from..].iter_mut().zip(values) {
                record[slot.slot] = scalar.value(value, false);
            }
        }
        Ok(())
    }
}
