//! A link's mesh in; where a beam meets it near a place on the surface, out.
//!
//! A sample stands for all of the surface that is nearer to it than to others: at bends its plane is off by a tenth of a
//! millimetre, and beside an edge it may be that of the other face, millimetres off. The mesh itself knows.

use geometry::Vector;
use robot::Mesh;
use std::collections::HashMap;

/// Edge of a cell, metres: a few triangles of a casting.
const CELL: f32 = 0.008;
/// How far along a beam the surface may be from where samples have it, metres: half the distance of two samples.
const SLACK: f64 = 0.003;
/// Most pieces of a link: ten times those of the finest.
const MAX_PIECES: f64 = 2e7;
/// Where on the beam it is asked which cell it passes through, in so many times that.
const STEPS: [f64; 5] = [0.0, 0.5, -0.5, 1.0, -1.0];
/// Beams through the seam of two triangles meet one of them: share of a triangle's size.
const SEAM: f64 = 1e-4;

/// Triangles of a mesh by the cells that they lie in.
#[derive(Debug, Default)]
pub(crate) struct Triangles {
    /// Begin and end in `list` of each cell.
    cells: HashMap<u64, [u32; 2]>,
    list: Vec<u32>,
}

/// A place on a surface, link frame: where, the normal towards the scanner, and on which triangle.
pub(crate) struct Met {
    pub(crate) x: Vector,
    pub(crate) n: Vector,
    pub(crate) triangle: u32,
}

impl Triangles {
    /// None of them where there were too many pieces: of a mesh in the wrong unit, say.
    pub(crate) fn new(mesh: &Mesh) -> Self {
        let n_pieces: f64 = (0..mesh.triangles.len() as u32).map(|i| n_pieces(mesh, i)).sum();
        if n_pieces.is_nan() || n_pieces >= MAX_PIECES {
            return Self::default();
        }
        let mut entries: Vec<(u64, u32)> = Vec::with_capacity(2 * mesh.triangles.len());
        for (i, corners) in mesh.triangles.iter().enumerate() {
            let corners = corners.map(|c| mesh.vertices[c as usize]);
            pieces(corners, &mut |low, high| {
                for x in low[0]..=high[0] {
                    for y in low[1]..=high[1] {
                        entries.extend((low[2]..=high[2]).map(|z| (key([x, y, z]), i as u32)));
                    }
                }
            });
        }
        entries.sort_unstable();
        entries.dedup();
        let mut cells = HashMap::new();
        let mut begin = 0;
        for run in entries.chunk_by(|a, b| a.0 == b.0) {
            let end = begin + run.len() as u32;
            cells.insert(run[0].0, [begin, end]);
            begin = end;
        }
        Self { cells, list: entries.into_iter().map(|e| e.1).collect() }
    }

    /// Where a beam (unit length) meets the mesh nearest to a place on the beam, from the side that it comes from; `None`
    /// where it meets nothing nearby.
    pub(crate) fn meet(&self, mesh: &Mesh, at: &Vector, ray: &Vector) -> Option<Met> {
        let mut best: Option<(f64, u32)> = None;
        for &i in self.about(at, ray) {
            let least = best.map_or(SLACK, |b| b.0.abs());
            if let Some(t) = crosses(mesh, i, (at, ray)).filter(|t| t.abs() < least) {
                best = Some((t, i));
            }
        }
        best.map(|(t, triangle)| Met { x: at + ray * t, n: towards(mesh, triangle, ray), triangle })
    }

    /// The triangles in the cells that a beam passes through about a place; some of them more than once.
    fn about(&self, at: &Vector, ray: &Vector) -> impl Iterator<Item = &u32> {
        let key_at = |step: f64| {
            let p = at + ray * (step * SLACK);
            key(cell([p.x, p.y, p.z].map(|v| v as f32)))
        };
        let keys = STEPS.map(key_at);
        let is_first = move |k: &usize| *k == 0 || !keys[..*k].contains(&keys[*k]);
        (0..keys.len()).filter(is_first).flat_map(move |k| {
            let [begin, end] = self.cells.get(&keys[k]).copied().unwrap_or_default();
            &self.list[begin as usize..end as usize]
        })
    }
}

/// Where a beam still meets a triangle that it met before, from any place on it.
pub(crate) fn again(mesh: &Mesh, triangle: u32, (at, ray): (&Vector, &Vector)) -> Option<Met> {
    let t = crosses(mesh, triangle, (at, ray))?;
    Some(Met { x: at + ray * t, n: towards(mesh, triangle, ray), triangle })
}

fn corners(mesh: &Mesh, triangle: u32) -> [Vector; 3] {
    let at = |corner: u32| Vector::from(mesh.vertices[corner as usize].map(f64::from));
    mesh.triangles[triangle as usize].map(at)
}

/// The unit normal of a triangle towards where a beam comes from.
fn towards(mesh: &Mesh, triangle: u32, ray: &Vector) -> Vector {
    let [a, b, c] = corners(mesh, triangle);
    let n = (b - a).cross(&(c - a));
    n.normalize() * -n.dot(ray).signum()
}

/// How far along a beam, from a place on it, it crosses a triangle; `None` where it passes beside it.
fn crosses(mesh: &Mesh, triangle: u32, (at, ray): (&Vector, &Vector)) -> Option<f64> {
    let [a, b, c] = corners(mesh, triangle);
    let (u, v) = (b - a, c - a);
    let n = u.cross(&v);
    let t = n.dot(&(a - at)) / n.dot(ray);
    // Shares of the two edges in where the beam meets the plane; along it there are none.
    let w = at + ray * t - a;
    let whole = n.norm_squared();
    let (along_u, along_v) = (w.cross(&v).dot(&n) / whole, u.cross(&w).dot(&n) / whole);
    let is_within = along_u >= -SEAM && along_v >= -SEAM && along_u + along_v <= 1.0 + SEAM;
    (t.is_finite() && is_within).then_some(t)
}

/// About how many cells a triangle lies in.
fn n_pieces(mesh: &Mesh, triangle: u32) -> f64 {
    let [a, b, c] = corners(mesh, triangle);
    let cell = f64::from(CELL);
    let longest = (b - a).norm().max((c - a).norm()).max((c - b).norm());
    1.0 + longest / cell + (b - a).cross(&(c - a)).norm() / (cell * cell)
}

/// Halves a triangle until its pieces are as small as cells; gives the cells of each.
fn pieces([a, b, c]: [[f32; 3]; 3], each: &mut impl FnMut([i32; 3], [i32; 3])) {
    let apart = |p: &[f32; 3], q: &[f32; 3]| -> f32 {
        p.iter().zip(q).map(|(x, y)| (x - y) * (x - y)).sum()
    };
    let edges =
        [(apart(&a, &b), [a, b, c]), (apart(&b, &c), [b, c, a]), (apart(&c, &a), [c, a, b])];
    let longest = edges.into_iter().max_by(|x, y| x.0.total_cmp(&y.0));
    let Some((length, [p, q, other])) = longest.filter(|e| e.0.is_finite()) else { return };
    if length > (2.0 * CELL).powi(2) {
        let middle = [0, 1, 2].map(|i| 0.5 * (p[i] + q[i]));
        pieces([p, middle, other], each);
        pieces([middle, q, other], each);
        return;
    }
    let low = [0, 1, 2].map(|i| a[i].min(b[i]).min(c[i]));
    let high = [0, 1, 2].map(|i| a[i].max(b[i]).max(c[i]));
    each(cell(low), cell(high));
}

fn cell(p: [f32; 3]) -> [i32; 3] {
    p.map(|v| (v / CELL).floor() as i32)
}

/// One number for a cell: 21 bits an axis.
fn key(cell: [i32; 3]) -> u64 {
    cell.iter().fold(0, |key, c| key << 21 | u64::from(*c as u32 & 0x1f_ffff))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A block's corner: the faces x = 0 and z = 0, half a metre wide, two triangles each.
    fn corner() -> Mesh {
        let vertices = [[0.0, 0.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]];
        let top = vertices.map(|[x, y]| [x, y, 0.0]);
        let front = vertices.map(|[z, y]| [0.0, y, -z]);
        let vertices = top.into_iter().chain(front).collect();
        Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]] }
    }

    #[test]
    fn beams_meet_the_face_that_they_end_on() {
        let mesh = corner();
        let triangles = Triangles::new(&mesh);
        // Down onto the top, from a place a millimetre above it.
        let down = Vector::new(0.1, 0.0, -1.0).normalize();
        let met = triangles.meet(&mesh, &Vector::new(0.2, 0.3, 0.001), &down).expect("the top");
        assert!((met.n - Vector::z()).norm() < 1e-6 && met.x.z.abs() < 1e-9);
        // A beam that ends on the front close below the edge, looked for on the plane of the top.
        let ahead = Vector::new(1.0, 0.0, -0.5).normalize();
        let met = triangles.meet(&mesh, &Vector::new(-0.002, 0.3, 0.0), &ahead).expect("the front");
        assert!((met.n + Vector::x()).norm() < 1e-6 && (met.x.z + 0.001).abs() < 1e-6);
        // One that passes before the edge meets nothing; nor does one far away.
        let past = Vector::new(0.0, 0.0, -1.0);
        assert!(triangles.meet(&mesh, &Vector::new(-0.002, 0.3, 0.0), &past).is_none());
        assert!(triangles.meet(&mesh, &Vector::new(3.0, 0.3, 0.0), &down).is_none());
        // The same in millimetres, taken for metres.
        let vertices = mesh.vertices.iter().map(|p| p.map(|v| 1000.0 * v)).collect();
        let large = Mesh { vertices, ..mesh };
        assert!(Triangles::new(&large).list.is_empty());
    }
}
