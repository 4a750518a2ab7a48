//! Reads columns of numbers from one scan's section, with all fields kept at the same record.
//! Counts in the file are not trusted: the packets must hold as many records as the scan announces.

use super::pages::Pages;
use super::stream::FieldStream;
use contract::{Error, Kind, Result};
use e57::Record;

/// Length of a section header, bytes.
const SECTION_HEADER: u64 = 32;
/// Length of a data packet's header, bytes: kind, flags, length and number of fields.
const PACKET_HEADER: usize = 6;
/// Largest number of bytes that one field may be ahead of another. Writers fill packets of 64 KiB
/// with all fields at the same record.
const MAX_AHEAD: usize = 16 << 20;
/// Largest number of records that take no bits at all: a scan whose fields are all constant has a
/// handful of points.
const MAX_CONSTANT: u64 = 65_536;

/// The packets of one scan and the data that is not decoded yet.
pub(super) struct Packets {
    pages: Pages,
    /// Logical offset (without checksums) of the next packet.
    at: u64,
    /// Logical offset of the end of the section.
    end: u64,
    /// One stream for each field, in the order of the prototype.
    streams: Vec<FieldStream>,
    /// Number of records that were not returned yet.
    n_left: u64,
    /// Number of records that the scan announces.
    n_records: u64,
}

impl Packets {
    /// Opens the section at `file_offset` (on disk). `wanted[i]` tells whether field `i` will be
    /// decoded.
    pub(super) fn open(
        mut pages: Pages,
        file_offset: u64,
        n_records: u64,
        prototype: &[Record],
        wanted: &[bool],
    ) -> Result<Self> {
        let streams = prototype
            .iter()
            .zip(wanted)
            .map(|(record, wanted)| {
                FieldStream::new(&record.data_type, *wanted)
                    .map_err(|e| e.at(format!("field {:?}", record.name)))
            })
            .collect::<Result<Vec<_>>>()?;
        if n_records == 0 {
            // Without records there is nothing to read, and writers leave any offset here.
            let packets = Self { pages, at: 0, end: 0, streams, n_left: 0, n_records };
            return packets.check_empty(file_offset);
        }
        let start = pages.logical(file_offset)?;
        let header: [u8; SECTION_HEADER as usize] =
            pages.read(start, SECTION_HEADER as usize)?.try_into().expect("as long as asked");
        let number = |from: usize| {
            u64::from_le_bytes(*header[from..].first_chunk().expect("within the header"))
        };
        if header[0] != 1 {
            return Err(Error::bad_input(format!(
                "the offset of the points leads to a section of another kind, \"{}\"",
                header[0]
            ))
            .at(format!("page {}", Pages::page(start))));
        }
        let end = start.checked_add(number(8)).filter(|end| *end <= pages.len());
        let at = pages.logical(number(16))?;
        let Some(end) = end.filter(|end| at >= start + SECTION_HEADER && at <= *end) else {
            return Err(Error::bad_input(format!(
                "length of the points' section reaches outside the file, \"{}\"",
                number(8)
            ))
            .at(format!("page {}", Pages::page(start))));
        };
        let packets = Self { pages, at, end, streams, n_left: n_records, n_records };
        packets.check_count()?;
        Ok(packets)
    }

    /// Refuses a scan that announces no points but has some; a section that is no section of points
    /// is accepted.
    fn check_empty(mut self, file_offset: u64) -> Result<Self> {
        if self.has_bytes(file_offset).unwrap_or(false) {
            return Err(Error::bad_input("no points are announced, but there are some")
                .at(format!("byte {file_offset}"))
                .hint("its header is wrong: export the file again"));
        }
        Ok(self)
    }

    /// Whether the first packet of a section holds data of any field.
    fn has_bytes(&mut self, file_offset: u64) -> Option<bool> {
        let start = self.pages.logical(file_offset).ok()?;
        let header = self.pages.read(start, SECTION_HEADER as usize).ok()?;
        let first = u64::from_le_bytes(*header.get(16..)?.first_chunk()?);
        if header[0] != 1 {
            return None;
        }
        let packet = self.pages.logical(first).ok()?;
        let head = self.pages.read(packet, PACKET_HEADER).ok().filter(|head| head[0] == 1)?;
        let n_fields = usize::from(u16::from_le_bytes([head[4], head[5]]));
        let lengths = self.pages.read(packet + PACKET_HEADER as u64, 2 * n_fields).ok()?;
        Some(n_fields == self.streams.len() && lengths.iter().any(|b| *b > 0))
    }

    /// Refuses a count of records that the section cannot hold, before it is used as a size.
    fn check_count(&self) -> Result<()> {
        let bits: u128 = self.streams.iter().map(|s| u128::from(s.bits())).sum();
        let held = u128::from(self.end - self.at) * 8;
        if bits * u128::from(self.n_records) > held || (bits == 0 && self.n_records > MAX_CONSTANT)
        {
            return Err(Error::bad_input(format!(
                "the points' section of {} bytes cannot hold the announced number of points, \"{}\"",
                self.end - self.at,
                self.n_records
            ))
            .hint("the file is truncated or its header is wrong: export it again"));
        }
        Ok(())
    }

    /// Number of records that can be decoded now, 1 to `most`; 0 at the end, after checking that
    /// all announced records were read.
    pub(super) fn ready(&mut self, most: usize) -> Result<usize> {
        if self.n_left == 0 {
            return self.check_end().map(|()| 0);
        }
        loop {
            let held =
                self.streams.iter().filter_map(FieldStream::available).min().unwrap_or(u64::MAX);
            if held > 0 {
                return Ok(held.min(self.n_left).min(most as u64) as usize);
            }
            if !self.feed()? {
                return Err(Error::bad_input(format!(
                    "scan ends after {} of its announced points, \"{}\"",
                    self.n_records - self.n_left,
                    self.n_records
                ))
                .hint("the file is truncated or its header is wrong: export it again"));
            }
        }
    }

    /// The values of field `field` of the next `n` records, with `n` from [`Self::ready`].
    pub(super) fn numbers(&mut self, field: usize, n: usize, out: &mut Vec<f64>) {
        self.streams[field].numbers(n, out);
    }

    /// The values of a field as integers, see [`Self::numbers`].
    pub(super) fn integers(&mut self, field: usize, n: usize, out: &mut Vec<i64>) {
        self.streams[field].integers(n, out);
    }

    /// Moves on by `n` records; fields for which `read` is false were not decoded and are skipped.
    pub(super) fn advance(&mut self, n: usize, read: &[bool]) {
        for (stream, read) in self.streams.iter_mut().zip(read) {
            if !read {
                stream.skip(n);
            }
        }
        self.n_left -= n as u64;
    }

    /// Appends the next data packet to the streams; returns false at the end of the section.
    fn feed(&mut self) -> Result<bool> {
        while self.at < self.end {
            let at = self.at;
            let place = || format!("page {}", Pages::page(at));
            let header: [u8; 4] = self.pages.read(at, 4)?.try_into().expect("as long as asked");
            let len = usize::from(u16::from_le_bytes([header[2], header[3]])) + 1;
            if len % 4 != 0 || self.end - at < len as u64 {
                return Err(Error::bad_input(format!(
                    "a packet has an impossible length, \"{len}\""
                ))
                .at(place()));
            }
            self.at += len as u64;
            match header[0] {
                0 | 2 => {}
                1 => {
                    let packet = self.pages.read(at, len)?;
                    split(packet, &mut self.streams).map_err(|e| e.at(place()))?;
                    return self.check_ahead().map(|()| true);
                }
                kind => {
                    return Err(Error::bad_input(format!(
                        "a packet is of unknown kind, \"{kind}\""
                    ))
                    .at(place()));
                }
            }
        }
        Ok(false)
    }

    /// Refuses fields that are too far ahead of others, so that memory does not grow with the file.
    fn check_ahead(&self) -> Result<()> {
        if self.streams.iter().any(|s| s.weight_bytes() > MAX_AHEAD) {
            return Err(Error::new(
                Kind::Unsupported,
                format!(
                    "one field is farther ahead of the others than is supported, bytes \"{MAX_AHEAD}\""
                ),
            )
            .at(format!("page {}", Pages::page(self.at)))
            .hint("export the file again"));
        }
        Ok(())
    }

    /// Refuses records beyond the announced ones.
    fn check_end(&mut self) -> Result<()> {
        let spent = loop {
            if !self.streams.iter().all(FieldStream::is_spent) {
                break false;
            }
            if !self.feed()? {
                break true;
            }
        };
        if spent {
            return Ok(());
        }
        Err(Error::bad_input(format!(
            "scan holds more points than it announces, \"{}\"",
            self.n_records
        ))
        .at(format!("page {}", Pages::page(self.at.saturating_sub(1))))
        .hint("the header is wrong: export the file again"))
    }
}

/// Distributes the parts of a data packet to the streams.
fn split(packet: &[u8], streams: &mut [FieldStream]) -> Result<()> {
    let n_streams = packet.get(4..6).map_or(0, |b| usize::from(u16::from_le_bytes([b[0], b[1]])));
    if n_streams != streams.len() {
        return Err(Error::bad_input(format!(
            "a packet does not have the {} fields of the scan, but \"{n_streams}\"",
            streams.len()
        )));
    }
    let short = || Error::bad_input("a packet is shorter than its parts");
    let (lengths, mut rest) =
        packet.get(6..).and_then(|p| p.split_at_checked(2 * n_streams)).ok_or_else(short)?;
    for (stream, len) in streams.iter_mut().zip(lengths.as_chunks::<2>().0) {
        let (part, after) =
            rest.split_at_checked(usize::from(u16::from_le_bytes(*len))).ok_or_else(short)?;
        stream.append(part);
        rest = after;
    }
    Ok(())
}
