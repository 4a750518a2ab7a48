//! Writes a LAS 1.4 or LAZ file; counts and bounds are written to the header at the end.

use crate::atomic::AtomicFile;
use crate::pack::{Pack, PointColumns};
use crate::record::{LasSettings, RecordExtent};
use crate::summed::{FileSum, SummedFile};
use contract::{Error, Kind, Result};
use geometry::Aabb;
use las::raw;
use laz::{LasZipCompressor, LazItemRecordBuilder, LazItemType, LazVlr};
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Number of bytes that are buffered before they are written.
const GATHER: usize = 1 << 18;
/// Bit of the LAS global encoding: the reference system, if any, is WKT, as formats 6 and up
/// require.
const WKT: u16 = 1 << 4;
/// Bit of the LAS global encoding: GPS times are adjusted standard time.
const STANDARD_TIME: u16 = 1;

/// The summary of a written file.
#[derive(Debug, Clone, PartialEq)]
pub struct LasSummary {
    /// Path of the file.
    pub path: PathBuf,
    /// Number of points.
    pub n_points: u64,
    /// Bounds as in the header, metres; empty where there are no points.
    pub bounds: Aabb,
    /// Length and checksum of the file, if it is not compressed.
    pub sum: Option<FileSum>,
}

enum Sink {
    Plain(SummedFile),
    Compressed(Box<LasZipCompressor<'static, BufWriter<AtomicFile>>>),
}

/// Writes one LAS or LAZ file.
pub struct LasWriter {
    sink: Sink,
    settings: LasSettings,
    pack: Pack,
    extent: RecordExtent,
    path: PathBuf,
    gathered: Vec<u8>,
}

impl LasWriter {
    /// Opens the file. `settings` decide whether it is compressed, whatever its name is.
    ///
    /// # Errors
    /// If the file cannot be created.
    pub fn create(path: impl Into<PathBuf>, settings: LasSettings) -> Result<Self> {
        let path = path.into();
        let head = head(&settings, &RecordExtent::default())?;
        let sink = if settings.compress {
            let mut file = BufWriter::with_capacity(GATHER, AtomicFile::create(&path)?);
            file.write_all(&head)
                .map_err(|e| Error::of_file("cloud cannot be written", &path, e))?;
            let compressor =
                LasZipCompressor::new(file, laz_vlr(&settings)).map_err(|e| ours(e, &path))?;
            Sink::Compressed(Box::new(compressor))
        } else {
            Sink::Plain(SummedFile::create(&path, &head)?)
        };
        let pack = Pack::new(&settings);
        Ok(Self {
            sink,
            settings,
            pack,
            extent: RecordExtent::default(),
            path,
            gathered: Vec::with_capacity(GATHER + 64),
        })
    }

    /// Appends points.
    ///
    /// # Errors
    /// If a point does not fit into LAS coordinates, or if the file cannot be written.
    pub fn push(&mut self, points: &PointColumns<'_>) -> Result<()> {
        let packed = self.pack.pack(points).map_err(|e| e.at(self.path.display()))?;
        packed.runs.iter().for_each(|run| self.extent.join(&run.extent));
        self.gather(&packed.bytes)
    }

    /// Appends records that are encoded already.
    pub(crate) fn push_records(&mut self, records: &[u8], extent: &RecordExtent) -> Result<()> {
        self.extent.join(extent);
        self.gather(records)
    }

    fn gather(&mut self, records: &[u8]) -> Result<()> {
        self.gathered.extend_from_slice(records);
        if self.gathered.len() >= GATHER { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<()> {
        let written = match &mut self.sink {
            Sink::Plain(file) => file.write_all(&self.gathered),
            Sink::Compressed(compressor) => compressor.compress_many(&self.gathered),
        };
        self.gathered.clear();
        written.map_err(|e| Error::of_file("cloud cannot be written", &self.path, e))
    }

    /// Writes counts and bounds to the header, and renames the file to its final name.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(mut self) -> Result<LasSummary> {
        self.flush()?;
        let Self { sink, settings, extent, path, .. } = self;
        let head = head(&settings, &extent)?;
        let sum = match sink {
            Sink::Plain(file) => Some(file.finish(&head)?),
            Sink::Compressed(mut compressor) => {
                let failed = |e| Error::of_file("cloud cannot be finished", &path, e);
                compressor.done().map_err(failed)?;
                let mut file = compressor.into_inner();
                file.seek(SeekFrom::Start(0))
                    .and_then(|_| file.write_all(&head))
                    .map_err(failed)?;
                file.into_inner().map_err(|e| failed(e.into_error()))?.commit()?;
                None
            }
        };
        Ok(LasSummary { path, n_points: extent.n, bounds: bounds(&settings, &extent), sum })
    }
}

/// Bounds of an extent, metres.
pub(crate) fn bounds(settings: &LasSettings, extent: &RecordExtent) -> Aabb {
    if extent.n == 0 {
        return Aabb::EMPTY;
    }
    let q = &settings.quantum;
    let metres =
        |steps: [i32; 3]| [0, 1, 2].map(|i| f64::from(steps[i]) * q.scale[i] + q.offset[i]);
    Aabb { min: metres(extent.min), max: metres(extent.max) }
}

/// Everything before the first point: header and variable length records. Its length does not
/// depend on `extent`.
pub(crate) fn head(settings: &LasSettings, extent: &RecordExtent) -> Result<Vec<u8>> {
    let records = records(settings)?;
    let mut tail = Vec::new();
    for record in &records {
        record.write_to(&mut tail).map_err(bug)?;
    }
    let q = &settings.quantum;
    let bounds =
        if extent.n > 0 { bounds(settings, extent) } else { Aabb { min: [0.0; 3], max: [0.0; 3] } };
    let version = las::Version::new(1, 4);
    // Older formats state the count in the legacy field as well, where it fits.
    let short = u32::try_from(extent.n).ok().filter(|_| settings.short);
    let header_size = version.header_size();
    let mut by_return = [0; 15];
    by_return[0] = extent.n;
    let header = raw::Header {
        global_encoding: if settings.short || settings.has_geotiff() { 0 } else { WKT }
            | if settings.standard_gps_time { STANDARD_TIME } else { 0 },
        version,
        system_identifier: text("EXTRACTION"),
        generating_software: text(concat!("stillpoint ", env!("CARGO_PKG_VERSION"))),
        header_size,
        offset_to_point_data: u32::from(header_size) + tail.len() as u32,
        number_of_variable_length_records: records.len() as u32,
        point_data_record_format: settings.format() | if settings.compress { 0x80 } else { 0 },
        point_data_record_length: settings.record_len() as u16,
        x_scale_factor: q.scale[0],
        y_scale_factor: q.scale[1],
        z_scale_factor: q.scale[2],
        x_offset: q.offset[0],
        y_offset: q.offset[1],
        z_offset: q.offset[2],
        max_x: bounds.max[0],
        min_x: bounds.min[0],
        max_y: bounds.max[1],
        min_y: bounds.min[1],
        max_z: bounds.max[2],
        min_z: bounds.min[2],
        number_of_point_records: short.unwrap_or(0),
        number_of_points_by_return: [short.unwrap_or(0), 0, 0, 0, 0],
        large_file: Some(raw::header::LargeFile {
            number_of_point_records: extent.n,
            number_of_points_by_return: by_return,
        }),
        ..raw::Header::default()
    };
    let mut out = Vec::new();
    header.write_to(&mut out).map_err(bug)?;
    out.extend(tail);
    Ok(out)
}

/// The variable length records of the settings, of the extra bytes and of the compression.
fn records(settings: &LasSettings) -> Result<Vec<raw::Vlr>> {
    let mut records = Vec::new();
    for vlr in &settings.vlrs {
        records.push(vlr_of(&vlr.user_id, vlr.record_id, &vlr.description, vlr.data.clone())?);
    }
    if settings.extra_len() > 0 {
        records.push(vlr_of("LASF_Spec", 4, "what points belong to", extra_bytes(settings))?);
    }
    if settings.compress {
        let mut data = Vec::new();
        laz_vlr(settings).write_to(&mut data)?;
        records.push(vlr_of(LazVlr::USER_ID, LazVlr::RECORD_ID, LazVlr::DESCRIPTION, data)?);
    }
    Ok(records)
}

fn vlr_of(user_id: &str, record_id: u16, description: &str, data: Vec<u8>) -> Result<raw::Vlr> {
    let length = u16::try_from(data.len()).map_err(|_| {
        Error::new(
            Kind::Unsupported,
            format!("variable length record is too long: \"{user_id} {record_id}\""),
        )
    })?;
    Ok(raw::Vlr {
        reserved: 0,
        user_id: text(user_id),
        record_id,
        record_length_after_header: raw::vlr::RecordLength::Vlr(length),
        description: text(description),
        data,
    })
}

/// The Extra Bytes record of LAS 1.4 (R15, table 24): 192 bytes a field.
fn extra_bytes(settings: &LasSettings) -> Vec<u8> {
    const UNSIGNED_SHORT: u8 = 3;
    const UNSIGNED_LONG: u8 = 5;
    let labels = [
        ("RobotId", UNSIGNED_SHORT, "robot + 1, 0 for none"),
        ("LinkId", UNSIGNED_SHORT, "link + 1, 0 for none"),
    ];
    let bodies = [("BodyId", UNSIGNED_LONG, "connected body + 1, 0: floor")];
    let labels = labels.iter().filter(|_| settings.with_labels);
    let mut out = Vec::new();
    for (name, kind, what) in labels.chain(bodies.iter().filter(|_| settings.with_bodies)) {
        let start = out.len();
        out.extend([0, 0, *kind, 0]);
        out.extend(text::<32>(name));
        // The optional fields (no data, minimum, maximum, scale, offset) stay unset.
        out.resize(start + 160, 0);
        out.extend(text::<32>(what));
    }
    out
}

pub(crate) fn laz_vlr(settings: &LasSettings) -> LazVlr {
    let mut items = LazItemRecordBuilder::new();
    items.add_item(LazItemType::Point14);
    if settings.with_color {
        items.add_item(LazItemType::RGB14);
    }
    if settings.extra_len() > 0 {
        items.add_item(LazItemType::Byte14(settings.extra_len() as u16));
    }
    LazVlr::from_laz_items(items.build())
}

/// Text padded with zeros or cut to `N` bytes.
fn text<const N: usize>(s: &str) -> [u8; N] {
    let mut out = [0; N];
    let n = s.len().min(N);
    out[..n].copy_from_slice(&s.as_bytes()[..n]);
    out
}

fn bug(e: las::Error) -> Error {
    Error::new(Kind::Bug, "las header does not serialize").because(e)
}

fn ours(e: laz::LasZipError, path: &Path) -> Error {
    Error::new(Kind::Bug, "laz compressor does not start").because(e).at(path.display())
}
