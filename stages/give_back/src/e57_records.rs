//! Reads the records of one scan in pieces, each field as the bits that the file has.

use crate::bits::unpack;
use crate::checked_pages::CheckedPages;
use crate::e57_packets::{PacketRange, parts};
use crate::e57_scan::ScanNode;
use contract::{Error, Kind, Result, Weigh};
use std::io::{Read, Seek};

/// Most records of a piece. It is a multiple of eight, so that each field of a piece begins on a
/// whole byte.
const PIECE: u64 = 32_768;
/// Most bytes of a piece: records of very many fields come in smaller pieces.
const PIECE_BYTES: u64 = 8 << 20;
/// Largest number of bytes that one field may be ahead of another beyond a piece.
const MAX_AHEAD: usize = 16 << 20;
/// Largest number of records that take no bits at all: a scan whose fields are all constant has a
/// handful of points.
const MAX_CONSTANT: u64 = 65_536;

/// Consecutive records of a scan.
#[derive(Debug)]
pub struct RecordPiece {
    /// Number of records.
    pub(crate) n: usize,
    /// Place of its first valid record among all valid ones, and number of valid records.
    pub(crate) first_place: u64,
    pub(crate) n_valid: usize,
    /// For each record the value by which it counts as valid; empty where all are valid.
    pub(crate) states: Vec<i64>,
    /// The bits of each field.
    pub(crate) fields: Vec<Vec<u8>>,
}

impl Weigh for RecordPiece {
    fn weight_bytes(&self) -> usize {
        self.fields.iter().map(Vec::len).sum::<usize>() + 8 * self.states.len()
    }

    fn n_points(&self) -> u64 {
        self.n as u64
    }
}

/// Iterator over the pieces of one scan.
pub struct E57Records<'a, R> {
    pages: &'a mut CheckedPages<R>,
    scan: &'a ScanNode,
    packets: Option<PacketRange>,
    /// Bytes of each field that were not handed out yet.
    pending: Vec<Vec<u8>>,
    n_left: u64,
    /// Number of records of a piece.
    piece: u64,
    place: u64,
    has_failed: bool,
}

impl<'a, R: Read + Seek> E57Records<'a, R> {
    /// Starts at the first record.
    ///
    /// # Errors
    /// If the section cannot hold the announced records.
    pub fn open(pages: &'a mut CheckedPages<R>, scan: &'a ScanNode) -> Result<Self> {
        let n_left = scan.n_records;
        let bits = scan.record_bits();
        let packets = match n_left {
            0 => None,
            _ => Some(PacketRange::open(pages, scan.offset)?),
        };
        let n_bytes = packets.map_or(0, |packets| packets.n_bytes());
        let is_too_many = u128::from(bits) * u128::from(n_left) > u128::from(n_bytes) * 8;
        if is_too_many || (bits == 0 && n_left > MAX_CONSTANT) {
            let what = "the section of the points cannot hold their announced number";
            return Err(Error::bad_input(format!("{what}, \"{n_left}\"")));
        }
        let piece = (PIECE_BYTES * 8 / bits.max(1)).clamp(8, PIECE) / 8 * 8;
        let pending = vec![Vec::new(); scan.fields.len()];
        Ok(Self { pages, scan, packets, pending, n_left, piece, place: 0, has_failed: false })
    }

    fn read(&mut self) -> Result<Option<RecordPiece>> {
        if self.n_left == 0 {
            return Ok(None);
        }
        let n = self.n_left.min(self.piece);
        while !self.is_ready(n) {
            self.feed()?;
        }
        self.n_left -= n;
        let mut fields = Vec::with_capacity(self.pending.len());
        for (pending, field) in self.pending.iter_mut().zip(&self.scan.fields) {
            let len = (n * u64::from(field.bits)).div_ceil(8) as usize;
            let rest = pending.split_off(len.min(pending.len()));
            fields.push(std::mem::replace(pending, rest));
        }
        let mut states = Vec::new();
        if let Some(at) = self.scan.valid_by {
            let field = &self.scan.fields[at];
            let min = field.limits.map_or(0, |limits| limits[0]);
            states.resize(n as usize, 0);
            unpack(&fields[at], field.bits, n as usize, |i, value| {
                states[i] = min.wrapping_add(value.cast_signed());
            });
        }
        let n_valid = match self.scan.valid_by {
            Some(_) => states.iter().filter(|state| **state == 0).count(),
            None => n as usize,
        };
        let first_place = self.place;
        self.place += n_valid as u64;
        Ok(Some(RecordPiece { n: n as usize, first_place, n_valid, states, fields }))
    }

    /// Whether each field has `n` records more.
    fn is_ready(&self, n: u64) -> bool {
        let fields = self.pending.iter().zip(&self.scan.fields);
        fields.into_iter().all(|(p, f)| p.len() as u64 * 8 >= n * u64::from(f.bits))
    }

    /// Adds the next packet.
    fn feed(&mut self) -> Result<()> {
        let packet = match &mut self.packets {
            Some(packets) => packets.next(self.pages)?,
            None => None,
        };
        let Some(packet) = packet else {
            let read = self.scan.n_records - self.n_left;
            let what = format!("scan ends soon after {read} of its announced points");
            return Err(Error::bad_input(format!("{what}, \"{}\"", self.scan.n_records)));
        };
        for (pending, part) in self.pending.iter_mut().zip(parts(packet, self.scan.fields.len())?) {
            pending.extend_from_slice(part);
        }
        if self.pending.iter().any(|p| p.len() > MAX_AHEAD + PIECE_BYTES as usize) {
            let what = "one field is farther ahead of the others than is supported, bytes";
            return Err(Error::new(Kind::Unsupported, format!("{what} \"{MAX_AHEAD}\"")));
        }
        Ok(())
    }
}

impl<R: Read + Seek> Iterator for E57Records<'_, R> {
    type Item = Result<RecordPiece>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.has_failed {
            return None;
        }
        let piece = self.read();
        self.has_failed = piece.is_err();
        piece.transpose()
    }
}
