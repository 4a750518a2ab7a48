//! Meshes as binary STL, in metres.

use robot::Mesh;

/// Length of the head of an STL file, bytes.
const HEAD: usize = 84;
const TRIANGLE: usize = 50;

/// A mesh as binary STL, scaled; vertices are repeated for each triangle.
#[must_use]
pub fn stl(mesh: &Mesh, scale: f32) -> Vec<u8> {
    let mut out = vec![0_u8; 80];
    out.reserve(4 + TRIANGLE * mesh.triangles.len());
    out.extend((mesh.triangles.len() as u32).to_le_bytes());
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|i| mesh.vertices[i as usize].map(|v| v * scale));
        let (u, v): ([f32; 3], [f32; 3]) =
            (std::array::from_fn(|i| b[i] - a[i]), std::array::from_fn(|i| c[i] - a[i]));
        let n: [f32; 3] = std::array::from_fn(|i| {
            u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3]
        });
        let length = n.iter().map(|x| x * x).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
        for value in n.map(|x| x / length).into_iter().chain(a).chain(b).chain(c) {
            out.extend(value.to_le_bytes());
        }
        out.extend([0, 0]);
    }
    out
}

/// Reads binary STL; equal corners become one vertex. `None` where the length of the file is not
/// that of its triangles, or a number is not finite.
#[must_use]
pub fn read_stl(bytes: &[u8]) -> Option<Mesh> {
    let n = u32::from_le_bytes(bytes.get(80..HEAD)?.try_into().ok()?) as usize;
    if n.checked_mul(TRIANGLE)?.checked_add(HEAD)? != bytes.len() {
        return None;
    }
    let mut mesh = Mesh::default();
    let mut known = std::collections::BTreeMap::new();
    for triangle in bytes[HEAD..].chunks_exact(TRIANGLE) {
        let mut corners = [0_u32; 3];
        for (corner, at) in corners.iter_mut().zip(triangle[12..48].chunks_exact(12)) {
            let point: [f32; 3] = std::array::from_fn(|i| {
                f32::from_le_bytes(std::array::from_fn(|k| at[4 * i + k])) + 0.0
            });
            if !point.iter().all(|v| v.is_finite()) {
                return None;
            }
            *corner = *known.entry(point.map(f32::to_bits)).or_insert_with(|| {
                mesh.vertices.push(point);
                mesh.vertices.len() as u32 - 1
            });
        }
        mesh.triangles.push(corners);
    }
    Some(mesh)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_comes_back_and_a_cut_file_does_not() {
        let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mesh = Mesh {
            vertices: corners.to_vec(),
            triangles: vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]],
        };
        let bytes = stl(&mesh, 1.0);
        let again = read_stl(&bytes).expect("is whole");
        assert_eq!((again.vertices.len(), again.triangles.len()), (4, 4));
        assert_eq!(stl(&again, 1.0), bytes);
        assert!(read_stl(&bytes[..bytes.len() - 1]).is_none());
        assert!(read_stl(&bytes[..70]).is_none());
        let mut many = bytes;
        many[80..84].copy_from_slice(&[0xff; 4]);
        assert!(read_stl(&many).is_none(), "a stated number is not believed");
    }
}
