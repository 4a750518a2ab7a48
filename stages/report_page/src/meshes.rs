//! Bodies of robots, coarse enough for a page: vertices that share a cell become one. Equal bodies
//! stand on the page once.

use crate::encode::{push_varint, unsigned};
use geometry::Aabb;
use robot::Mesh;
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::collections::{BTreeSet, HashMap};

/// Most triangles of a robot: with links of 100 mm and more it keeps its shape.
const MOST_OF_ROBOT: usize = 6_000;
/// Most triangles of a robot where a plant has more than [`MANY`] different ones.
const MOST_OF_MANY: usize = 2_000;
const MANY: usize = 24;
/// Most triangles of what hangs on a robot, which is convex pieces.
const MOST_HANGING: usize = 1_500;
/// Cell that is tried first, metres, and by how much it grows until the body is coarse enough.
const FINEST: f64 = 0.001;
const GROWTH: f64 = 1.3;
/// Steps of a coordinate over the extent of a set.
const STEPS: f64 = 65_535.0;

/// A set of bodies, each in the frame of its link.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct MeshEntry {
    n_vertices: usize,
    n_triangles: usize,
    /// Coordinates of a vertex: `min + scale · steps`, metres.
    min: [f64; 3],
    scale: f64,
}

/// All sets of bodies of a page.
#[derive(Debug, Default)]
pub(crate) struct MeshStore {
    pub(crate) entries: Vec<MeshEntry>,
    /// Each set after the other: vertices (link, x, y, z as differences), then triangles.
    pub(crate) bytes: Vec<u8>,
    /// Set of each source by its digest.
    known: HashMap<[u8; 32], usize>,
}

impl MeshStore {
    /// Adds the bodies of a robot and returns the number of their set; `None` without a body.
    pub(crate) fn add_robot(&mut self, bodies: &[(usize, Mesh)]) -> Option<usize> {
        let is_many = self.entries.len() >= MANY;
        self.add(bodies, if is_many { MOST_OF_MANY } else { MOST_OF_ROBOT })
    }

    /// Adds what hangs on a robot.
    pub(crate) fn add_hanging(&mut self, bodies: &[(usize, Mesh)]) -> Option<usize> {
        self.add(bodies, MOST_HANGING)
    }

    fn add(&mut self, bodies: &[(usize, Mesh)], most: usize) -> Option<usize> {
        let bodies: Vec<(usize, &Mesh)> = (bodies.iter())
            .filter(|(_, mesh)| !mesh.triangles.is_empty())
            .map(|(link, mesh)| (*link, mesh))
            .collect();
        if bodies.is_empty() {
            return None;
        }
        let digest = digest(&bodies);
        if let Some(known) = self.known.get(&digest) {
            return Some(*known);
        }
        let mut cell = FINEST;
        let coarse = loop {
            let coarse: Vec<Coarse> =
                bodies.iter().map(|(link, mesh)| Coarse::new(*link, mesh, cell)).collect();
            let n: usize = coarse.iter().map(|c| c.triangles.len()).sum();
            if n <= most || cell > 1.0 {
                break coarse;
            }
            cell *= GROWTH;
        };
        let entry = encode(&coarse, &mut self.bytes);
        self.entries.push(entry);
        self.known.insert(digest, self.entries.len() - 1);
        Some(self.entries.len() - 1)
    }
}

/// A body whose vertices are one a cell.
struct Coarse {
    link: usize,
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Coarse {
    fn new(link: usize, mesh: &Mesh, cell: f64) -> Self {
        let mut of_cell: HashMap<[i32; 3], u32> = HashMap::new();
        let mut sums: Vec<([f64; 3], f64)> = Vec::new();
        let mut new = Vec::with_capacity(mesh.vertices.len());
        for vertex in &mesh.vertices {
            let at = vertex.map(|v| (f64::from(v) / cell).round() as i32);
            let index = *of_cell.entry(at).or_insert_with(|| {
                sums.push(([0.0; 3], 0.0));
                (sums.len() - 1) as u32
            });
            let (sum, n) = &mut sums[index as usize];
            (0..3).for_each(|i| sum[i] += f64::from(vertex[i]));
            *n += 1.0;
            new.push(index);
        }
        let mut seen = BTreeSet::new();
        let mut triangles = Vec::new();
        for triangle in &mesh.triangles {
            let corners = triangle.map(|i| new[i as usize]);
            let mut sorted = corners;
            sorted.sort_unstable();
            let is_flat = sorted[0] == sorted[1] || sorted[1] == sorted[2];
            if !is_flat && seen.insert(sorted) {
                triangles.push(corners);
            }
        }
        let vertices = sums.into_iter().map(|(sum, n)| sum.map(|v| v / n)).collect();
        Self { link, vertices, triangles }
    }
}

fn digest(bodies: &[(usize, &Mesh)]) -> [u8; 32] {
    let mut sum = Sha256::new();
    for (link, mesh) in bodies {
        sum.update((*link as u64).to_le_bytes());
        sum.update((mesh.vertices.len() as u64).to_le_bytes());
        mesh.vertices.iter().flatten().for_each(|v| sum.update(v.to_le_bytes()));
        mesh.triangles.iter().flatten().for_each(|v| sum.update(v.to_le_bytes()));
    }
    sum.finalize().into()
}

/// Appends a set to the bytes of all sets.
fn encode(bodies: &[Coarse], out: &mut Vec<u8>) -> MeshEntry {
    let bounds = Aabb::of(bodies.iter().flat_map(|body| body.vertices.iter().copied()));
    let extent = bounds.size().into_iter().fold(1e-3, f64::max);
    let (min, scale) = (bounds.min, extent / STEPS);
    let mut n_vertices = 0;
    let mut last = [0_i32; 4];
    for body in bodies {
        for vertex in &body.vertices {
            let steps = [0, 1, 2].map(|i| ((vertex[i] - min[i]) / scale).round() as i32);
            let all = [body.link as i32, steps[0], steps[1], steps[2]];
            (0..4).for_each(|i| push_varint(out, unsigned(all[i] - last[i])));
            last = all;
        }
        n_vertices += body.vertices.len();
    }
    let (mut n_triangles, mut first, mut before) = (0, 0_u32, 0_i32);
    for body in bodies {
        for corner in body.triangles.iter().flatten() {
            let corner = (first + corner) as i32;
            push_varint(out, unsigned(corner - before));
            before = corner;
        }
        first += body.vertices.len() as u32;
        n_triangles += body.triangles.len();
    }
    MeshEntry { n_vertices, n_triangles, min, scale }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::{PI, TAU};

    /// A ball of `n` by `n` patches.
    fn ball(n: u32) -> Mesh {
        let at = |i: u32, j: u32| {
            let (a, b) = (i as f32 / n as f32 * PI, j as f32 / n as f32 * TAU);
            [a.sin() * b.cos(), a.sin() * b.sin(), a.cos()].map(|v| 0.2 * v)
        };
        let places = (0..=n).flat_map(|i| (0..=n).map(move |j| (i, j)));
        let vertices = places.map(|(i, j)| at(i, j)).collect();
        let patches = (0..n).flat_map(|i| (0..n).map(move |j| i * (n + 1) + j));
        let two = |k: u32| [[k, k + 1, k + n + 1], [k + 1, k + n + 2, k + n + 1]];
        Mesh { vertices, triangles: patches.flat_map(two).collect() }
    }

    #[test]
    fn a_fine_body_becomes_coarse_and_keeps_its_size() {
        let (fine, mut store) = (ball(200), MeshStore::default());
        assert_eq!(store.add_robot(&[(3, fine)]), Some(0));
        let entry = &store.entries[0];
        assert!((1_000..=MOST_OF_ROBOT).contains(&entry.n_triangles), "{entry:?}");
        let size = entry.scale * STEPS;
        assert!((0.38..0.41).contains(&size), "{size}");
        assert!(store.bytes.len() < 8 * entry.n_triangles, "{} bytes", store.bytes.len());
    }

    #[test]
    fn equal_bodies_stand_there_once() {
        let (a, b, mut store) = (ball(8), ball(9), MeshStore::default());
        let both = [(0, a.clone()), (1, b.clone())];
        assert_eq!(store.add_robot(&both), Some(0));
        assert_eq!(store.add_robot(&[(0, b), (1, a)]), Some(1));
        assert_eq!(store.add_robot(&both), Some(0));
        assert_eq!(store.add_hanging(&[]), None);
        assert_eq!(store.add_robot(&[(0, Mesh::default())]), None);
        assert_eq!(store.entries.len(), 2);
    }
}
