//! Reads triangles from a mesh file. A broken file is refused by name, and no memory is allocated
//! on the strength of a count in a header.

mod dae;
mod obj;
pub(crate) mod primitive;
mod soup;
mod stl;

pub(crate) use soup::Soup;

use crate::encoding;
use crate::model::Mesh;
use crate::settings::Settings;
use geometry::{Pose, Vector, narrow::local_f32};
use soup::text;
use std::collections::HashMap;

/// Reads a mesh file in the format of its file name extension.
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

/// Adds the triangles of a file to a link's mesh: scaled and placed, with equal vertices joined and
/// triangles without area left out. Returns the number of triangles that were left out because a
/// vertex is not finite.
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
        // Adding zero turns −0 into 0, so that both become the same vertex.
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
