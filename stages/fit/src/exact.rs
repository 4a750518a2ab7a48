//! A link's mesh in; where a beam meets it near a place on the surface, out.
//!
//! A sample stands for all of the surface that is nearer to it than to others: at bends its plane is off by a tenth of a
//! millimetre, and beside an edge it may be that of the other face, millimetres off. The mesh itself knows.

use geometry::Vector;
use robot::Mesh;

/// Least edge of a cell, metres: a few triangles of a casting.
const CELL: f32 = 0.008;
/// Most cells of a link, 16 MiB: those of what is larger than a robot's links are larger.
const MAX_CELLS: f32 = 4e6;
/// How far along a beam the surface may be from where samples have it, metres: half the distance of two samples.
const SLACK: f64 = 0.003;
/// Where on the beam it is asked which cell it passes through, in so many times that.
const STEPS: [f64; 5] = [0.0, 0.5, -0.5, 1.0, -1.0];
/// Beams through the seam of two triangles meet one of them: share of a triangle's size.
const SEAM: f64 = 1e-4;

/// Triangles of a mesh by the cells that they lie in.
#[derive(Debug, Default)]
pub(crate) struct Triangles {
    grid: Grid,
    /// Where each cell begins in `list`; one more for the end of the last.
    begins: Vec<u32>,
    list: Vec<u32>,
}

/// Cubes over the bounds of a mesh.
#[derive(Debug, Default)]
struct Grid {
    low: [f32; 3],
    /// Edge of a cell, metres.
    edge: f32,
    /// Cells along x, y, z.
    n: [usize; 3],
}

/// A place on a surface, link frame: where, the normal towards the scanner, and on which triangle.
pub(crate) struct Met {
    pub(crate) x: Vector,
    pub(crate) n: Vector,
    pub(crate) triangle: u32,
}

impl Triangles {
    pub(crate) fn new(mesh: &Mesh) -> Self {
        let Some(grid) = Grid::over(mesh) else { return Self::default() };
        let n_cells: usize = grid.n.iter().product();
        // First how many lie in each cell, then which.
        let mut begins = vec![0_u32; n_cells + 1];
        grid.each(mesh, |cell, _| begins[cell + 1] += 1);
        for cell in 0..n_cells {
            begins[cell + 1] += begins[cell];
        }
        let mut list = vec![0; begins[n_cells] as usize];
        let mut next = begins.clone();
        grid.each(mesh, |cell, triangle| {
            list[next[cell] as usize] = triangle;
            next[cell] += 1;
        });
        Self { grid, begins, list }
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
        let cell_at = |step: f64| {
            let p = at + ray * (step * SLACK);
            self.grid.holds([p.x, p.y, p.z].map(|v| v as f32))
        };
        let cells = STEPS.map(cell_at);
        let is_first = move |k: &usize| !cells[..*k].contains(&cells[*k]);
        (0..cells.len()).filter(is_first).filter_map(move |k| cells[k]).flat_map(|cell| {
            let [begin, end] = [cell, cell + 1].map(|c| self.begins[c] as usize);
            &self.list[begin..end]
        })
    }
}

impl Grid {
    /// `None` where there is no surface.
    fn over(mesh: &Mesh) -> Option<Self> {
        let (mut low, mut high) = ([f32::MAX; 3], [f32::MIN; 3]);
        for p in &mesh.vertices {
            low = [0, 1, 2].map(|i| low[i].min(p[i]));
            high = [0, 1, 2].map(|i| high[i].max(p[i]));
        }
        let size = [0, 1, 2].map(|i| high[i] - low[i]);
        let volume = size.iter().map(|v| v.max(CELL)).product::<f32>();
        let edge = (volume / MAX_CELLS).cbrt().max(CELL);
        let n = size.map(|v| (v / edge) as usize + 1);
        let is_sound = !mesh.triangles.is_empty() && volume.is_finite();
        is_sound.then_some(Self { low, edge, n })
    }

    /// The cell along an axis; of what lies beside the grid the nearest one.
    fn along(&self, axis: usize, v: f32) -> usize {
        (((v - self.low[axis]) / self.edge) as usize).min(self.n[axis] - 1)
    }

    /// The cell that a place lies in.
    fn holds(&self, p: [f32; 3]) -> Option<usize> {
        let at = [0, 1, 2].map(|i| (p[i] - self.low[i]) / self.edge);
        let is_inside = (0..3).all(|i| at[i] >= 0.0 && at[i] < self.n[i] as f32);
        is_inside.then(|| self.index(at.map(|v| v as usize)))
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (x * self.n[1] + y) * self.n[2] + z
    }

    /// Each cell that a triangle lies in, once, triangle by triangle.
    fn each(&self, mesh: &Mesh, mut found: impl FnMut(usize, u32)) {
        let mut cells: Vec<usize> = Vec::new();
        for (i, corners) in mesh.triangles.iter().enumerate() {
            cells.clear();
            self.pieces(corners.map(|c| mesh.vertices[c as usize]), &mut cells);
            if cells.len() > 1 {
                cells.sort_unstable();
                cells.dedup();
            }
            cells.iter().for_each(|cell| found(*cell, i as u32));
        }
    }

    /// Halves a triangle until its pieces are as small as cells; adds the cells of each.
    fn pieces(&self, [a, b, c]: [[f32; 3]; 3], cells: &mut Vec<usize>) {
        let apart = |p: &[f32; 3], q: &[f32; 3]| -> f32 {
            p.iter().zip(q).map(|(x, y)| (x - y) * (x - y)).sum()
        };
        let edges =
            [(apart(&a, &b), [a, b, c]), (apart(&b, &c), [b, c, a]), (apart(&c, &a), [c, a, b])];
        let longest = edges.into_iter().max_by(|x, y| x.0.total_cmp(&y.0));
        let Some((length, [p, q, other])) = longest.filter(|e| e.0.is_finite()) else { return };
        if length > (2.0 * self.edge).powi(2) {
            let middle = [0, 1, 2].map(|i| 0.5 * (p[i] + q[i]));
            self.pieces([p, middle, other], cells);
            self.pieces([middle, q, other], cells);
            return;
        }
        let low = [0, 1, 2].map(|i| self.along(i, a[i].min(b[i]).min(c[i])));
        let high = [0, 1, 2].map(|i| self.along(i, a[i].max(b[i]).max(c[i])));
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                cells.extend((low[2]..=high[2]).map(|z| self.index([x, y, z])));
            }
        }
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
        // The same in millimetres, taken for metres: as many cells as memory stands, and the same answer.
        let vertices = mesh.vertices.iter().map(|p| p.map(|v| 1000.0 * v)).collect();
        let large = Mesh { vertices, ..mesh };
        let triangles = Triangles::new(&large);
        assert!(triangles.begins.len() < 2 * MAX_CELLS as usize);
        let at = Vector::new(200.0, 300.0, 0.001);
        assert!(
            (triangles.meet(&large, &at, &down).expect("the top").n - Vector::z()).norm() < 1e-6
        );
        let nothing = Mesh { vertices: Vec::new(), triangles: Vec::new() };
        assert!(Triangles::new(&nothing).meet(&nothing, &at, &down).is_none());
    }
}
