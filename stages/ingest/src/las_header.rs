//! Reads the header of a LAS or LAZ file and checks it against the length of the file.

use crate::las_layout::RecordLayout;
use crate::units::{self, Declaration, ReferenceSystem};
use contract::{Error, Kind, Result};
use geometry::Aabb;
use std::io::Cursor;

/// The checked content of the header and the variable length records.
#[derive(Debug, Clone)]
pub(crate) struct LasHeader {
    /// Minor version of LAS 1.x.
    pub(crate) minor: u8,
    /// Point format, 0..=10.
    pub(crate) format: u8,
    /// Whether points are compressed (LAZ).
    pub(crate) compressed: bool,
    /// Length of one record, bytes.
    pub(crate) record_len: usize,
    /// Number of records.
    pub(crate) n_points: u64,
    /// Length of one count of x, y and z, in the file's unit, or in metres after `in_metres`.
    pub(crate) scale: [f64; 3],
    /// Added after scaling, in the same unit.
    pub(crate) offset: [f64; 3],
    /// Stated bounds, where they are finite and in order.
    pub(crate) bounds: Option<Aabb>,
    /// Byte offset of the first point.
    pub(crate) points_at: usize,
    /// Offset and length of the payload of the LASzip record, where there is one.
    pub(crate) laszip: Option<(usize, usize)>,
    /// Whether the file is a COPC (octree order).
    pub(crate) copc: bool,
    /// Name of the program that wrote the file.
    pub(crate) software: String,
    /// Declarations of units in its records, the decisive one first.
    pub(crate) declared: Vec<Declaration>,
    /// The coordinate reference system, as its records state it.
    pub(crate) system: Option<ReferenceSystem>,
    /// Messages about oddities.
    pub(crate) notes: Vec<String>,
}

/// Length of the header of a variable length record, bytes.
const VLR_HEADER: usize = 54;
/// Bits of the point format that LASzip sets to mark compressed points.
const COMPRESSED_BITS: u8 = 0b1100_0000;

impl LasHeader {
    /// Reads and checks the header.
    pub(crate) fn read(data: &[u8]) -> Result<Self> {
        let raw = las::raw::Header::read_from(Cursor::new(data)).map_err(|cause| {
            Error::bad_input("the header cannot be read").because(cause).at("header")
        })?;
        let (major, minor) = (raw.version.major, raw.version.minor);
        if major != 1 || minor > 4 {
            return Err(Error::new(
                Kind::Unsupported,
                format!("LAS of version \"{major}.{minor}\""),
            )
            .at("header")
            .hint("versions 1.0 to 1.4 are read; convert it"));
        }
        let format = raw.point_data_record_format & !COMPRESSED_BITS;
        let Some(layout) = RecordLayout::of(format) else {
            return Err(Error::new(Kind::Unsupported, format!("point format \"{format}\""))
                .at("header")
                .hint("formats 0 to 10 are read; convert it"));
        };
        let record_len = usize::from(raw.point_data_record_length);
        if record_len < layout.len {
            return Err(Error::bad_input(format!(
                "records of point format {format} need {} bytes, stated are \"{record_len}\"",
                layout.len
            ))
            .at("header"));
        }
        let mut header = Self {
            minor,
            format,
            compressed: raw.point_data_record_format & COMPRESSED_BITS != 0,
            record_len,
            n_points: 0,
            scale: [raw.x_scale_factor, raw.y_scale_factor, raw.z_scale_factor],
            offset: [raw.x_offset, raw.y_offset, raw.z_offset],
            bounds: stated_bounds(&raw),
            points_at: raw.offset_to_point_data as usize,
            laszip: None,
            copc: false,
            software: text(&raw.generating_software),
            declared: units::of_las(&raw, data),
            system: units::system_of_las(&raw, data),
            notes: Vec::new(),
        };
        header.check_numbers()?;
        header.check_lengths(&raw, data.len())?;
        header.walk_records(&raw, data)?;
        header.n_points = header.count(&raw, data.len())?;
        if header.n_points > 0 && header.bounds.is_none() {
            header.notes.push("the stated bounds are not plausible and are not used".into());
        }
        Ok(header)
    }

    /// Converts the header to metres; `factors` are the metres per unit of x, y and z.
    ///
    /// # Errors
    /// If a number is not finite after the conversion.
    pub(crate) fn in_metres(mut self, factors: [f64; 3]) -> Result<Self> {
        for (axis, factor) in factors.into_iter().enumerate() {
            self.scale[axis] *= factor;
            self.offset[axis] *= factor;
            if let Some(bounds) = &mut self.bounds {
                bounds.min[axis] *= factor;
                bounds.max[axis] *= factor;
            }
        }
        self.check_numbers()?;
        Ok(self)
    }

    fn check_numbers(&self) -> Result<()> {
        for axis in 0..3 {
            let (scale, offset) = (self.scale[axis], self.offset[axis]);
            if !scale.is_finite() || scale == 0.0 {
                return Err(Error::bad_input(format!(
                    "the scale of {} must be finite and not zero, it is \"{scale}\"",
                    ["x", "y", "z"][axis]
                ))
                .at("header"));
            }
            if !offset.is_finite() {
                return Err(Error::bad_input(format!(
                    "the offset of {} must be finite, it is \"{offset}\"",
                    ["x", "y", "z"][axis]
                ))
                .at("header"));
            }
        }
        Ok(())
    }

    fn check_lengths(&self, raw: &las::raw::Header, n_bytes: usize) -> Result<()> {
        let least = raw.version.header_size();
        if raw.header_size < least {
            return Err(Error::bad_input(format!(
                "a header of version 1.{} has {least} bytes, stated are \"{}\"",
                self.minor, raw.header_size
            ))
            .at("header"));
        }
        if self.points_at < usize::from(raw.header_size) || self.points_at > n_bytes {
            return Err(Error::bad_input(format!(
                "points would start outside the file of {n_bytes} bytes, at byte \"{}\"",
                self.points_at
            ))
            .at("header")
            .hint("the file is truncated or damaged; copy or export it again"));
        }
        Ok(())
    }

    /// Finds the relevant variable length records and checks that each ends before the points.
    fn walk_records(&mut self, raw: &las::raw::Header, data: &[u8]) -> Result<()> {
        let mut at = usize::from(raw.header_size);
        for i in 0..raw.number_of_variable_length_records {
            let end = at + VLR_HEADER;
            if end > self.points_at {
                self.notes.push(format!(
                    "{} variable length records are stated, {i} are there",
                    raw.number_of_variable_length_records
                ));
                break;
            }
            let n_payload = usize::from(u16::from_le_bytes([data[at + 20], data[at + 21]]));
            if end + n_payload > self.points_at {
                return Err(Error::bad_input(format!(
                    "variable length record {i} reaches into the points, its length is \"{n_payload}\""
                ))
                .at(format!("byte {at}")));
            }
            let user = text(&data[at + 2..at + 18]);
            let id = u16::from_le_bytes([data[at + 18], data[at + 19]]);
            match (user.as_str(), id) {
                (laz::LazVlr::USER_ID, laz::LazVlr::RECORD_ID) => {
                    self.laszip = Some((end, n_payload))
                }
                ("copc", 1) => self.copc = true,
                _ => {}
            }
            at = end + n_payload;
        }
        if self.compressed && self.laszip.is_none() {
            return Err(Error::bad_input(
                "points are marked as compressed, but the LASzip record is missing",
            )
            .at("variable length records"));
        }
        Ok(())
    }

    /// Number of points. Where the file states two numbers that differ, the one that agrees with
    /// the length of the file counts.
    fn count(&mut self, raw: &las::raw::Header, n_bytes: usize) -> Result<u64> {
        let old = u64::from(raw.number_of_point_records);
        let new = raw.large_file.map_or(old, |large| large.number_of_point_records);
        let room = (self.points_end(raw, n_bytes) - self.points_at) as u64;
        // A compressed point may take as little as a thousandth of a bit, so a count can only be
        // checked against the chunk table; see `laz`.
        let fits = |n: u64| {
            self.compressed || n.checked_mul(self.record_len as u64).is_some_and(|b| b <= room)
        };
        let n = if new == 0 { old } else { new };
        if old != 0 && new != 0 && old != new {
            self.notes.push(format!("the header states both {old} and {new} points"));
            if !fits(new) && fits(old) {
                return Ok(old);
            }
        }
        let there = room / self.record_len as u64;
        if fits(n) {
            // A writer that was stopped before it could correct the count leaves fewer points in
            // the header than in the file.
            if !self.compressed && there > n {
                return Err(Error::bad_input(format!(
                    "{there} points are in the file, stated are only \"{n}\""
                ))
                .at("header")
                .hint("the header is wrong: export the file again, or correct the count"));
            }
            return Ok(n);
        }
        Err(Error::bad_input(format!("only {there} points are in the file, stated are \"{n}\""))
            .at(format!("byte {n_bytes}"))
            .hint("the file is truncated; copy or export it again"))
    }

    /// Byte offset at which the points end at the latest: the length of the file, or the beginning
    /// of the records behind the points, where the header states it.
    fn points_end(&self, raw: &las::raw::Header, n_bytes: usize) -> usize {
        let extended = raw.evlr.filter(|e| e.number_of_evlrs > 0).map(|e| e.start_of_first_evlr);
        [raw.start_of_waveform_data_packet_record, extended]
            .into_iter()
            .flatten()
            .filter_map(|at| usize::try_from(at).ok())
            .filter(|at| *at >= self.points_at && *at <= n_bytes)
            .min()
            .unwrap_or(n_bytes)
    }
}

fn stated_bounds(raw: &las::raw::Header) -> Option<Aabb> {
    let (min, max) = ([raw.min_x, raw.min_y, raw.min_z], [raw.max_x, raw.max_y, raw.max_z]);
    let sane = (0..3).all(|a| min[a].is_finite() && max[a].is_finite() && min[a] <= max[a]);
    sane.then(|| Aabb::of([min, max]))
}

/// Text of a field that is padded with zeros; non-ASCII bytes become `?`.
fn text(field: &[u8]) -> String {
    field
        .iter()
        .take_while(|b| **b != 0)
        .map(|b| if b.is_ascii_graphic() || *b == b' ' { char::from(*b) } else { '?' })
        .collect::<String>()
        .trim_end()
        .to_owned()
}
