//! The tiles of a plant in; one COPC file of all their points, coarse to fine, out.
//! `copc_converter` makes the octree out of core.
//!
//! COPC 1.0 (<https://copc.io>) is LAZ whose chunks are the nodes of an octree: viewers (Potree,
//! QGIS) load no more of it than they show, and everything else reads it as LAZ.

use crate::atomic::AtomicFile;
use contract::{Error, Kind, Result};
use copc_converter::{NodeStorage, Pipeline, PipelineConfig, ProgressEvent, TempCompression};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Its name, relative to an output folder.
pub const COPC: &str = "clouds/plant.copc.laz";

/// What the octree is built within, bytes; and points that are built together, for which that is
/// enough. Not what a run may use: how points are grouped decides the bytes of the file.
const BUDGET: u64 = 256 << 20;
const TOGETHER: u64 = 200_000;
/// Day and year of creation in a LAS header: zero in all files of ours, so that the same points are
/// the same bytes.
const CREATED: (u64, [u8; 4]) = (90, [0; 4]);

/// What is to be told of the conversion's steps, from any thread.
pub trait CopcSteps: Send + Sync {
    /// A step begins that has so much to do, points or nodes.
    fn begins(&self, step: &'static str, total: u64);
    /// So much of it is done.
    fn is_at(&self, done: u64);
    /// It has ended; an error ends the conversion.
    ///
    /// # Errors
    /// The run is cancelled.
    fn ends(&self) -> Result<()>;
}

/// Writes a file of some tiles (see [`tiles`]); false where there are none. It keeps files as large
/// as the cloud under `scratch` meanwhile, and works on the threads of the pool that it is called
/// in.
///
/// # Errors
/// Files that cannot be read or written; a step that is to be the last.
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
        .map_err(|e| Error::of_file("folder cannot be made", scratch, e))?;
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

/// The tiles that lie in an output folder, in the order of their names.
///
/// # Errors
/// A folder that cannot be read.
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
    // What systems leave in folders is no tile.
    tiles.retain(|path| path.extension().is_some_and(|e| e == "las" || e == "laz"));
    tiles.sort();
    Ok(tiles)
}

/// An error of the conversion; one of the disk stays one.
fn failed(error: copc_converter::Error, path: &Path) -> Error {
    if let copc_converter::Error::Internal(causes) = &error
        && let Some(io) = causes.chain().find_map(|c| c.downcast_ref::<std::io::Error>())
    {
        let number = io.raw_os_error().map(std::io::Error::from_raw_os_error);
        let io = number.unwrap_or_else(|| std::io::Error::new(io.kind(), format!("{causes:#}")));
        return Error::of_file("cloud cannot be written", path, io);
    }
    Error::new(Kind::Bug, "the COPC file cannot be made").because(error).at(path.display())
}

/// Hands on what the conversion says.
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
