//! A mesh file in, triangles out. Broken files are named, never trusted: a count in a file
//! allocates nothing.

mod dae;
mod obj;
pub(crate) mod primitive;
mod stl;

use crate::encoding;
use crate::model::Mesh;
use crate::settings::Settings;
use geometry::{Pose, Vector, narrow::local_f32};
use std::collections::HashMap;

/// Triangles of one file; the largest robots met have 480 k in all.
pub(crate) const MAX_TRIANGLES: usize = 4_000_000;

/// Triangles as a file has them, metres by the file's own unit.
#[derive(Debug, Default, Clone, PartialEq)]
pub(crate) struct Soup {
    pub(crate) vertices: Vec<[f64; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// What a person may want to know about the file.
    pub(crate) notes: Vec<String>,
}

impl Soup {
    /// A corner's index, or what is wrong.
    fn add_vertex(&mut self, p: [f64; 3]) -> Result<u32, String> {
        let at = u32::try_from(self.vertices.len()).map_err(|_| "too many vertices".to_owned())?;
        self.vertices.push(p);
        Ok(at)
    }

    fn add_triangle(&mut self, corners: [u32; 3]) -> Result<(), String> {
        if self.triangles.len() >= MAX_TRIANGLES {
            return Err(format!("more triangles than a link can have \"{MAX_TRIANGLES}\""));
        }
        self.triangles.push(corners);
        Ok(())
    }

    fn note(&mut self, note: &str) {
        if !self.notes.iter().any(|known| known == note) {
            self.notes.push(note.to_owned());
        }
    }
}

/// Reads a mesh file by its name's ending and its bytes.
pub(crate) fn read(bytes: &[u8], extension: &str, settings: &Settings) -> Result<Soup, String> {
    let soup = match extension.to_lowercase().as_str() {
        "stl" => stl::read(bytes),
        "obj" => obj::read(text(bytes)?),
        "dae" => dae::read(&encoding::decode(bytes)?, settings),
        other => Err(format!(
            "a mesh format that is not read; convert it to STL, OBJ or DAE \"{other}\""
        )),
    }?;
    if soup.triangles.is_empty() { Err("the file has no triangles".to_owned()) } else { Ok(soup) }
}

fn text(bytes: &[u8]) -> Result<&str, String> {
    std::str::from_utf8(bytes).map_err(|e| format!("not UTF-8 from byte {}", e.valid_up_to()))
}

/// Adds a soup to a link's mesh: scaled, placed, equal corners joined, triangles without area left
/// out. Gives the number of triangles left out because a corner is no finite number.
pub(crate) fn append(
    mesh: &mut Mesh,
    soup: &Soup,
    link_from_body: &Pose,
    scale: [f64; 3],
) -> usize {
    let mut known: HashMap<[u32; 3], u32> = HashMap::with_capacity(soup.vertices.len());
    let place = |p: [f64; 3]| {
        let p = link_from_body
            * geometry::Point::from([p[0] * scale[0], p[1] * scale[1], p[2] * scale[2]]);
        // Adding zero makes −0 into 0, so that both are one corner.
        [p.x, p.y, p.z].map(|v| local_f32(v) + 0.0)
    };
    let mut index = |mesh: &mut Mesh, p: [f32; 3]| {
        *known.entry(p.map(f32::to_bits)).or_insert_with(|| {
            mesh.vertices.push(p);
            (mesh.vertices.len() - 1) as u32
        })
    };
    let mirrored = scale[0] * scale[1] * scale[2] < 0.0;
    let mut n_broken = 0;
    for t in &soup.triangles {
        let mut p = t.map(|i| place(soup.vertices[i as usize]));
        if p.iter().flatten().any(|v| !v.is_finite()) {
            n_broken += 1;
            continue;
        }
        if mirrored {
            p.swap(1, 2);
        }
        let [a, b, c] = p.map(|p| Vector::from(p.map(f64::from)));
        if (b - a).cross(&(c - a)).norm_squared() > 0.0 {
            let corners = p.map(|p| index(mesh, p));
            mesh.triangles.push(corners);
        }
    }
    n_broken
}
