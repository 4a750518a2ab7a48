//! A surface mesh, and how parts of one are joined at their seams.

use rustc_hash::FxHashMap;

/// Triangles of a surface; they are counter-clockwise from outside.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SurfaceMesh {
    /// World frame, metres.
    pub vertices: Vec<[f64; 3]>,
    /// Corners, as indices of vertices.
    pub triangles: Vec<[u32; 3]>,
    /// Vertices on the faces of chunks, by which parts are joined.
    pub(crate) seam: Vec<(u32, SeamId)>,
}

/// A vertex on a face of a chunk: the same for all chunks that have it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct SeamId {
    pub(crate) corner: [i32; 3],
    pub(crate) group: u8,
}

impl SurfaceMesh {
    /// The triangle's corners, metres.
    #[must_use]
    pub fn corners(&self, triangle: [u32; 3]) -> [[f64; 3]; 3] {
        triangle.map(|i| self.vertices[i as usize])
    }

    /// Joins parts; vertices of seams that several have become one. Returns the mesh, and for each
    /// vertex whether it was of several parts.
    pub(crate) fn joined(parts: Vec<Self>) -> (Self, Vec<bool>) {
        let mut out = Self::default();
        let mut known: FxHashMap<SeamId, u32> = FxHashMap::default();
        let mut is_shared: Vec<bool> = Vec::new();
        for part in parts {
            let mut new: Vec<u32> = vec![u32::MAX; part.vertices.len()];
            for (vertex, id) in &part.seam {
                if let Some(&other) = known.get(id) {
                    new[*vertex as usize] = other;
                    is_shared[other as usize] = true;
                }
            }
            for (at, vertex) in part.vertices.iter().enumerate() {
                if new[at] == u32::MAX {
                    new[at] = out.vertices.len() as u32;
                    out.vertices.push(*vertex);
                    is_shared.push(false);
                }
            }
            for (vertex, id) in part.seam {
                let at = new[vertex as usize];
                if known.insert(id, at).is_none() {
                    out.seam.push((at, id));
                }
            }
            out.triangles.extend(part.triangles.iter().map(|t| t.map(|i| new[i as usize])));
        }
        (out, is_shared)
    }

    /// Leaves out vertices that no triangle has, and triangles without three corners.
    pub(crate) fn compact(&mut self) {
        self.triangles.retain(|[a, b, c]| a != b && b != c && c != a);
        let mut new = vec![u32::MAX; self.vertices.len()];
        let mut vertices = Vec::new();
        for triangle in &mut self.triangles {
            for corner in triangle {
                let at = *corner as usize;
                if new[at] == u32::MAX {
                    new[at] = vertices.len() as u32;
                    vertices.push(self.vertices[at]);
                }
                *corner = new[at];
            }
        }
        self.vertices = vertices;
        self.seam.retain_mut(|(vertex, _)| {
            *vertex = new[*vertex as usize];
            *vertex != u32::MAX
        });
    }

    /// Adds another mesh without joining them.
    pub fn append(&mut self, other: &Self) {
        let first = self.vertices.len() as u32;
        self.vertices.extend(&other.vertices);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + first)));
    }

    /// Adds a closed box.
    pub(crate) fn add_box(&mut self, low: [f64; 3], high: [f64; 3]) {
        let first = self.vertices.len() as u32;
        for k in 0..8_usize {
            let end = |i: usize| if k >> (2 - i) & 1 == 1 { high[i] } else { low[i] };
            self.vertices.push([end(0), end(1), end(2)]);
        }
        const FACES: [[u32; 4]; 6] =
            [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
        for [a, b, c, d] in FACES {
            self.triangles.extend([[a, b, c], [a, c, d]].map(|t| t.map(|i| i + first)));
        }
    }
}
