//! Writes the E57 file that is given back: sections in their order, points by packets, and the
//! edited description.

use crate::bits::BitBuffer;
use crate::checked_pages::{CheckedPages, MOST, PAGE};
use crate::e57_edits::Edits;
use crate::e57_layout::{E57Layout, E57Section, HEADER, SectionBody};
use crate::e57_marking::{MarkedPiece, ScanPlan, WrittenField};
use crate::e57_packets::{PACKET_HEADER, PacketRange, SECTION_HEADER};
use crate::fate::{GiveBack, GivenBack, RobotNames};
use crate::summed_pages::SummedPages;
use contract::{Error, Kind, Result};
use std::collections::BTreeMap;
use std::io::{Read, Seek, Write};

/// Length of the header of a blob, bytes.
const BLOB_HEADER: usize = 16;
/// Most bytes of a packet: what its 16-bit length can say, less the padding to four bytes.
const PACKET: u64 = 65_532;

/// The file that is written.
pub struct E57Copy<'a, W> {
    layout: &'a E57Layout,
    how: GiveBack,
    robots: &'a [RobotNames],
    pages: SummedPages<W>,
    edits: Edits,
    /// New offset in the file of each section that was copied, by its old one.
    placed: BTreeMap<(u64, SectionBody), u64>,
}

impl<'a, W: Read + Write + Seek> E57Copy<'a, W> {
    /// Starts an empty file.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn begin(
        to: W,
        layout: &'a E57Layout,
        how: GiveBack,
        robots: &'a [RobotNames],
    ) -> Result<Self> {
        let mut pages = SummedPages::new(to);
        pages.write(&[0; HEADER])?;
        let edits = Edits::new(layout, how);
        Ok(Self { layout, how, robots, pages, edits, placed: BTreeMap::new() })
    }

    /// Copies a section that holds no points of a scan.
    ///
    /// # Errors
    /// If the original is damaged, or the copy cannot be written.
    pub fn copy<R: Read + Seek>(
        &mut self,
        from: &mut CheckedPages<R>,
        section: &E57Section,
    ) -> Result<()> {
        // What belonged to a part that goes needs no place.
        if self.edits.removes(&section.offset_at) {
            return Ok(());
        }
        // Pictures may share their bytes.
        let key = (section.offset, section.body);
        let place = match self.placed.get(&key) {
            Some(place) => *place,
            None => {
                let place = SummedPages::<W>::physical(self.pages.position());
                match section.body {
                    SectionBody::Blob { n_bytes } => self.blob(from, section.offset, n_bytes)?,
                    SectionBody::Table { n_records } => {
                        self.table(from, section.offset, n_records)?;
                    }
                    SectionBody::Points(_) => {
                        return Err(Error::new(Kind::Bug, "points are not copied as a table"));
                    }
                }
                self.placed.insert(key, place);
                place
            }
        };
        self.edits.replace(section.offset_at.clone(), place.to_string());
        Ok(())
    }

    fn blob<R: Read + Seek>(
        &mut self,
        from: &mut CheckedPages<R>,
        offset: u64,
        n_bytes: u64,
    ) -> Result<()> {
        let len = BLOB_HEADER as u64 + n_bytes.next_multiple_of(4);
        let mut header = [0; BLOB_HEADER];
        header[8..].copy_from_slice(&len.to_le_bytes());
        self.pages.write(&header)?;
        if n_bytes > 0 {
            let start = from.logical(offset)? + BLOB_HEADER as u64;
            let end = start.checked_add(n_bytes).filter(|end| *end <= from.len());
            let end = end.ok_or_else(|| {
                Error::bad_input(format!("a picture is longer than the file, \"{n_bytes}\""))
            })?;
            for at in (start..end).step_by(MOST) {
                let n = (end - at).min(MOST as u64) as usize;
                self.pages.write(from.read(at, n)?)?;
            }
        }
        self.pages.align()
    }

    fn table<R: Read + Seek>(
        &mut self,
        from: &mut CheckedPages<R>,
        offset: u64,
        n_records: u64,
    ) -> Result<()> {
        let start = SectionStart::begin(&mut self.pages)?;
        if n_records > 0 {
            let mut packets = PacketRange::open(from, offset)?;
            while let Some(packet) = packets.next(from)? {
                self.pages.write(packet)?;
            }
        }
        start.finish(&mut self.pages)
    }

    /// Starts the points of the scan with this index.
    ///
    /// # Errors
    /// If a record has more fields than fit a packet, or the file cannot be written.
    pub fn scan(&mut self, index: usize, plan: &ScanPlan) -> Result<ScanCopy<'_, 'a, W>> {
        let bits: Vec<u32> = plan.fields.iter().map(WrittenField::bits).collect();
        let all: u64 = bits.iter().map(|b| u64::from(*b)).sum();
        let room = PACKET.saturating_sub((PACKET_HEADER + 2 * bits.len()) as u64);
        let per_packet = (room * 8).checked_div(all).map_or(u64::MAX / 8 * 8, |n| n / 8 * 8);
        if per_packet == 0 {
            let what = format!("a record has more fields than fit a packet, \"{}\"", bits.len());
            return Err(Error::new(Kind::Unsupported, what));
        }
        let offset_at = self.layout.sections.iter().find(|s| s.body == SectionBody::Points(index));
        let offset_at = offset_at.map(|section| section.offset_at.clone());
        let offset_at = offset_at.ok_or_else(|| Error::new(Kind::Bug, "a scan has no section"))?;
        let place = SummedPages::<W>::physical(self.pages.position());
        self.edits.replace(offset_at, place.to_string());
        self.edits.fields(&self.layout.scans[index], plan, self.layout, self.robots);
        let start = SectionStart::begin(&mut self.pages)?;
        let waiting = vec![BitBuffer::default(); bits.len()];
        let counts = GivenBack::default();
        let copy = self;
        Ok(ScanCopy { copy, index, start, bits, waiting, per_packet, n_waiting: 0, n: 0, counts })
    }

    /// Writes the description and returns the finished file.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(mut self) -> Result<W> {
        self.edits.whole(self.layout, self.how, self.robots);
        let text = self.edits.apply(&self.layout.text);
        let place = SummedPages::<W>::physical(self.pages.position());
        self.pages.write(text.as_bytes())?;
        let numbers = [self.pages.n_bytes(), place, text.len() as u64, PAGE].map(u64::to_le_bytes);
        let header = [&self.layout.signature[..], numbers.as_flattened()].concat();
        self.pages.patch(0, &header);
        self.pages.finish()
    }
}

/// A section of packets that was begun.
#[derive(Debug, Clone, Copy)]
struct SectionStart {
    at: u64,
}

impl SectionStart {
    fn begin<W: Read + Write + Seek>(pages: &mut SummedPages<W>) -> Result<Self> {
        let at = pages.position();
        pages.write(&[0; SECTION_HEADER])?;
        Ok(Self { at })
    }

    /// Writes an index with the first packet, and the header.
    fn finish<W: Read + Write + Seek>(self, pages: &mut SummedPages<W>) -> Result<()> {
        const INDEX: usize = 32;
        let data = SummedPages::<W>::physical(self.at + SECTION_HEADER as u64);
        let index = SummedPages::<W>::physical(pages.position());
        // Kind 0, its length less one, one entry, level 0; record 0 is in the first packet.
        let mut packet = [0; INDEX];
        packet[2] = INDEX as u8 - 1;
        packet[4] = 1;
        packet[24..].copy_from_slice(&data.to_le_bytes());
        pages.write(&packet)?;
        let len = pages.position() - self.at;
        let numbers = [1, len, data, index].map(u64::to_le_bytes);
        pages.patch(self.at, numbers.as_flattened());
        Ok(())
    }
}

/// The points of one scan that are written.
pub struct ScanCopy<'c, 'a, W> {
    copy: &'c mut E57Copy<'a, W>,
    index: usize,
    start: SectionStart,
    /// Number of bits of each field, and its bits that wait for a packet.
    bits: Vec<u32>,
    waiting: Vec<BitBuffer>,
    /// Number of records of a packet: a multiple of eight, so that packets hold whole bytes.
    per_packet: u64,
    n_waiting: u64,
    /// Number of records that were written.
    n: u64,
    counts: GivenBack,
}

impl<W: Read + Write + Seek> ScanCopy<'_, '_, W> {
    /// Appends records.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn add(&mut self, piece: &MarkedPiece) -> Result<()> {
        for (waiting, bits) in self.waiting.iter_mut().zip(&piece.fields) {
            waiting.append(bits.bytes(), 0, bits.n_bits());
        }
        self.n_waiting += piece.n;
        self.counts.n_valid += piece.counts.n_valid;
        self.counts.n_out += piece.counts.n_out;
        let mut done = 0;
        while self.n_waiting - done >= self.per_packet {
            self.packet(done, self.per_packet)?;
            done += self.per_packet;
        }
        self.n_waiting -= done;
        for (waiting, bits) in self.waiting.iter_mut().zip(&self.bits) {
            waiting.take_front((done * u64::from(*bits) / 8) as usize);
        }
        Ok(())
    }

    /// Writes a packet of `n` of the waiting records, from record `first` on.
    fn packet(&mut self, first: u64, n: u64) -> Result<()> {
        let range = |bits: &u32| {
            let bits = u64::from(*bits);
            (first * bits / 8) as usize..((first + n) * bits).div_ceil(8) as usize
        };
        let lengths: Vec<usize> = self.bits.iter().map(|bits| range(bits).len()).collect();
        let used = PACKET_HEADER + 2 * lengths.len() + lengths.iter().sum::<usize>();
        let len = used.next_multiple_of(4) - 1;
        let mut head = vec![1, 0, len as u8, (len >> 8) as u8];
        head.extend((lengths.len() as u16).to_le_bytes());
        head.extend(lengths.iter().flat_map(|len| (*len as u16).to_le_bytes()));
        let pages = &mut self.copy.pages;
        pages.write(&head)?;
        for (waiting, bits) in self.waiting.iter().zip(&self.bits) {
            pages.write(&waiting.bytes()[range(bits)])?;
        }
        pages.align()?;
        self.n += n;
        Ok(())
    }

    /// Writes the last packet, and returns how many points were taken out.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(mut self) -> Result<GivenBack> {
        // Readers expect one packet at least.
        if self.n_waiting > 0 || self.n == 0 {
            self.packet(0, self.n_waiting)?;
        }
        self.start.finish(&mut self.copy.pages)?;
        let scan = &self.copy.layout.scans[self.index];
        self.copy.edits.replace(scan.count_at.clone(), self.n.to_string());
        Ok(self.counts)
    }
}
