//! Meshes as files: binary STL and PLY, OBJ, binary glTF.

use crate::mesh::SurfaceMesh;
use contract::{Error, Kind, Result};
use serde_json::json;
use std::io::Write as _;

/// A mesh as binary STL, metres, single precision.
#[must_use]
pub fn surface_stl(mesh: &SurfaceMesh) -> Vec<u8> {
    geometry::binary_stl(mesh.triangles.iter().map(|triangle| mesh.corners(*triangle)))
}

/// A mesh as binary PLY, metres, double precision.
#[must_use]
pub fn surface_ply(mesh: &SurfaceMesh) -> Vec<u8> {
    let (n, m) = (mesh.vertices.len(), mesh.triangles.len());
    let mut out = format!(
        "ply\nformat binary_little_endian 1.0\ncomment metres, z up\nelement vertex {n}\n\
         property double x\nproperty double y\nproperty double z\nelement face {m}\n\
         property list uint8 int vertex_indices\nend_header\n"
    )
    .into_bytes();
    mesh.vertices.as_flattened().iter().for_each(|v| out.extend(v.to_le_bytes()));
    for triangle in &mesh.triangles {
        out.push(3);
        triangle.iter().for_each(|i| out.extend(i.to_le_bytes()));
    }
    out
}

/// A mesh as OBJ, metres, to a tenth of a millimetre's hundredth.
#[must_use]
pub fn surface_obj(mesh: &SurfaceMesh) -> Vec<u8> {
    let mut out = b"# metres, z up\n".to_vec();
    // Writing to memory does not fail.
    for [x, y, z] in &mesh.vertices {
        let _ = writeln!(out, "v {x:.6} {y:.6} {z:.6}");
    }
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|i| i + 1);
        let _ = writeln!(out, "f {a} {b} {c}");
    }
    out
}

/// Pieces as OBJ: an object each, named `piece_0` and on.
#[must_use]
pub fn pieces_obj(pieces: &[SurfaceMesh]) -> Vec<u8> {
    let mut out = b"# metres, z up\n".to_vec();
    let mut first = 1;
    for (k, mesh) in pieces.iter().enumerate() {
        // Writing to memory does not fail.
        let _ = writeln!(out, "o piece_{k}");
        for [x, y, z] in &mesh.vertices {
            let _ = writeln!(out, "v {x:.6} {y:.6} {z:.6}");
        }
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|i| i + first);
            let _ = writeln!(out, "f {a} {b} {c}");
        }
        first += mesh.vertices.len() as u32;
    }
    out
}

/// A mesh as binary glTF. Its root node turns z up to y up and holds the place of the middle, so
/// that single precision serves in map coordinates, too.
///
/// # Errors
/// A mesh of more than 4 GiB.
pub fn surface_glb(mesh: &SurfaceMesh) -> Result<Vec<u8>> {
    let ends = |pick: fn(f64, f64) -> f64, from: f64| {
        mesh.vertices
            .iter()
            .fold([from; 3], |all: [f64; 3], v| std::array::from_fn(|i| pick(all[i], v[i])))
    };
    let (low, high) = (ends(f64::min, f64::INFINITY), ends(f64::max, f64::NEG_INFINITY));
    let middle: [f64; 3] = std::array::from_fn(|i| {
        if low[i] <= high[i] { ((low[i] + high[i]) * 0.5).round() } else { 0.0 }
    });
    let near = |v: [f64; 3]| -> [f32; 3] { std::array::from_fn(|i| (v[i] - middle[i]) as f32) };
    let (n, m) = (mesh.vertices.len(), mesh.triangles.len());
    let n_bytes = [12 * n, 12 * m];
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let head = json!({
        "asset": { "version": "2.0", "generator": "stillpoint" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [
            { "name": "plant", "rotation": [-half, 0.0, 0.0, half], "children": [1] },
            { "name": "fixed", "translation": middle, "mesh": 0 },
        ],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1, "material": 0 }] }],
        "materials": [{ "pbrMetallicRoughness": {
            "baseColorFactor": [0.6, 0.62, 0.65, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0,
        } }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": n, "type": "VEC3",
              "min": near(low), "max": near(high) },
            { "bufferView": 1, "componentType": 5125, "count": 3 * m, "type": "SCALAR" },
        ],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": n_bytes[0], "target": 34962 },
            { "buffer": 0, "byteOffset": n_bytes[0], "byteLength": n_bytes[1], "target": 34963 },
        ],
        "buffers": [{ "byteLength": n_bytes[0] + n_bytes[1] }],
    });
    let mut head = head.to_string().into_bytes();
    head.resize(head.len().next_multiple_of(4), b' ');
    let all = 12 + 8 + head.len() + 8 + n_bytes[0] + n_bytes[1];
    let length = |n: usize| {
        u32::try_from(n).map_err(|_| {
            Error::new(Kind::OverBudget, "the mesh is larger than the 4 GiB of a binary glTF")
                .hint("take --mesh-format ply, or fewer --triangles")
        })
    };
    let mut out = Vec::with_capacity(all);
    out.extend(b"glTF");
    out.extend(2_u32.to_le_bytes());
    out.extend(length(all)?.to_le_bytes());
    out.extend(length(head.len())?.to_le_bytes());
    out.extend(b"JSON");
    out.extend(head);
    out.extend(length(n_bytes[0] + n_bytes[1])?.to_le_bytes());
    out.extend(b"BIN\0");
    mesh.vertices.iter().for_each(|v| near(*v).iter().for_each(|x| out.extend(x.to_le_bytes())));
    mesh.triangles.as_flattened().iter().for_each(|i| out.extend(i.to_le_bytes()));
    Ok(out)
}
