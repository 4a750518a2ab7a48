//! Makes strips of records.

use super::fields::Slots;
use super::file::{CloudFile, CloudPart};
use super::packed::{PackedBody, PackedStreams};
use crate::reader::{RawStrip, Want};
use contract::{Attributes, Result};

impl CloudFile {
    /// The strips of records that follow one another from a place of a scan on.
    pub(super) fn strips(
        &self,
        scan: usize,
        first: u64,
        records: impl Iterator<Item = Result<Slots>>,
        want: Want,
    ) -> Result<Vec<RawStrip>> {
        let part = &self.parts[scan];
        let n = self.strip_points.min(records.size_hint().1.unwrap_or(0));
        let empty = || RawStrip {
            scan,
            first_place: 0,
            place: Vec::with_capacity(n),
            xyz: Vec::with_capacity(n),
            attributes: (want == Want::Everything).then(Attributes::default),
        };
        let (mut out, mut strip) = (Vec::new(), empty());
        let (mut n_no_returns, mut n_cut) = (0, 0);
        for (record, place) in records.zip(first..) {
            let record = record?;
            let Some((world, p)) = self.valid(part, [record[0], record[1], record[2]]) else {
                n_no_returns += u64::from(self.is_no_return(part, &record));
                continue;
            };
            if strip.xyz.is_empty() {
                strip.first_place = place;
            }
            strip.place.push((place - strip.first_place) as u32);
            strip.xyz.push(p.map(|v| v as f32));
            if let Some(attributes) = &mut strip.attributes {
                attributes.world.push(world);
                n_cut += u64::from(part.fields.push(attributes, &record));
            }
            if strip.xyz.len() == self.strip_points {
                out.push(std::mem::replace(&mut strip, empty()));
            }
        }
        if !strip.xyz.is_empty() {
            out.push(strip);
        }
        if want == Want::Everything {
            part.oddities.add_no_returns(n_no_returns);
            part.oddities.add_cut(n_cut);
        }
        Ok(out)
    }

    fn is_no_return(&self, part: &CloudPart, record: &Slots) -> bool {
        let world = self.in_metres([record[0], record[1], record[2]]);
        part.frame.is_no_return(part.frame.scan_from_file(world))
    }
}

/// Iterator over the strips of a file whose records are compressed together.
pub(super) struct PackedStrips<'a> {
    file: &'a CloudFile,
    body: &'a PackedBody,
    want: Want,
    /// Place of the next record.
    place: u64,
    streams: Option<PackedStreams<'a>>,
    /// Strips that were made and not given yet, the next one last.
    ready: Vec<RawStrip>,
    done: bool,
}

impl<'a> PackedStrips<'a> {
    /// Starts at the first record.
    pub(super) fn new(file: &'a CloudFile, body: &'a PackedBody, want: Want) -> Self {
        Self { file, body, want, place: 0, streams: None, ready: Vec::new(), done: false }
    }

    /// The next strip; `None` after the last record.
    fn read(&mut self) -> Result<Option<RawStrip>> {
        let n_records = self.file.parts[0].n_records;
        while self.ready.is_empty() && self.place < n_records {
            let streams = match &mut self.streams {
                Some(streams) => streams,
                none => none.insert(self.body.streams(&self.file.map, 0)?),
            };
            let n = (n_records - self.place).min(self.file.strip_points as u64) as usize;
            let mut records = Vec::with_capacity(n);
            while records.len() < n {
                streams.more(n - records.len(), &mut records)?;
            }
            let first = self.place;
            self.place += n as u64;
            let records = records.into_iter().map(Ok);
            self.ready = self.file.strips(0, first, records, self.want)?;
            self.ready.reverse();
        }
        Ok(self.ready.pop())
    }
}

impl Iterator for PackedStrips<'_> {
    type Item = Result<RawStrip>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.done {
            return None;
        }
        let strip = self.read().transpose();
        self.done = !matches!(strip, Some(Ok(_)));
        strip
    }
}
