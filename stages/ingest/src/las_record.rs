//! Bytes of LAS point records in; strips out. The table of the eleven point formats, and the one loop that every
//! LAS and LAZ point goes through.

use crate::las_header::LasHeader;
use crate::reader::{RawStrip, Want};
use contract::Attributes;
use geometry::Pose;

/// Where the fields of a point format lie, bytes from the start of the record.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Layout {
    /// Shortest record.
    pub(crate) len: usize,
    /// Formats 6 to 10: flags, class and source id lie elsewhere.
    pub(crate) modern: bool,
    /// GPS time.
    pub(crate) gps_time: Option<usize>,
    /// Red, green, blue.
    pub(crate) color: Option<usize>,
}

/// LAS 1.4 R15, tables 7 to 17.
const LAYOUTS: [Layout; 11] = [
    Layout { len: 20, modern: false, gps_time: None, color: None },
    Layout { len: 28, modern: false, gps_time: Some(20), color: None },
    Layout { len: 26, modern: false, gps_time: None, color: Some(20) },
    Layout { len: 34, modern: false, gps_time: Some(20), color: Some(28) },
    Layout { len: 57, modern: false, gps_time: Some(20), color: None },
    Layout { len: 63, modern: false, gps_time: Some(20), color: Some(28) },
    Layout { len: 30, modern: true, gps_time: Some(22), color: None },
    Layout { len: 36, modern: true, gps_time: Some(22), color: Some(30) },
    Layout { len: 38, modern: true, gps_time: Some(22), color: Some(30) },
    Layout { len: 59, modern: true, gps_time: Some(22), color: None },
    Layout { len: 67, modern: true, gps_time: Some(22), color: Some(30) },
];

/// Intensity lies at the same place in all formats.
const INTENSITY: usize = 12;

impl Layout {
    /// The layout of a point format.
    pub(crate) fn of(format: u8) -> Option<Self> {
        LAYOUTS.get(usize::from(format)).copied()
    }

    /// Whether the file marks the point as not to be used.
    #[inline]
    pub(crate) fn withheld(self, record: &[u8]) -> bool {
        if self.modern { record[15] & 0b100 != 0 } else { record[15] & 0b1000_0000 != 0 }
    }

    /// Point source id.
    #[inline]
    pub(crate) fn source_id(self, record: &[u8]) -> u16 {
        u16_at(record, if self.modern { 20 } else { 18 })
    }

    /// Class.
    #[inline]
    fn classification(self, record: &[u8]) -> u8 {
        if self.modern { record[16] } else { record[15] & 0b1_1111 }
    }
}

#[inline]
fn u16_at(record: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([record[at], record[at + 1]])
}

#[inline]
fn i32_at(record: &[u8], at: usize) -> f64 {
    f64::from(i32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]]))
}

/// The counts of a record.
#[inline]
fn counts(record: &[u8]) -> [f64; 3] {
    [i32_at(record, 0), i32_at(record, 4), i32_at(record, 8)]
}

/// From counts to the scan frame: `m · counts + t`.
#[derive(Debug, Clone)]
struct Frame {
    m: [[f64; 3]; 3],
    t: [f64; 3],
    /// Whether `m` is diagonal (scanner not rotated).
    diagonal: bool,
}

/// Turns records into strips.
#[derive(Debug, Clone)]
pub(crate) struct Decoder {
    layout: Layout,
    record_len: usize,
    scale: [f64; 3],
    offset: [f64; 3],
    frames: Vec<Frame>,
    /// Scan of each source id; empty where all points are of scan 0.
    scan_of_source: Vec<u16>,
    max_range: f64,
}

impl Decoder {
    /// Whether records have colour.
    pub(crate) fn has_color(&self) -> bool {
        self.layout.color.is_some()
    }

    /// For the scans of a file with these poses; `scan_of_source` tells the scan of each source id (65,536 entries),
    /// or is empty where there is only one scan.
    pub(crate) fn new(
        header: &LasHeader,
        poses: &[Pose],
        scan_of_source: Vec<u16>,
        max_range: f64,
    ) -> Self {
        let frames = poses
            .iter()
            .map(|world_from_scan| {
                let turn = world_from_scan.rotation.inverse().to_rotation_matrix();
                let from =
                    nalgebra::Vector3::from(header.offset) - world_from_scan.translation.vector;
                let t = turn * from;
                let m = [0, 1, 2].map(|i| [0, 1, 2].map(|j| turn[(i, j)] * header.scale[j]));
                let diagonal = world_from_scan.rotation == nalgebra::UnitQuaternion::identity();
                Frame { m, t: [t.x, t.y, t.z], diagonal }
            })
            .collect();
        Self {
            layout: LAYOUTS[usize::from(header.format)],
            record_len: header.record_len,
            scale: header.scale,
            offset: header.offset,
            frames,
            scan_of_source,
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
    pub(crate) fn layout(&self) -> Layout {
        self.layout
    }

    /// Strips of consecutive records, one for each scan that has points among them, by their first place.
    /// `first` is the place of the first record.
    pub(crate) fn decode(&self, records: &[u8], first: u64, want: Want) -> Vec<RawStrip> {
        if self.scan_of_source.is_empty() {
            return self.decode_one(records, first, want).into_iter().collect();
        }
        let mut strips: Vec<Option<RawStrip>> = vec![None; self.frames.len()];
        for (i, record) in records.chunks_exact(self.record_len).enumerate() {
            let scan = usize::from(self.scan_of_source[usize::from(self.layout.source_id(record))]);
            let Some(xyz) = self.local(record, &self.frames[scan]) else {
                continue;
            };
            let place = first + i as u64;
            let strip = strips[scan].get_or_insert_with(|| self.empty(scan, place, 0, want));
            // The range of a strip is that of one block of records, far below 2³².
            strip.place.push((place - strip.first_place) as u32);
            strip.xyz.push(xyz);
            if let Some(attributes) = &mut strip.attributes {
                self.add_attributes(record, attributes);
            }
        }
        let mut strips: Vec<_> = strips.into_iter().flatten().collect();
        strips.sort_by_key(|s| s.first_place);
        strips
    }

    fn decode_one(&self, records: &[u8], first: u64, want: Want) -> Option<RawStrip> {
        let frame = &self.frames[0];
        let mut strip = self.empty(0, first, records.len() / self.record_len, want);
        for (i, record) in records.chunks_exact(self.record_len).enumerate() {
            let Some(xyz) = self.local(record, frame) else {
                continue;
            };
            strip.place.push(i as u32);
            strip.xyz.push(xyz);
            if let Some(attributes) = &mut strip.attributes {
                self.add_attributes(record, attributes);
            }
        }
        let shift = *strip.place.first()?;
        if shift > 0 {
            strip.first_place += u64::from(shift);
            strip.place.iter_mut().for_each(|p| *p -= shift);
        }
        Some(strip)
    }

    /// A strip with room for `n` points.
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

    /// Scan frame, or nothing where the point is withheld or not to be believed.
    #[inline]
    fn local(&self, record: &[u8], frame: &Frame) -> Option<[f32; 3]> {
        let (c, m, t) = (counts(record), &frame.m, &frame.t);
        let p = if frame.diagonal {
            [c[0] * m[0][0] + t[0], c[1] * m[1][1] + t[1], c[2] * m[2][2] + t[2]]
        } else {
            [0, 1, 2].map(|i| c[0] * m[i][0] + c[1] * m[i][1] + c[2] * m[i][2] + t[i])
        };
        // Written so that a NaN (from a scale near the end of f64) fails too.
        let near = p[0].abs() <= self.max_range
            && p[1].abs() <= self.max_range
            && p[2].abs() <= self.max_range;
        (near && !self.layout.withheld(record)).then(|| p.map(|v| v as f32))
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
            let mut bytes = [0; 8];
            bytes.copy_from_slice(&record[at..at + 8]);
            to.gps_time.push(f64::from_le_bytes(bytes));
        }
    }
}
