//! Finds the packets of one binary section and hands out those with data.

use crate::checked_pages::{CheckedPages, PAYLOAD};
use contract::{Error, Result};
use std::io::{Read, Seek};

/// Length of a section header, bytes.
pub(crate) const SECTION_HEADER: usize = 32;
/// Length of a data packet's header, bytes: kind, flags, length and number of fields.
pub(crate) const PACKET_HEADER: usize = 6;

/// The packets of a section that were not read yet.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PacketRange {
    /// Logical offset of the next packet.
    at: u64,
    /// Logical offset of the end of the section.
    end: u64,
}

impl PacketRange {
    /// Reads the header of the section at this offset in the file.
    pub(crate) fn open<R: Read + Seek>(pages: &mut CheckedPages<R>, offset: u64) -> Result<Self> {
        let start = pages.logical(offset)?;
        let header: [u8; SECTION_HEADER] =
            pages.read(start, SECTION_HEADER)?.try_into().expect("as long as asked");
        let number = |at: usize| u64::from_le_bytes(*header[at..].first_chunk().expect("within"));
        let place = format!("page {}", start / PAYLOAD);
        if header[0] != 1 {
            let what = "an offset leads to a section of another kind";
            return Err(Error::bad_input(format!("{what}, \"{}\"", header[0])).at(place));
        }
        let (end, at) = (start.checked_add(number(8)), pages.logical(number(16))?);
        match end.filter(|end| (start..=*end).contains(&at) && *end <= pages.len()) {
            Some(end) => Ok(Self { at, end }),
            None => {
                let what = "length of a section reaches outside the file";
                Err(Error::bad_input(format!("{what}, \"{}\"", number(8))).at(place))
            }
        }
    }

    /// Number of bytes up to the end of the section.
    pub(crate) fn n_bytes(&self) -> u64 {
        self.end.saturating_sub(self.at)
    }

    /// The next packet with data; `None` at the end of the section.
    pub(crate) fn next<'p, R: Read + Seek>(
        &mut self,
        pages: &'p mut CheckedPages<R>,
    ) -> Result<Option<&'p [u8]>> {
        while self.at < self.end {
            let at = self.at;
            let place = || format!("page {}", at / PAYLOAD);
            let header: [u8; 4] = pages.read(at, 4)?.try_into().expect("as long as asked");
            let len = usize::from(u16::from_le_bytes([header[2], header[3]])) + 1;
            if len % 4 != 0 || self.end - at < len as u64 {
                let what = format!("a packet has an impossible length, \"{len}\"");
                return Err(Error::bad_input(what).at(place()));
            }
            self.at += len as u64;
            match header[0] {
                0 | 2 => {}
                1 => return pages.read(at, len).map(Some).map_err(|e| e.at(place())),
                kind => {
                    let what = format!("a packet is of unknown kind, \"{kind}\"");
                    return Err(Error::bad_input(what).at(place()));
                }
            }
        }
        Ok(None)
    }
}

/// The parts of a data packet, one for each of `n` fields.
pub(crate) fn parts(packet: &[u8], n: usize) -> Result<impl Iterator<Item = &[u8]>> {
    let n_stated = packet.get(4..6).map_or(0, |b| usize::from(u16::from_le_bytes([b[0], b[1]])));
    if n_stated != n {
        let what = format!("a packet does not have the {n} fields of the scan, but \"{n_stated}\"");
        return Err(Error::bad_input(what));
    }
    let short = || Error::bad_input("a packet is shorter than its parts");
    let body = packet.get(PACKET_HEADER..).and_then(|body| body.split_at_checked(2 * n));
    let (lengths, mut rest) = body.ok_or_else(short)?;
    let lengths =
        lengths.as_chunks::<2>().0.iter().map(|len| usize::from(u16::from_le_bytes(*len)));
    if lengths.clone().sum::<usize>() > rest.len() {
        return Err(short());
    }
    Ok(lengths.map(move |len| {
        let (part, after) = rest.split_at(len);
        rest = after;
        part
    }))
}
