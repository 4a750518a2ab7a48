//! A fine mesh in, one of fewer triangles out, by `meshopt`. Its stated error is an average over a
//! neighbourhood, so callers measure what came out.

use crate::mesh::SurfaceMesh;
use contract::{Error, Kind, Result};
use meshopt::{SimplifyOptions, VertexDataAdapter, simplify_with_locks};

/// Removes vertices that are not locked where that changes the surface by no more than about
/// `error`, metres. Vertices on open edges, as of seams, stay; all that stay keep their places.
///
/// # Errors
/// A mesh that the library cannot take.
pub(crate) fn simplify(mesh: &mut SurfaceMesh, is_locked: &[bool], error: f64) -> Result<()> {
    if mesh.triangles.is_empty() {
        return Ok(());
    }
    // Single precision is fine to a micrometre near the mesh's own middle.
    let middle = mesh.vertices[mesh.vertices.len() / 2];
    let near: Vec<f32> = (mesh.vertices.iter())
        .flat_map(|v| std::array::from_fn::<f32, 3, _>(|i| (v[i] - middle[i]) as f32))
        .collect();
    let bytes: Vec<u8> = near.iter().flat_map(|v| v.to_ne_bytes()).collect();
    let bug = |e: meshopt::Error| Error::new(Kind::Bug, "a mesh cannot be simplified").because(e);
    let places = VertexDataAdapter::new(&bytes, 12, 0).map_err(bug)?;
    let options = SimplifyOptions::LockBorder | SimplifyOptions::ErrorAbsolute;
    let indices = mesh.triangles.as_flattened();
    let left = simplify_with_locks(indices, &places, is_locked, 0, error as f32, options, None);
    mesh.triangles = left.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    Ok(())
}
