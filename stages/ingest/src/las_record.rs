//! Decodes LAS point records to strips: the table of the eleven point formats, and the one loop
//! through which all LAS and LAZ points pass.

use crate::frame::NO_RETURN;
use crate::las_header::LasHeader;
use crate::las_layout::{LAYOUTS, RecordLayout, u16_at};
use crate::oddities::Oddities;
use crate::reader::{RawStrip, Want};
use crate::scan_of_point::ScanOfPoint;
use contract::Attributes;
use geometry::Pose;

/// Number of records that are decoded together: few enough for the first-level cache, many enough
/// for vector loops.
const BLOCK: usize = 64;
/// Offset of the intensity, the same in all formats.
const INTENSITY: usize = 12;

#[inline]
fn i32_at(record: &[u8], at: usize) -> f64 {
    f64::from(i32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]]))
}

#[inline]
fn f64_at(record: &[u8], at: usize) -> f64 {
    let mut bytes = [0; 8];
    bytes.copy_from_slice(&record[at..at + 8]);
    f64::from_le_bytes(bytes)
}

/// The integer coordinates (counts) of a record.
#[inline]
fn counts(record: &[u8]) -> [f64; 3] {
    [i32_at(record, 0), i32_at(record, 4), i32_at(record, 8)]
}

/// The strip with the place of its first point as first place; `None` where it has no point.
fn trimmed(mut strip: RawStrip) -> Option<RawStrip> {
    let shift = *strip.place.first()?;
    if shift > 0 {
        strip.first_place += u64::from(shift);
        strip.place.iter_mut().for_each(|p| *p -= shift);
    }
    Some(strip)
}

/// Coordinates of a record in the scan frame, metres.
#[inline]
fn in_scan(record: &[u8], frame: &CountFrame) -> [f64; 3] {
    let (c, m, t) = (counts(record), &frame.m, &frame.t);
    // `add_block` must sum in the same order, so that both give the same result to the bit.
    [0, 1, 2].map(|i| c[0] * m[i][0] + c[1] * m[i][1] + c[2] * m[i][2] + t[i])
}

/// Conversion from counts to the scan frame: `m · counts + t`, metres.
#[derive(Debug, Clone)]
struct CountFrame {
    m: [[f64; 3]; 3],
    t: [f64; 3],
    /// Distance from the scanner within which points are beams without return, metres; 0 where no
    /// scanner is known.
    no_return: f64,
}

impl CountFrame {
    /// Whether a place in the scan frame is at the scanner itself.
    #[inline]
    fn is_no_return(&self, p: [f64; 3]) -> bool {
        p.iter().all(|v| v.abs() < self.no_return)
    }
}

/// Converts records to strips.
#[derive(Debug)]
pub(crate) struct Decoder {
    layout: RecordLayout,
    record_len: usize,
    scale: [f64; 3],
    offset: [f64; 3],
    frames: Vec<CountFrame>,
    /// Which points belong to which scan.
    scan_of: ScanOfPoint,
    max_range: f64,
    /// Counts of odd points, one entry a scan.
    oddities: Vec<Oddities>,
}

impl Decoder {
    /// Whether the records have colour.
    pub(crate) fn has_color(&self) -> bool {
        self.layout.color.is_some()
    }

    /// A decoder for scans with these poses; each says whether its origin is the scanner.
    pub(crate) fn new(
        header: &LasHeader,
        poses: &[(Pose, bool)],
        scan_of: ScanOfPoint,
        max_range: f64,
    ) -> Self {
        let frames: Vec<CountFrame> = poses
            .iter()
            .map(|(world_from_scan, is_scanner)| {
                let turn = world_from_scan.rotation.inverse().to_rotation_matrix();
                let from =
                    nalgebra::Vector3::from(header.offset) - world_from_scan.translation.vector;
                let t = turn * from;
                let m = [0, 1, 2].map(|i| [0, 1, 2].map(|j| turn[(i, j)] * header.scale[j]));
                // Coordinates are whole steps of the scale, so a point within one step of the
                // scanner is at the scanner.
                let step = header.scale.iter().fold(0.0_f64, |most, s| most.max(s.abs()));
                let no_return = if *is_scanner { NO_RETURN.max(step) } else { 0.0 };
                CountFrame { m, t: [t.x, t.y, t.z], no_return }
            })
            .collect();
        Self {
            layout: LAYOUTS[usize::from(header.format)],
            record_len: header.record_len,
            scale: header.scale,
            offset: header.offset,
            oddities: frames.iter().map(|_| Oddities::default()).collect(),
            frames,
            scan_of,
            max_range,
        }
    }

    /// World coordinates of a record, metres.
    #[inline]
    pub(crate) fn world(&self, record: &[u8]) -> [f64; 3] {
        let c = counts(record);
        [0, 1, 2].map(|a| c[a] * self.scale[a] + self.offset[a])
    }

    /// Layout of the records.
    pub(crate) fn layout(&self) -> RecordLayout {
        self.layout
    }

    /// Strips of consecutive records, one for each scan that has points among them, sorted by first
    /// place. `first` is the place of the first record.
    pub(crate) fn decode(&self, records: &[u8], first: u64, want: Want) -> Vec<RawStrip> {
        let n = records.len() / self.record_len;
        if matches!(self.scan_of, ScanOfPoint::One) {
            let mut strip = self.empty(0, first, n, want);
            self.add(&mut strip, records, first);
            return trimmed(strip).into_iter().collect();
        }
        let by_raster: Vec<u16> = match &self.scan_of {
            ScanOfPoint::ByRaster(rasters) => {
                records.chunks_exact(self.record_len).map(|record| rasters.of(record)).collect()
            }
            _ => Vec::new(),
        };
        let mut strips: Vec<Option<RawStrip>> = vec![None; self.frames.len()];
        // Points of one scan usually follow one another.
        let mut from = 0;
        while from < n {
            let (own, to) =
                match by_raster[from.min(by_raster.len())..].chunk_by(|a, b| a == b).next() {
                    Some(same) => (usize::from(same[0]), from + same.len()),
                    None => self.stretch(records, first, from, n),
                };
            let strip = strips[own].get_or_insert_with(|| {
                self.empty(own, first + from as u64, if from == 0 { n } else { 0 }, want)
            });
            let bytes = &records[from * self.record_len..to * self.record_len];
            self.add(strip, bytes, first + from as u64);
            from = to;
        }
        let mut strips: Vec<_> = strips.into_iter().flatten().filter_map(trimmed).collect();
        strips.sort_by_key(|s| s.first_place);
        strips
    }

    /// The scan of a record, and the number of the first record behind it of another scan.
    fn stretch(&self, records: &[u8], first: u64, from: usize, n: usize) -> (usize, usize) {
        match &self.scan_of {
            ScanOfPoint::One | ScanOfPoint::ByRaster(_) => (0, n),
            ScanOfPoint::BySource(scans) => {
                let scan = |i: usize| {
                    scans[usize::from(self.layout.source_id(&records[i * self.record_len..]))]
                };
                let own = scan(from);
                let to = (from + 1..n).find(|&i| scan(i) != own).unwrap_or(n);
                (usize::from(own), to)
            }
            ScanOfPoint::ByPlace(places) => {
                let (scan, last) = places.of(first + from as u64);
                let left = last.saturating_sub(first).saturating_add(1).min(n as u64);
                (usize::from(scan), left as usize)
            }
        }
    }

    /// Adds records of one scan to its strip; `first` is the place of the first record.
    fn add(&self, strip: &mut RawStrip, records: &[u8], first: u64) {
        let frame = &self.frames[strip.scan];
        // A strip spans one block of records, so that the difference is far below 2³².
        let mut place = (first - strip.first_place) as u32;
        for block in records.chunks(BLOCK * self.record_len) {
            let n = block.len() / self.record_len;
            if n == BLOCK && self.add_block(strip, block, frame, place) {
                place += n as u32;
                continue;
            }
            for record in block.chunks_exact(self.record_len) {
                if strip.attributes.is_some() && self.is_no_return(record, frame) {
                    self.oddities[strip.scan].add_no_returns(1);
                }
                if let Some(xyz) = self.local(record, frame) {
                    strip.place.push(place);
                    strip.xyz.push(xyz);
                    if let Some(attributes) = &mut strip.attributes {
                        self.add_attributes(record, attributes);
                    }
                }
                place += 1;
            }
        }
    }

    /// Like adding records one by one, but for a whole block, in loops without branches. Returns
    /// false and adds nothing if a record of the block is withheld or implausible.
    fn add_block(
        &self,
        strip: &mut RawStrip,
        block: &[u8],
        frame: &CountFrame,
        place: u32,
    ) -> bool {
        let mut counts = [[0.0_f64; 3]; BLOCK];
        let mut withheld = false;
        for (record, count) in block.chunks_exact(self.record_len).zip(&mut counts) {
            *count = self::counts(record);
            withheld |= self.layout.withheld(record);
        }
        let (m, t) = (&frame.m, &frame.t);
        let mut xyz = [[0.0_f32; 3]; BLOCK];
        let (mut near, mut at_scanner) = (true, false);
        for (c, p) in counts.iter().zip(&mut xyz) {
            for i in 0..3 {
                // `in_scan` must sum in the same order, so that both give the same result to the
                // bit.
                let v = c[0] * m[i][0] + c[1] * m[i][1] + c[2] * m[i][2] + t[i];
                near &= v.abs() <= self.max_range;
                p[i] = v as f32;
            }
            let reach = p.iter().fold(0.0_f32, |most, v| most.max(v.abs()));
            at_scanner |= f64::from(reach) < frame.no_return;
        }
        if withheld || !near || at_scanner {
            return false;
        }
        strip.xyz.extend_from_slice(&xyz);
        strip.place.extend(place..place + BLOCK as u32);
        if let Some(to) = &mut strip.attributes {
            let (s, o) = (&self.scale, &self.offset);
            to.world.extend(
                counts.iter().map(|c| [c[0] * s[0] + o[0], c[1] * s[1] + o[1], c[2] * s[2] + o[2]]),
            );
            let records = || block.chunks_exact(self.record_len);
            to.intensity.extend(records().map(|r| u16_at(r, INTENSITY)));
            to.classification.extend(records().map(|r| self.layout.classification(r)));
            to.source_id.extend(records().map(|r| self.layout.source_id(r)));
            if let Some(at) = self.layout.color {
                let color = |r: &[u8]| [u16_at(r, at), u16_at(r, at + 2), u16_at(r, at + 4)];
                to.color.extend(records().map(color));
            }
            if let Some(at) = self.layout.gps_time {
                to.gps_time.extend(records().map(|r| f64_at(r, at)));
            }
        }
        true
    }

    /// An empty strip with capacity for `n` points.
    fn empty(&self, scan: usize, first_place: u64, n: usize, want: Want) -> RawStrip {
        let attributes = (want == Want::Everything).then(|| Attributes {
            world: Vec::with_capacity(n),
            intensity: Vec::with_capacity(n),
            color: Vec::with_capacity(if self.layout.color.is_some() { n } else { 0 }),
            gps_time: Vec::with_capacity(if self.layout.gps_time.is_some() { n } else { 0 }),
            classification: Vec::with_capacity(n),
            source_id: Vec::with_capacity(n),
        });
        RawStrip {
            scan,
            first_place,
            place: Vec::with_capacity(n),
            xyz: Vec::with_capacity(n),
            attributes,
        }
    }

    /// Coordinates in the scan frame; `None` where the point is withheld or out of range.
    #[inline]
    fn local(&self, record: &[u8], frame: &CountFrame) -> Option<[f32; 3]> {
        let p = in_scan(record, frame);
        // Written so that a NaN (from a scale near the end of f64) is refused, too.
        let near = p[0].abs() <= self.max_range
            && p[1].abs() <= self.max_range
            && p[2].abs() <= self.max_range;
        let is_good = near && !frame.is_no_return(p) && !self.layout.withheld(record);
        is_good.then(|| p.map(|v| v as f32))
    }

    /// Whether the point is at the scanner itself and not withheld.
    fn is_no_return(&self, record: &[u8], frame: &CountFrame) -> bool {
        frame.is_no_return(in_scan(record, frame)) && !self.layout.withheld(record)
    }

    /// Counts of odd points of a scan from the last full read.
    pub(crate) fn oddities(&self, scan: usize) -> Option<&Oddities> {
        self.oddities.get(scan)
    }

    fn add_attributes(&self, record: &[u8], to: &mut Attributes) {
        to.world.push(self.world(record));
        to.intensity.push(u16_at(record, INTENSITY));
        to.classification.push(self.layout.classification(record));
        to.source_id.push(self.layout.source_id(record));
        if let Some(at) = self.layout.color {
            to.color.push([u16_at(record, at), u16_at(record, at + 2), u16_at(record, at + 4)]);
        }
        if let Some(at) = self.layout.gps_time {
            to.gps_time.push(f64_at(record, at));
        }
    }
}
