//! Writes simulated scans to an E57 file with poses, rows and columns.

use crate::atomic::AtomicFile;
use contract::{Error, Kind, Result};
use e57::{
    E57Writer, IntensityLimits, Quaternion, Record, RecordDataType, RecordName, RecordValue,
    Transform, Translation,
};
use geometry::Pose;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The description of one scan.
#[derive(Debug, Clone, PartialEq)]
pub struct GridScan {
    /// Name of the scan.
    pub name: String,
    /// Pose of the scanner in the world, metres.
    pub world_from_scan: Pose,
    /// Number of rows of the raster.
    pub n_rows: u32,
    /// Number of columns.
    pub n_cols: u32,
}

/// One beam of a scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridPoint {
    /// Coordinates in the scan frame, metres; `None` for a beam without return.
    pub xyz: Option<[f32; 3]>,
    /// Row of the raster.
    pub row: u32,
    /// Column of the raster.
    pub col: u32,
    /// Intensity, 0..65535.
    pub intensity: u16,
}

/// Writes an E57 file of several scans.
pub struct E57Scans {
    writer: E57Writer<Shared>,
    file: Arc<Mutex<SequentialFile>>,
    path: PathBuf,
    n_scans: usize,
}

impl E57Scans {
    /// Opens the file. Its identifiers are derived from its name, so that the same scene gives the
    /// same bytes.
    ///
    /// # Errors
    /// If the file cannot be created.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self> {
        let path = path.into();
        let file = Arc::new(Mutex::new(SequentialFile::new(AtomicFile::create(&path)?)));
        let shared = Shared(Arc::clone(&file));
        let writer = E57Writer::new(
            shared,
            &guid(&path.file_name().unwrap_or_default().to_string_lossy(), 0),
        )
        .map_err(|e| failed(e, &path))?;
        Ok(Self { writer, file, path, n_scans: 0 })
    }

    /// Appends a scan with its points in any order, and returns the number of points written.
    ///
    /// # Errors
    /// If a pixel lies outside the raster, or if the file cannot be written.
    pub fn add(
        &mut self,
        scan: &GridScan,
        points: impl IntoIterator<Item = Result<GridPoint>>,
    ) -> Result<u64> {
        let failed = |e| failed(e, &self.path);
        self.n_scans += 1;
        let mut cloud = self
            .writer
            .add_pointcloud(&guid(&scan.name, self.n_scans as u64), prototype(scan))
            .map_err(failed)?;
        let (p, q) = (scan.world_from_scan.translation, scan.world_from_scan.rotation);
        cloud.set_name(Some(scan.name.clone()));
        cloud.set_sensor_vendor(Some("stillpoint".into()));
        cloud.set_sensor_model(Some("virtual scanner".into()));
        cloud.set_transform(Some(Transform {
            rotation: Quaternion { w: q.w, x: q.i, y: q.j, z: q.k },
            translation: Translation { x: p.x, y: p.y, z: p.z },
        }));
        cloud.set_intensity_limits(Some(IntensityLimits {
            intensity_min: Some(RecordValue::Integer(0)),
            intensity_max: Some(RecordValue::Integer(i64::from(u16::MAX))),
        }));
        let mut n = 0;
        for point in points {
            let point = point?;
            // The crate would silently cut off bits that do not fit.
            if point.row >= scan.n_rows || point.col >= scan.n_cols {
                let at = format!("{}, {}", point.row, point.col);
                return Err(Error::new(
                    Kind::Bug,
                    format!("pixel lies outside the raster: \"{at}\""),
                ));
            }
            let [x, y, z] = point.xyz.unwrap_or_default();
            // State 2 means no valid coordinates; readers that test only for "not 0" are right,
            // too.
            let state = if point.xyz.is_some() { 0 } else { 2 };
            let values = vec![
                RecordValue::Single(x),
                RecordValue::Single(y),
                RecordValue::Single(z),
                RecordValue::Integer(state),
                RecordValue::Integer(i64::from(point.row)),
                RecordValue::Integer(i64::from(point.col)),
                RecordValue::Integer(i64::from(point.intensity)),
            ];
            cloud.add_point(values).map_err(failed)?;
            n += 1;
        }
        cloud.finalize().map_err(failed)?;
        Ok(n)
    }

    /// Writes the index and renames the file to its final name.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(self) -> Result<()> {
        let Self { mut writer, file, path, .. } = self;
        writer.finalize().map_err(|e| failed(e, &path))?;
        drop(writer);
        let file = Arc::into_inner(file).and_then(|file| file.into_inner().ok());
        let mut file = file.expect("the writer held the only other handle, and is gone");
        file.settle().map_err(|e| Error::of_file("scans cannot be finished", &path, e))?;
        file.file.commit()
    }
}

fn prototype(scan: &GridScan) -> Vec<Record> {
    let single = RecordDataType::Single { min: None, max: None };
    let integer = |max: i64| RecordDataType::Integer { min: 0, max };
    let last = |n: u32| i64::from(n.max(1)) - 1;
    [
        (RecordName::CartesianX, single.clone()),
        (RecordName::CartesianY, single.clone()),
        (RecordName::CartesianZ, single),
        (RecordName::CartesianInvalidState, integer(2)),
        (RecordName::RowIndex, integer(last(scan.n_rows))),
        (RecordName::ColumnIndex, integer(last(scan.n_cols))),
        (RecordName::Intensity, integer(i64::from(u16::MAX))),
    ]
    .into_iter()
    .map(|(name, data_type)| Record { name, data_type })
    .collect()
}

fn failed(e: e57::Error, path: &Path) -> Error {
    Error::new(Kind::Io, "e57 file cannot be written").because(e).at(path.display())
}

/// An identifier from a name and a number (128 bits of FNV-1a): unique in the file and
/// reproducible.
fn guid(name: &str, number: u64) -> String {
    let mut hash = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d_u128;
    for byte in name.bytes().chain(number.to_le_bytes()) {
        hash = (hash ^ u128::from(byte)).wrapping_mul(0x0000_0000_0100_0000_0000_0000_0000_013b);
    }
    let h = format!("{hash:032x}");
    format!("{{{}-{}-{}-{}-{}}}", &h[..8], &h[8..12], &h[12..16], &h[16..20], &h[20..])
}

/// Number of bytes that are buffered: the crate writes pages of 1 KiB and queries the position for
/// each.
const GATHER: usize = 1 << 20;

/// A file that is written almost sequentially: seeking is free, and writes are buffered.
struct SequentialFile {
    file: AtomicFile,
    /// Position of the next byte.
    at: u64,
    /// Length of the file including the buffer.
    end: u64,
    /// The buffer, which begins at offset `from`.
    gathered: Vec<u8>,
    from: u64,
}

impl SequentialFile {
    fn new(file: AtomicFile) -> Self {
        Self { file, at: 0, end: 0, gathered: Vec::with_capacity(GATHER), from: 0 }
    }

    fn settle(&mut self) -> std::io::Result<()> {
        if !self.gathered.is_empty() {
            self.file.seek(SeekFrom::Start(self.from))?;
            self.file.write_all(&self.gathered)?;
            self.gathered.clear();
        }
        Ok(())
    }
}

/// A shared handle to the file: the crate keeps its writer and does not return it.
struct Shared(Arc<Mutex<SequentialFile>>);

impl Shared {
    fn lock(&self) -> MutexGuard<'_, SequentialFile> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Write for Shared {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let mut file = self.lock();
        if file.at != file.from + file.gathered.len() as u64
            || file.gathered.len() + bytes.len() > GATHER
        {
            file.settle()?;
            file.from = file.at;
        }
        file.gathered.extend_from_slice(bytes);
        file.at += bytes.len() as u64;
        file.end = file.end.max(file.at);
        Ok(bytes.len())
    }

    /// Does nothing: the buffer is written when it is full, when the file is read, and at the end.
    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Read for Shared {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        let mut file = self.lock();
        if file.at >= file.end {
            return Ok(0);
        }
        file.settle()?;
        let at = file.at;
        file.file.seek(SeekFrom::Start(at))?;
        let n = file.file.read(bytes)?;
        file.at += n as u64;
        Ok(n)
    }
}

impl Seek for Shared {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        let mut file = self.lock();
        let at = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::End(by) => file.end.checked_add_signed(by),
            SeekFrom::Current(by) => file.at.checked_add_signed(by),
        };
        file.at = at.ok_or(std::io::ErrorKind::InvalidInput)?;
        Ok(file.at)
    }
}
