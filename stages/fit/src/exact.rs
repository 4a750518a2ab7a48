//! A link's mesh in; where a beam meets it near a place on the surface, out.
//!
//! A sample stands for all of the surface that is nearer to it than to others: at bends its plane is off by a tenth of a
//! millimetre, and beside an edge it may be that of the other face, millimetres off. The mesh itself knows.

use geometry::{Aabb, Vector};
use nalgebra::Vector3;
use robot::Mesh;

/// Least edge of a cell, metres: a few triangles of a casting.
const CELL: f32 = 0.008;
/// Most cells of a link, 16 MiB, and most entries in them, ten times those of the finest: larger links, and those in the
/// wrong unit, have larger cells.
const MAX_CELLS: f32 = 4e6;
const MAX_ENTRIES: f32 = 2e7;
/// How far along a beam the surface may be from where samples have it, metres: half the distance of two samples.
const SLACK: f64 = 0.003;
/// Where on the beam it is asked which cell it passes through, in so many times that.
const STEPS: [f64; 5] = [0.0, 0.5, -0.5, 1.0, -1.0];
/// Slices of a grid overlap by this share of a cell, so that rounding loses no corner.
const BORDER: f32 = 1e-3;
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
        let mut best: Option<(f64, Vector, u32)> = None;
        for &i in self.about(at, ray) {
            let least = best.map_or(SLACK, |b| b.0.abs());
            if let Some((t, n)) = crosses(mesh, i, (at, ray)).filter(|c| c.0.abs() < least) {
                best = Some((t, n, i));
            }
        }
        best.map(|(t, n, triangle)| met((at, ray), (t, n), triangle))
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
        let mut bounds = Aabb::EMPTY;
        mesh.vertices.iter().for_each(|p| bounds.add(p.map(f64::from)));
        let (low, size) = (bounds.min.map(|v| v as f32), bounds.size().map(|v| v as f32));
        let longest = size.into_iter().fold(0.0, f32::max);
        let is_sound = !mesh.triangles.is_empty() && size.iter().all(|v| v.is_finite());
        let cells = |edge: f32| size.map(|v| v / edge + 1.0).iter().product::<f32>();
        let mut edge = CELL;
        while is_sound
            && edge < longest
            && (cells(edge) > MAX_CELLS || n_entries(mesh, edge) > MAX_ENTRIES)
        {
            edge *= 2.0;
        }
        is_sound.then(|| Self { low, edge, n: size.map(|v| (v / edge) as usize + 1) })
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
        for (i, corners) in mesh.triangles.iter().enumerate() {
            let corners = corners.map(|c| mesh.vertices[c as usize]);
            self.walk(&corners, 0, [0; 3], &mut |cell| found(cell, i as u32));
        }
    }

    /// The cells of a convex polygon, slice by slice of this axis and the later ones.
    fn walk(
        &self,
        polygon: &[[f32; 3]],
        axis: usize,
        mut at: [usize; 3],
        found: &mut impl FnMut(usize),
    ) {
        let on_axis = || polygon.iter().map(|p| p[axis]);
        let first = self.along(axis, on_axis().fold(f32::INFINITY, f32::min));
        let last = self.along(axis, on_axis().fold(f32::NEG_INFINITY, f32::max));
        for slice in first..=last {
            at[axis] = slice;
            if axis == 2 {
                found(self.index(at));
            } else if first == last {
                self.walk(polygon, axis + 1, at, found);
            } else {
                let low = self.low[axis] + self.edge * (slice as f32 - BORDER);
                let high = self.low[axis] + self.edge * (slice as f32 + 1.0 + BORDER);
                let (above, n) = cut(polygon, |p| p[axis] - low);
                let (part, n) = cut(&above[..n], |p| high - p[axis]);
                if n > 0 {
                    self.walk(&part[..n], axis + 1, at, found);
                }
            }
        }
    }
}

/// The part of a convex polygon where a linear function is not below 0; a triangle cut on both sides of two axes has at most
/// seven corners.
fn cut(polygon: &[[f32; 3]], f: impl Fn([f32; 3]) -> f32) -> ([[f32; 3]; 8], usize) {
    let (mut out, mut n) = ([[0.0; 3]; 8], 0);
    // Rounding may make more of what is thinner than it: what is beside those corners is not missed.
    let mut add = |p| {
        if n < out.len() {
            out[n] = p;
            n += 1;
        }
    };
    for (k, p) in polygon.iter().enumerate() {
        let q = polygon[(k + 1) % polygon.len()];
        let (a, b) = (f(*p), f(q));
        if a >= 0.0 {
            add(*p);
        }
        if (a >= 0.0) != (b >= 0.0) {
            add([0, 1, 2].map(|i| p[i] + (q[i] - p[i]) * (a / (a - b))));
        }
    }
    (out, n)
}

/// About how many entries all triangles make in cells of an edge, metres.
fn n_entries(mesh: &Mesh, edge: f32) -> f32 {
    let of = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|c| Vector3::from(mesh.vertices[c as usize]) / edge);
        let longest = (b - a).norm().max((c - a).norm()).max((c - b).norm());
        1.0 + longest + (b - a).cross(&(c - a)).norm()
    };
    mesh.triangles.iter().map(of).sum()
}

/// Where a beam still meets a triangle that it met before, from any place on it.
pub(crate) fn again(mesh: &Mesh, triangle: u32, (at, ray): (&Vector, &Vector)) -> Option<Met> {
    crosses(mesh, triangle, (at, ray)).map(|crossed| met((at, ray), crossed, triangle))
}

fn met((at, ray): (&Vector, &Vector), (t, n): (f64, Vector), triangle: u32) -> Met {
    Met { x: at + ray * t, n: n.normalize() * -n.dot(ray).signum(), triangle }
}

/// How far along a beam, from a place on it, it crosses a triangle, and the triangle's normal, of any length; `None` where it
/// passes beside it.
fn crosses(mesh: &Mesh, triangle: u32, (at, ray): (&Vector, &Vector)) -> Option<(f64, Vector)> {
    let corner = |corner: u32| Vector::from(mesh.vertices[corner as usize].map(f64::from));
    let [a, b, c] = mesh.triangles[triangle as usize].map(corner);
    let (u, v) = (b - a, c - a);
    let n = u.cross(&v);
    let t = n.dot(&(a - at)) / n.dot(ray);
    // Shares of the two edges in where the beam meets the plane; along it there are none.
    let w = at + ray * t - a;
    let whole = n.norm_squared();
    let (along_u, along_v) = (w.cross(&v).dot(&n) / whole, u.cross(&w).dot(&n) / whole);
    let is_within = along_u >= -SEAM && along_v >= -SEAM && along_u + along_v <= 1.0 + SEAM;
    (t.is_finite() && is_within).then_some((t, n))
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
        assert!(triangles.begins.len() <= MAX_CELLS as usize + 1);
        let at = Vector::new(200.0, 300.0, 0.001);
        assert!(
            (triangles.meet(&large, &at, &down).expect("the top").n - Vector::z()).norm() < 1e-6
        );
        // A rod a million kilometres long, of no width.
        let vertices = vec![[0.0; 3], [1e9, 0.0, 0.0], [0.0, 1e-9, 0.0]];
        let rod = Mesh { vertices, triangles: vec![[0, 1, 2]] };
        assert!(Triangles::new(&rod).begins.len() <= MAX_CELLS as usize + 1);
        let nothing = Mesh { vertices: Vec::new(), triangles: Vec::new() };
        assert!(Triangles::new(&nothing).meet(&nothing, &at, &down).is_none());
    }

    #[test]
    fn a_triangle_is_in_every_cell_that_it_passes_through() {
        // Slivers, specks and plates.
        let mut seed = 7_u32;
        let mut draw = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as f32 / (1 << 24) as f32
        };
        for width in [1e-4, 0.003, 0.05, 0.4] {
            let about: [f32; 3] = std::array::from_fn(|_| draw());
            let end = std::array::from_fn(|i| about[i] + 0.4 * draw());
            let other = std::array::from_fn(|i| about[i] + width * draw());
            let mesh = Mesh { vertices: vec![about, end, other], triangles: vec![[0, 1, 2]] };
            let triangles = Triangles::new(&mesh);
            for _ in 0..20_000 {
                let (u, v) = (draw(), draw());
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                let p = std::array::from_fn(|i| {
                    about[i] + u * (end[i] - about[i]) + v * (other[i] - about[i])
                });
                let Some(cell) = triangles.grid.holds(p) else { continue };
                assert!(triangles.begins[cell] < triangles.begins[cell + 1], "{p:?}");
            }
        }
    }
}
