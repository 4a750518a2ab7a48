//! Turns labelled points and known free space into collision meshes: a thin closed shell around
//! all fixed points, in few triangles.
//!
//! The crate knows no files, threads or labels. Points come in any order; the plant is meshed chunk
//! by chunk, and chunks are joined at corners of voxels that they share, so that nothing gapes.
#![forbid(unsafe_code)]

mod boxes;
mod chunk;
mod convex;
mod distance;
mod free;
mod in_free;
mod mesh;
mod reduce;
mod shell;
mod simplify;
mod voxels;
mod write;

pub use boxes::FarPoints;
pub use chunk::ChunkVoxels;
pub use convex::{BlockAt, CONVEX_BLOCK, convex_blocks, convex_pieces};
pub use distance::TriangleGrid;
pub use free::FreeSpace;
pub use in_free::{SurfaceArea, surface_area};
pub use mesh::SurfaceMesh;
pub use reduce::{ChunkSurface, EDGE_PER_BOUND, ERROR_PER_BOUND, chunk_surface, join_surfaces};
pub use voxels::{ChunkAt, OccupiedVoxels, VoxelLattice};
pub use write::{pieces_obj, surface_glb, surface_obj, surface_ply, surface_stl};
