//! The mesh of a chunk and the join of several, reduced as far as a bound allows.

use crate::chunk::ChunkVoxels;
use crate::free::FreeSpace;
use crate::mesh::SurfaceMesh;
use crate::shell::shell;
use crate::simplify::simplify;
use contract::Result;

/// Edge of a voxel as a share of the bound. Wider voxels close wider gaps between beams with fewer
/// triangles, but more points at edges of things are then left to boxes.
pub const EDGE_PER_BOUND: f64 = 2.0;
/// Error that is allowed to the library in one pass, as a share of the bound. It is an average over
/// a neighbourhood: the farthest points lie two to three times as far.
pub const ERROR_PER_BOUND: f64 = 0.35;

/// The reduced surface of a chunk, and of how many triangles it was made.
pub struct ChunkSurface {
    /// The mesh, open where the next chunk goes on.
    pub mesh: SurfaceMesh,
    /// Number of triangles before they were reduced.
    pub n_fine: usize,
}

/// The surface of a chunk's own voxels, reduced with about this error, metres.
///
/// # Errors
/// A mesh that cannot be reduced.
pub fn chunk_surface(chunk: &ChunkVoxels, free: &FreeSpace, error: f64) -> Result<ChunkSurface> {
    let mut mesh = shell(chunk, free);
    let n_fine = mesh.triangles.len();
    let is_locked = vec![false; mesh.vertices.len()];
    simplify(&mut mesh, &is_locked, error)?;
    mesh.compact();
    Ok(ChunkSurface { mesh, n_fine })
}

/// Joins the surfaces of neighbouring chunks and reduces them where they meet, with about this
/// error, metres.
///
/// # Errors
/// A mesh that cannot be reduced.
pub fn join_surfaces(parts: Vec<SurfaceMesh>, error: f64) -> Result<SurfaceMesh> {
    let (mut mesh, is_shared) = SurfaceMesh::joined(parts);
    let is_locked: Vec<bool> = is_shared.iter().map(|is_shared| !is_shared).collect();
    if is_shared.contains(&true) {
        simplify(&mut mesh, &is_locked, error)?;
    }
    mesh.compact();
    Ok(mesh)
}
