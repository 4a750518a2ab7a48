//! Writes a mesh as binary STL, and reads triangles from an STL file: ASCII, binary, or binary with
//! a header that begins "solid".

use super::soup::Soup;
use crate::model::Mesh;
use geometry::{STL_HEAD, STL_TRIANGLE, binary_stl, stl_corners};
use std::collections::BTreeMap;

pub(super) fn read(bytes: &[u8]) -> Result<Soup, String> {
    let claimed =
        (bytes.get(80..STL_HEAD)).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let expected = claimed.map(|n| STL_HEAD + n * STL_TRIANGLE);
    if expected == Some(bytes.len()) {
        return binary(bytes);
    }
    let head = &bytes[..bytes.len().min(4096)];
    let is_text =
        bytes.trim_ascii_start().starts_with(b"solid") && head.is_ascii() && !head.contains(&0);
    if is_text {
        return ascii(super::soup::text(bytes)?);
    }
    match (claimed, expected) {
        (Some(n), Some(expected)) if expected < bytes.len() => {
            let mut soup = binary(&bytes[..expected])?;
            if n > 0 {
                soup.note("bytes after the last triangle are ignored");
            }
            Ok(soup)
        }
        (Some(n), _) => {
            let n_present = (bytes.len() - STL_HEAD) / STL_TRIANGLE;
            Err(format!("the header counts {n} triangles, the file holds {n_present}"))
        }
        _ => Err("too short for an STL file".to_owned()),
    }
}

fn binary(bytes: &[u8]) -> Result<Soup, String> {
    let mut soup = Soup::default();
    for triangle in stl_corners(&bytes[STL_HEAD..]) {
        let mut corners = [0; 3];
        for (index, corner) in corners.iter_mut().zip(triangle) {
            *index = soup.add_vertex(corner.map(f64::from))?;
        }
        soup.add_triangle(corners)?;
    }
    Ok(soup)
}

fn ascii(text: &str) -> Result<Soup, String> {
    let mut soup = Soup::default();
    let mut corners: Vec<u32> = Vec::with_capacity(3);
    let mut closed = false;
    for (line_at, line) in text.lines().enumerate() {
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("vertex") => {
                let mut p = [0.0; 3];
                for v in &mut p {
                    *v = words.next().and_then(|w| w.parse().ok()).ok_or_else(|| {
                        format!("line {}: a vertex needs three numbers", line_at + 1)
                    })?;
                }
                corners.push(soup.add_vertex(p)?);
            }
            Some("endloop") => {
                if corners.len() != 3 {
                    return Err(format!(
                        "line {}: a facet of {} corners",
                        line_at + 1,
                        corners.len()
                    ));
                }
                soup.add_triangle([corners[0], corners[1], corners[2]])?;
                corners.clear();
            }
            Some("endsolid") => closed = true,
            _ => {}
        }
    }
    if !closed || !corners.is_empty() {
        return Err("the text ends before \"endsolid\"".to_owned());
    }
    Ok(soup)
}

impl Mesh {
    /// The mesh as binary STL, metres; vertices are repeated for each triangle.
    #[must_use]
    pub fn to_stl(&self) -> Vec<u8> {
        let corner = |i: u32| self.vertices[i as usize].map(f64::from);
        binary_stl(self.triangles.iter().map(|triangle| triangle.map(corner)))
    }

    /// Reads binary STL; equal corners become one vertex. `None` where the length of the file is
    /// not that of its triangles, or a number is not finite.
    #[must_use]
    pub fn from_stl(bytes: &[u8]) -> Option<Self> {
        let n = u32::from_le_bytes(bytes.get(80..STL_HEAD)?.try_into().ok()?) as usize;
        if n.checked_mul(STL_TRIANGLE)?.checked_add(STL_HEAD)? != bytes.len() {
            return None;
        }
        let (mut mesh, mut known) = (Self::default(), BTreeMap::new());
        for corners in stl_corners(&bytes[STL_HEAD..]) {
            if !corners.as_flattened().iter().all(|v| v.is_finite()) {
                return None;
            }
            // Adding zero turns −0 into 0, so that both become the same vertex.
            let triangle = corners.map(|corner| corner.map(|v| v + 0.0)).map(|corner| {
                *known.entry(corner.map(f32::to_bits)).or_insert_with(|| {
                    mesh.vertices.push(corner);
                    mesh.vertices.len() as u32 - 1
                })
            });
            mesh.triangles.push(triangle);
        }
        Some(mesh)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_comes_back_from_stl_and_a_cut_file_is_refused() {
        let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mesh = Mesh {
            vertices: corners.to_vec(),
            triangles: vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]],
        };
        let bytes = mesh.to_stl();
        let again = Mesh::from_stl(&bytes).expect("is whole");
        assert_eq!((again.vertices.len(), again.triangles.len()), (4, 4));
        assert_eq!(again.to_stl(), bytes);
        assert!(Mesh::from_stl(&bytes[..bytes.len() - 1]).is_none());
        assert!(Mesh::from_stl(&bytes[..70]).is_none());
        let mut broken = bytes.clone();
        broken[STL_HEAD + 12..STL_HEAD + 16].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(Mesh::from_stl(&broken).is_none());
        let mut many = bytes;
        many[80..STL_HEAD].copy_from_slice(&[0xff; 4]);
        assert!(Mesh::from_stl(&many).is_none(), "a stated number is not believed");
    }
}
