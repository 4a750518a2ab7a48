//! Distances of points from a mesh, up to a bound: triangles by cells of a grid.

use crate::mesh::SurfaceMesh;
use geometry::Aabb;
use rustc_hash::FxHashMap;

/// Triangles of a mesh by cells, each with all triangles that come within a distance of it.
pub struct TriangleGrid {
    origin: [f64; 3],
    edge: f64,
    /// Range of `listed` of each cell.
    cells: FxHashMap<u64, [u32; 2]>,
    listed: Vec<u32>,
    triangles: Vec<NearTriangle>,
}

/// A triangle, in metres from the grid's origin.
#[derive(Clone, Copy)]
struct NearTriangle([[f32; 3]; 3]);

/// Bits of a cell's number along an axis.
const BITS: u32 = 21;

fn minus(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl NearTriangle {
    /// Square of the distance of a point.
    fn square(&self, p: [f32; 3]) -> f32 {
        let [a, b, c] = self.0;
        let (ab, ac, ap) = (minus(b, a), minus(c, a), minus(p, a));
        let (d1, d2) = (dot(ab, ap), dot(ac, ap));
        let to = |u: f32, v: f32| {
            let off: [f32; 3] = std::array::from_fn(|i| ap[i] - u * ab[i] - v * ac[i]);
            dot(off, off)
        };
        if d1 <= 0.0 && d2 <= 0.0 {
            return to(0.0, 0.0);
        }
        let bp = minus(p, b);
        let (d3, d4) = (dot(ab, bp), dot(ac, bp));
        if d3 >= 0.0 && d4 <= d3 {
            return to(1.0, 0.0);
        }
        let vc = d1 * d4 - d3 * d2;
        if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
            return to(d1 / (d1 - d3), 0.0);
        }
        let cp = minus(p, c);
        let (d5, d6) = (dot(ab, cp), dot(ac, cp));
        if d6 >= 0.0 && d5 <= d6 {
            return to(0.0, 1.0);
        }
        let vb = d5 * d2 - d1 * d6;
        if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
            return to(0.0, d2 / (d2 - d6));
        }
        let va = d3 * d6 - d5 * d4;
        if va <= 0.0 && d4 >= d3 && d5 >= d6 {
            let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
            return to(1.0 - w, w);
        }
        let all = va + vb + vc;
        to(vb / all, vc / all)
    }
}

impl TriangleGrid {
    /// The triangles of a mesh that touch `bounds`, for distances up to `reach`, metres.
    #[must_use]
    pub fn new(mesh: &SurfaceMesh, bounds: &Aabb, reach: f64) -> Self {
        let (wide, edge) = (bounds.grown(2.0 * reach), CELL_PER_REACH * reach);
        let mut grid = Self {
            origin: wide.min,
            edge,
            cells: FxHashMap::default(),
            listed: Vec::new(),
            triangles: Vec::new(),
        };
        let mut pairs: Vec<(u64, u32)> = Vec::new();
        for triangle in &mesh.triangles {
            let corners = mesh.corners(*triangle);
            let own = Aabb::of(corners).grown(reach).shared(&wide);
            if (0..3).any(|i| own.min[i] > own.max[i]) {
                continue;
            }
            let near = corners.map(|v| grid.near(v));
            grid.list(&own, NearTriangle(near), reach as f32, &mut pairs);
            grid.triangles.push(NearTriangle(near));
        }
        pairs.sort_unstable();
        for (at, (cell, triangle)) in pairs.iter().enumerate() {
            grid.listed.push(*triangle);
            let range = grid.cells.entry(*cell).or_insert([at as u32; 2]);
            range[1] = at as u32 + 1;
        }
        grid
    }

    fn near(&self, world: [f64; 3]) -> [f32; 3] {
        std::array::from_fn(|i| (world[i] - self.origin[i]) as f32)
    }

    /// Lists a triangle for all cells of a box that it comes near to, by halving the box.
    fn list(&self, own: &Aabb, triangle: NearTriangle, reach: f32, pairs: &mut Vec<(u64, u32)>) {
        let cell = |v: f64, i: usize| ((v - self.origin[i]) / self.edge).floor().max(0.0) as u32;
        let low: [u32; 3] = std::array::from_fn(|i| cell(own.min[i], i));
        let high: [u32; 3] = std::array::from_fn(|i| cell(own.max[i], i) + 1);
        let number = self.triangles.len() as u32;
        let mut boxes = vec![(low, high)];
        while let Some((low, high)) = boxes.pop() {
            let size: [u32; 3] = std::array::from_fn(|i| high[i] - low[i]);
            let edge = self.edge as f32;
            let middle = std::array::from_fn(|i| (low[i] + high[i]) as f32 * 0.5 * edge);
            let half = size.map(|n| (n as f32 * 0.5 * edge).powi(2)).iter().sum::<f32>().sqrt();
            if triangle.square(middle) > (half + reach).powi(2) {
                continue;
            }
            let axis = (0..3).max_by_key(|i| size[*i]).unwrap_or(0);
            if size[axis] <= 1 {
                pairs.push((key(low), number));
                continue;
            }
            let cut = low[axis] + size[axis] / 2;
            let (mut below, mut above) = (high, low);
            (below[axis], above[axis]) = (cut, cut);
            boxes.extend([(low, below), (above, high)]);
        }
    }

    /// The triangles near a point.
    fn about(&self, p: [f32; 3]) -> &[u32] {
        let edge = self.edge as f32;
        if p.iter().any(|v| !(*v >= 0.0 && v / edge < (1_u32 << BITS) as f32)) {
            return &[];
        }
        let cell = p.map(|v| (v / edge) as u32);
        let [from, to] = self.cells.get(&key(cell)).copied().unwrap_or([0, 0]);
        &self.listed[from as usize..to as usize]
    }

    /// Square of the distance of a point (world frame) from the mesh, square metres; infinite if it
    /// is clearly more than the reach. The search ends once the distance is no more than `enough`.
    #[must_use]
    pub fn square(&self, world: [f64; 3], enough: f32) -> f32 {
        let p = self.near(world);
        let mut least = f32::INFINITY;
        for triangle in self.about(p) {
            least = least.min(self.triangles[*triangle as usize].square(p));
            if least <= enough {
                break;
            }
        }
        least
    }
}

/// Edge of a cell, in reaches: large enough that a plane's triangles are listed seldom.
const CELL_PER_REACH: f64 = 2.0;

fn key(cell: [u32; 3]) -> u64 {
    cell.iter().fold(0, |key, v| key << BITS | u64::from(*v))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_the_nearest_triangle() {
        let mut mesh = SurfaceMesh::default();
        mesh.add_box([1.0, 1.0, 1.0], [2.0, 3.0, 1.5]);
        let bounds = Aabb { min: [0.0; 3], max: [4.0; 3] };
        let grid = TriangleGrid::new(&mesh, &bounds, 0.2);
        let cases = [
            ([1.5, 2.0, 1.6], 0.1),
            ([0.9, 0.9, 0.9], 0.03_f32.sqrt()),
            ([2.1, 2.0, 1.6], 0.02_f32.sqrt()),
            ([1.5, 2.0, 1.25], f32::INFINITY),
            ([1.5, 2.0, 1.4], 0.1),
        ];
        for (at, far) in cases {
            let found = grid.square(at, 0.0).sqrt();
            let is_it = if far.is_finite() { (found - far).abs() < 1e-5 } else { found > 0.2 };
            assert!(is_it, "{at:?}: {found}, not {far}");
        }
    }
}
