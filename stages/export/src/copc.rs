//! Writes one COPC file with all points of a plant's tiles; the crate `copc_converter` builds the
//! octree out of core.
//!
//! COPC 1.0 (<https://copc.io>) is LAZ whose chunks are the nodes of an octree. Viewers (Potree,
//! QGIS) load only what they show, and all other programs read it as LAZ.

use crate::atomic::AtomicFile;
use contract::{Error, Kind, Result};
use copc_converter::{NodeStorage, Pipeline, PipelineConfig, ProgressEvent, TempCompression};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Path of the file relative to the output folder.
pub const COPC: &str = "clouds/plant.copc.laz";

/// Memory within which the octree is built, bytes. It does not depend on the memory that a run may
/// use, since the grouping of points decides the bytes of the file.
const BUDGET: u64 = 256 << 20;
const TOGETHER: u64 = 200_000;
/// Offset and content of day and year of creation in a LAS header: zero in all files written here,
/// so that the same points give the same bytes.
const CREATED: (u64, [u8; 4]) = (90, [0; 4]);

/// Receives the progress of the conversion, from any thread.
pub trait CopcSteps: Send + Sync {
    /// A step begins, with its total number of points or nodes.
    fn begins(&self, step: &'static str, total: u64);
    /// Number of tiles that are written.
    fn is_at(&self, done: u64);
    /// The step has ended; an error ends the conversion.
    ///
    /// # Errors
    /// If the run is cancelled.
    fn ends(&self) -> Result<()>;
}

/// Writes a COPC file of some tiles (see [`tiles`]), with temporary files as large as the cloud
/// under `scratch`. Returns false where there are no tiles. It uses the threads of the pool in
/// which it is called.
///
/// # Errors
/// If files cannot be read or written, or if `steps` ends the conversion.
pub fn write_copc(
    tiles: &[PathBuf],
    to: &Path,
    scratch: &Path,
    steps: &Arc<impl CopcSteps + 'static>,
) -> Result<bool> {
    if tiles.is_empty() {
        return Ok(false);
    }
    let path = to.to_path_buf();
    let mut file = AtomicFile::create(&path)?;
    std::fs::create_dir_all(scratch)
        .map_err(|e| Error::of_file("folder cannot be created", scratch, e))?;
    let config = PipelineConfig {
        memory_budget: BUDGET,
        temp_dir: Some(scratch.to_path_buf()),
        temporal_index: None,
        progress: Some(Arc::new(Observer(Arc::clone(steps)))),
        chunk_target_override: Some(TOGETHER),
        temp_compression: TempCompression::Lz4,
        node_storage: NodeStorage::Packed,
    };
    let failed = |e: copc_converter::Error| failed(e, &path);
    let all = Pipeline::scan(tiles, config).and_then(Pipeline::validate).map_err(failed)?;
    steps.ends()?;
    let all = all.distribute().map_err(failed)?;
    steps.ends()?;
    let all = all.build().map_err(failed)?;
    steps.ends()?;
    all.write(file.part()).map_err(failed)?;
    steps.ends()?;
    let (at, created) = CREATED;
    file.seek(SeekFrom::Start(at))
        .and_then(|_| file.write_all(&created))
        .map_err(|e| Error::of_file("cloud cannot be finished", &path, e))?;
    file.commit()?;
    Ok(true)
}

/// The tiles in an output folder, sorted by name.
///
/// # Errors
/// If the folder cannot be read.
pub fn tiles(out: &Path) -> Result<Vec<PathBuf>> {
    let folder = out.join("tiles");
    let failed = |e| Error::of_file("tiles cannot be listed", &folder, e);
    let listed = match std::fs::read_dir(&folder) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        listed => listed.map_err(failed)?,
    };
    let mut tiles = listed
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<std::io::Result<Vec<PathBuf>>>()
        .map_err(failed)?;
    // Other files, which operating systems may leave in folders, are ignored.
    tiles.retain(|path| path.extension().is_some_and(|e| e == "las" || e == "laz"));
    tiles.sort();
    Ok(tiles)
}

/// Translates an error of the conversion; errors of the disk stay such.
fn failed(error: copc_converter::Error, path: &Path) -> Error {
    if let copc_converter::Error::Internal(causes) = &error
        && let Some(io) = causes.chain().find_map(|c| c.downcast_ref::<std::io::Error>())
    {
        let number = io.raw_os_error().map(std::io::Error::from_raw_os_error);
        let io = number.unwrap_or_else(|| std::io::Error::new(io.kind(), format!("{causes:#}")));
        return Error::of_file("cloud cannot be written", path, io);
    }
    Error::new(Kind::Bug, "COPC file cannot be created").because(error).at(path.display())
}

/// Forwards the progress of the conversion.
struct Observer<S>(Arc<S>);

impl<S: CopcSteps> copc_converter::ProgressObserver for Observer<S> {
    fn on_progress(&self, event: ProgressEvent) {
        match event {
            ProgressEvent::StageStart { name, total } => self.0.begins(name, total),
            ProgressEvent::StageProgress { done } => self.0.is_at(done),
            ProgressEvent::StageDone => {}
        }
    }
}
