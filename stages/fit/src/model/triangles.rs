//! The triangles of a link's mesh in a grid, and where a beam first meets them near a place.
//!
//! A sample stands for all of the surface that is nearer to it than to other samples. At bends its
//! plane is off by a tenth of a millimetre, and beside an edge it may be that of the other face,
//! millimetres off. The mesh itself has no such error.

use geometry::{Aabb, Vector};
use nalgebra::Vector3;
use robot::Mesh;

/// Least edge of a cell, metres: a few triangles of a casting.
const CELL: f32 = 0.008;

/// Bounds of a link's grid: larger links, and those in the wrong unit, have larger cells.
struct GridBounds {
    /// Most cells: 16 MiB.
    cells: f32,
    /// Most entries in all cells, ten times those of the finest mesh.
    entries: f32,
}

const MOST: GridBounds = GridBounds { cells: 4e6, entries: 2e7 };
/// Slices of a grid overlap by this share of a cell, so that rounding loses no corner.
const BORDER: f32 = 1e-3;
/// Beams through the seam of two triangles meet one of them: share of a triangle's size.
const SEAM: f64 = 1e-4;

/// Triangles of a mesh by the cells that they lie in.
#[derive(Debug, Default)]
pub(crate) struct Triangles {
    /// Of each triangle, link frame, metres: in memory in the order of the cells, as beams ask for
    /// them.
    corners: Vec<[[f32; 3]; 3]>,
    grid: CellGrid,
    /// Whether there is any in each cell, 64 of them in a word: most cells on a beam's way are
    /// empty.
    filled: Vec<u64>,
    /// Where each cell begins in `list`; one more for the end of the last.
    begins: Vec<u32>,
    list: Vec<u32>,
}

/// Cubes over the bounds of a mesh.
#[derive(Debug, Default)]
struct CellGrid {
    low: [f32; 3],
    /// Edge of a cell, metres.
    edge: f32,
    /// Cells along x, y, z.
    n: [usize; 3],
}

/// A place on a beam, and the beam's direction, unit length, away from the scanner.
#[derive(Clone, Copy)]
pub(crate) struct BeamPlace<'v> {
    pub(crate) at: &'v Vector,
    pub(crate) ray: &'v Vector,
}

/// A place on a surface, link frame: where, the normal towards the scanner, and on which triangle.
pub(crate) struct MeshHit {
    pub(crate) x: Vector,
    pub(crate) n: Vector,
    pub(crate) triangle: u32,
}

impl Triangles {
    pub(crate) fn new(mesh: &Mesh) -> Self {
        let Some(grid) = CellGrid::over(mesh) else { return Self::default() };
        let n_cells: usize = grid.n.iter().product();
        // First how many lie in each cell, then which.
        let (mut begins, mut entries) = (vec![0_u32; n_cells + 1], Vec::new());
        grid.each(mesh, |cell, triangle| {
            begins[cell + 1] += 1;
            entries.push((cell as u32, triangle));
        });
        for cell in 0..n_cells {
            begins[cell + 1] += begins[cell];
        }
        let mut list = vec![0; entries.len()];
        let mut next = begins.clone();
        for (cell, triangle) in entries {
            let at = &mut next[cell as usize];
            list[*at as usize] = triangle;
            *at += 1;
        }
        let corners = in_order(mesh, &mut list);
        let mut filled = vec![0; n_cells.div_ceil(64)];
        for cell in (0..n_cells).filter(|&cell| begins[cell] < begins[cell + 1]) {
            filled[cell / 64] |= 1_u64 << (cell % 64);
        }
        Self { corners, grid, filled, begins, list }
    }

    fn is_empty(&self, cell: usize) -> bool {
        self.filled[cell / 64] >> (cell % 64) & 1 == 0
    }

    /// Where a beam (unit length) first meets the mesh on a stretch of it, `from` and `to` metres
    /// beyond a place on it; how far beyond it that is, and where.
    pub(crate) fn first(&self, beam: BeamPlace<'_>, stretch: [f64; 2]) -> Option<(f64, MeshHit)> {
        let mut best: Option<(f64, Vector, u32)> = None;
        for (cell, end) in self.grid.along_beam(beam, stretch) {
            if self.is_empty(cell) {
                continue;
            }
            let [begin, after] = [cell, cell + 1].map(|c| self.begins[c] as usize);
            for &i in &self.list[begin..after] {
                let last = best.map_or(stretch[1], |b| b.0);
                if let Some((t, n)) = crosses(&self.corners[i as usize], beam)
                    .filter(|c| c.0 >= stretch[0] && c.0 < last)
                {
                    best = Some((t, n, i));
                }
            }
            if best.is_some_and(|b| b.0 <= end) {
                break;
            }
        }
        best.map(|(t, n, triangle)| (t, met(beam, t, &n, triangle)))
    }

    /// How far beyond a place on it a beam still meets a triangle that it met before, and the
    /// normal towards the scanner there.
    #[inline]
    pub(crate) fn again(&self, triangle: u32, beam: BeamPlace<'_>) -> Option<(f64, Vector)> {
        crosses(&self.corners[triangle as usize], beam).map(|(t, n)| (t, towards(&n, beam.ray)))
    }
}

/// Corners of the triangles that a list names, in the order in which it first does; it names them
/// by their places in that then.
fn in_order(mesh: &Mesh, list: &mut [u32]) -> Vec<[[f32; 3]; 3]> {
    let mut places = vec![None; mesh.triangles.len()];
    let mut out = Vec::with_capacity(places.len());
    for triangle in list {
        let own = *triangle as usize;
        *triangle = *places[own].get_or_insert_with(|| {
            out.push(mesh.triangles[own].map(|c| mesh.vertices[c as usize]));
            out.len() as u32 - 1
        });
    }
    out
}

impl CellGrid {
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
            && (cells(edge) > MOST.cells || n_entries(mesh, edge) > MOST.entries)
        {
            edge *= 2.0;
        }
        is_sound.then(|| Self { low, edge, n: size.map(|v| (v / edge) as usize + 1) })
    }

    /// The cell along an axis; of what lies beside the grid the nearest one.
    fn along(&self, axis: usize, v: f32) -> usize {
        (((v - self.low[axis]) / self.edge) as usize).min(self.n[axis] - 1)
    }

    /// The cells that a stretch of a beam passes through, one after the other, and where on the
    /// beam each ends (Amanatides and Woo 1987).
    fn along_beam(
        &self,
        BeamPlace { at, ray }: BeamPlace<'_>,
        [from, to]: [f64; 2],
    ) -> CellWalk<'_> {
        // Cells in a metre, and how far along the beam one is passed, with its sign: one division
        // an axis.
        let edge = f64::from(self.edge);
        let (inverse, each) = (1.0 / edge, [0, 1, 2].map(|i| edge / ray[i]));
        let start = [0, 1, 2].map(|i| (at[i] - f64::from(self.low[i])) * inverse);
        let (mut begin, mut end) = (from, to);
        for i in 0..3 {
            let n = self.n[i] as f64;
            if ray[i] != 0.0 {
                let sides = [0.0, n].map(|side| (side - start[i]) * each[i]);
                begin = begin.max(sides[0].min(sides[1]));
                end = end.min(sides[0].max(sides[1]));
            } else if !(0.0..=n).contains(&start[i]) {
                end = f64::NEG_INFINITY;
            }
        }
        let first = [0, 1, 2].map(|i| (start[i] + begin * ray[i] * inverse).floor());
        let at =
            [0, 1, 2].map(|i| first[i].clamp(0.0, self.n[i].saturating_sub(1) as f64) as isize);
        let next = [0, 1, 2].map(|i| {
            let side = at[i] as f64 + f64::from(u8::from(ray[i] > 0.0));
            if ray[i] == 0.0 { f64::INFINITY } else { (side - start[i]) * each[i] }
        });
        CellWalk {
            grid: self,
            at: (begin <= end && self.edge > 0.0).then_some(at),
            way: [0, 1, 2].map(|i| if ray[i] > 0.0 { 1 } else { -1 }),
            next,
            each: each.map(f64::abs),
            end,
        }
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

/// Cells of a grid along a beam.
struct CellWalk<'a> {
    grid: &'a CellGrid,
    /// The next one; `None` past the last.
    at: Option<[isize; 3]>,
    /// Which way it goes on each axis.
    way: [isize; 3],
    /// Where on the beam it enters the next cell on each axis, metres, and how far it is from one
    /// to the next.
    next: [f64; 3],
    each: [f64; 3],
    /// Where the stretch ends.
    end: f64,
}

impl Iterator for CellWalk<'_> {
    type Item = (usize, f64);

    #[inline]
    fn next(&mut self) -> Option<(usize, f64)> {
        let at = self.at?;
        let cell = self.grid.index(at.map(|v| v as usize));
        let axis = (1..3).fold(0, |a, b| if self.next[b] < self.next[a] { b } else { a });
        let leaves = self.next[axis];
        let mut after = at;
        after[axis] += self.way[axis];
        let is_inside = after[axis] >= 0 && after[axis] < self.grid.n[axis] as isize;
        self.at = (leaves < self.end && is_inside).then_some(after);
        self.next[axis] += self.each[axis];
        Some((cell, leaves))
    }
}

/// The part of a convex polygon where a linear function is not below 0; a triangle cut on both
/// sides of two axes has at most seven corners.
fn cut(polygon: &[[f32; 3]], f: impl Fn([f32; 3]) -> f32) -> ([[f32; 3]; 8], usize) {
    let (mut out, mut n) = ([[0.0; 3]; 8], 0);
    // Rounding may make more of what is thinner than it: what is beside those corners is not
    // missed.
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

fn met(BeamPlace { at, ray }: BeamPlace<'_>, t: f64, n: &Vector, triangle: u32) -> MeshHit {
    MeshHit { x: at + ray * t, n: towards(n, ray), triangle }
}

/// A normal of any length as one of unit length towards the scanner.
fn towards(n: &Vector, ray: &Vector) -> Vector {
    n / (n.norm() * -n.dot(ray).signum())
}

/// How far along a beam, from a place on it, it crosses a triangle, and the triangle's normal, of
/// any length; `None` where it passes beside it (Möller and Trumbore 1997).
#[inline]
fn crosses(corners: &[[f32; 3]; 3], BeamPlace { at, ray }: BeamPlace<'_>) -> Option<(f64, Vector)> {
    // Maps of arrays are not inlined here.
    let of = |[x, y, z]: &[f32; 3]| Vector::new((*x).into(), (*y).into(), (*z).into());
    let a = of(&corners[0]);
    let (u, v, w) = (of(&corners[1]) - a, of(&corners[2]) - a, at - a);
    let across = ray.cross(&v);
    let whole = u.dot(&across);
    // Shares of the two edges in where the beam meets the plane, the whole of it being 1; along it
    // there are none.
    let (sign, seam) = (whole.signum(), SEAM * whole.abs());
    let along_u = w.dot(&across) * sign;
    if !(along_u >= -seam && along_u <= whole.abs() + seam) {
        return None;
    }
    let beside = w.cross(&u);
    let along_v = ray.dot(&beside) * sign;
    if !(along_v >= -seam && along_u + along_v <= whole.abs() + seam) {
        return None;
    }
    let t = v.dot(&beside) / whole;
    t.is_finite().then(|| (t, u.cross(&v)))
}

#[cfg(test)]
mod tests;
