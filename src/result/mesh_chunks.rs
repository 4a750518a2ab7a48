//! Voxels of chunks on their way to meshes: each tile adds its part to the file of a chunk, in any
//! order, and each chunk is read once as a whole.

use contract::{Error, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use surface::ChunkAt;

/// A folder of such files, which goes with this value.
pub(super) struct VoxelScratch {
    folder: PathBuf,
    chunks: Mutex<BTreeSet<ChunkAt>>,
}

impl VoxelScratch {
    /// An empty folder; what a killed export left there is removed.
    pub(super) fn create(folder: &Path) -> Result<Self> {
        let _ = std::fs::remove_dir_all(folder);
        std::fs::create_dir_all(folder)
            .map_err(|e| Error::of_file("folder cannot be created", folder, e))?;
        Ok(Self { folder: folder.to_path_buf(), chunks: Mutex::default() })
    }

    fn file(&self, at: ChunkAt) -> PathBuf {
        let [x, y, z] = at;
        self.folder.join(format!("{x}_{y}_{z}"))
    }

    /// Adds the voxels of a tile.
    pub(super) fn add(&self, chunks: BTreeMap<ChunkAt, Vec<u8>>) -> Result<()> {
        let mut known = self.chunks.lock().expect("nobody panics while he holds it");
        for (at, bytes) in chunks {
            known.insert(at);
            let path = self.file(at);
            let file = OpenOptions::new().create(true).append(true).open(&path);
            file.and_then(|mut file| file.write_all(&bytes))
                .map_err(|e| Error::of_file("voxels cannot be written", &path, e))?;
        }
        Ok(())
    }

    /// The chunks that have voxels, in order.
    pub(super) fn chunks(&self) -> Vec<ChunkAt> {
        self.chunks.lock().expect("nobody panics while he holds it").iter().copied().collect()
    }

    /// The voxels of a chunk.
    pub(super) fn read(&self, at: ChunkAt) -> Result<Vec<u8>> {
        let path = self.file(at);
        std::fs::read(&path).map_err(|e| Error::of_read("voxels cannot be read", &path, e))
    }
}

impl Drop for VoxelScratch {
    fn drop(&mut self) {
        // A folder that stays is emptied by the next export.
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}
