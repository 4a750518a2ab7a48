//! A mesh in, convex pieces that cover it out, for programs that collide convex bodies only.
//!
//! Space is cut by planes along the axes until the hull of what lies in a part keeps to the mesh.
//! Every triangle lies within the pieces, and no point of a piece is far from the mesh: general
//! decompositions promise neither of an open, thin shell.

use crate::distance::TriangleGrid;
use crate::mesh::SurfaceMesh;
use geometry::Aabb;
use robot::{Mesh, hull};

/// Edge of the blocks that are cut apart by themselves, metres.
pub const CONVEX_BLOCK: f64 = 2.0;
/// Distance of points of a hull that are compared with the mesh, as a share of the excess.
const SAMPLE: f64 = 2.0;
/// Where along an axis cuts are tried, as shares of the length; cuts at the excess from both ends,
/// which take off a wall, are tried as well.
const CUTS: [f64; 7] = [0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875];
/// By how much a piece is made thicker on each side, metres: a hull needs a volume, and the hull of
/// a nearly flat sheet may leave out points that are this near to it.
const THICKER: f64 = 0.0005;

/// Corners of a convex part of a triangle.
type Corners = Vec<[f64; 3]>;

/// Number of a block along each axis.
pub type BlockAt = [i32; 3];

/// Triangles of a mesh by the blocks that they touch, in order.
#[must_use]
pub fn convex_blocks(mesh: &SurfaceMesh) -> Vec<(BlockAt, SurfaceMesh)> {
    let mut blocks: std::collections::BTreeMap<BlockAt, Vec<[u32; 3]>> = Default::default();
    for triangle in &mesh.triangles {
        let own = Aabb::of(mesh.corners(*triangle));
        let [low, high] =
            [own.min, own.max].map(|at| at.map(|v| (v / CONVEX_BLOCK).floor() as i32));
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    blocks.entry([x, y, z]).or_default().push(*triangle);
                }
            }
        }
    }
    let own = |(at, triangles): (BlockAt, Vec<[u32; 3]>)| {
        let mut out = SurfaceMesh::default();
        for triangle in triangles {
            let first = out.vertices.len() as u32;
            out.vertices.extend(mesh.corners(triangle));
            out.triangles.push([first, first + 1, first + 2]);
        }
        (at, out)
    };
    blocks.into_iter().map(own).collect()
}

/// Convex pieces that cover the part of a mesh in a block. No point of a piece's surface is farther
/// from the mesh than about `excess`, and none of its inside than three times that, metres.
#[must_use]
pub fn convex_pieces(at: BlockAt, mesh: &SurfaceMesh, excess: f64) -> Vec<SurfaceMesh> {
    let low = at.map(|v| f64::from(v) * CONVEX_BLOCK);
    let mut parts: Vec<Corners> =
        mesh.triangles.iter().map(|triangle| mesh.corners(*triangle).to_vec()).collect();
    for (axis, low) in low.into_iter().enumerate() {
        let [_, above] = cut(parts, axis, low);
        let [within, _] = cut(above, axis, low + CONVEX_BLOCK);
        parts = within;
    }
    let bounds = bounds(&parts);
    if bounds.is_empty() {
        return Vec::new();
    }
    let grid = TriangleGrid::new(mesh, &bounds, excess);
    let (mut waiting, mut out) = (vec![parts], Vec::new());
    while let Some(parts) = waiting.pop() {
        let own = self::bounds(&parts);
        let longest = own.size().into_iter().fold(0.0, f64::max);
        let piece = piece(&parts);
        if longest <= excess || keeps_to(&piece, &grid, excess) {
            out.push(piece);
            continue;
        }
        let (axis, place) = best_cut(&parts, &own, excess);
        let halves = cut(parts, axis, place);
        waiting.extend(halves.into_iter().filter(|half| !half.is_empty()));
    }
    out
}

fn bounds(parts: &[Corners]) -> Aabb {
    Aabb::of(parts.iter().flatten().copied())
}

/// The parts below and above a plane; parts of no extent are left out.
fn cut(parts: Vec<Corners>, axis: usize, place: f64) -> [Vec<Corners>; 2] {
    let mut out = [Vec::new(), Vec::new()];
    for part in parts {
        let ends = part.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
            [low.min(v[axis]), high.max(v[axis])]
        });
        if ends[1] <= place {
            out[0].push(part);
        } else if ends[0] >= place {
            out[1].push(part);
        } else {
            let mut sides = [Vec::new(), Vec::new()];
            for (k, from) in part.iter().enumerate() {
                let to = &part[(k + 1) % part.len()];
                let off = [from[axis] - place, to[axis] - place];
                if off[0] <= 0.0 {
                    sides[0].push(*from);
                }
                if off[0] >= 0.0 {
                    sides[1].push(*from);
                }
                if off[0] * off[1] < 0.0 {
                    let share = off[0] / (off[0] - off[1]);
                    let mut at: [f64; 3] =
                        std::array::from_fn(|i| from[i] + share * (to[i] - from[i]));
                    at[axis] = place;
                    sides.iter_mut().for_each(|side| side.push(at));
                }
            }
            for (side, out) in sides.into_iter().zip(&mut out) {
                if side.len() > 2 {
                    out.push(side);
                }
            }
        }
    }
    out
}

/// One side of a cut.
struct CutSide {
    bounds: Aabb,
    /// Area of the mesh in it, square metres.
    area: f64,
}

impl CutSide {
    /// Volume in which more than a plate may be hidden: none where the mesh fills one side of a
    /// thin box, as a wall does.
    fn open_volume(&self, excess: f64) -> f64 {
        if self.bounds.is_empty() {
            return 0.0;
        }
        let mut edges = self.bounds.size();
        edges.sort_by(f64::total_cmp);
        let is_plate = edges[0] <= 2.0 * excess && self.area >= edges[1] * edges[2];
        if is_plate { 0.0 } else { edges.into_iter().map(|edge| edge + excess).product() }
    }
}

/// The cut that leaves the least volume open, by the boxes of the parts on both sides.
fn best_cut(parts: &[Corners], own: &Aabb, excess: f64) -> (usize, f64) {
    let boxes: Vec<(Aabb, f64)> =
        parts.iter().map(|part| (Aabb::of(part.iter().copied()), area(part))).collect();
    let size = own.size();
    let longest = (0..3).fold(0, |most, i| if size[i] > size[most] { i } else { most });
    let mut best = (f64::INFINITY, longest, own.center()[longest]);
    for axis in (0..3).filter(|axis| size[*axis] > excess) {
        let at = |share: f64| own.min[axis] + share * size[axis];
        let walls = [own.min[axis] + excess, own.max[axis] - excess];
        let inside = walls.into_iter().filter(|v| *v > own.min[axis] && *v < own.max[axis]);
        for place in CUTS.into_iter().map(at).chain(inside) {
            let mut sides = [0, 1].map(|_| CutSide { bounds: Aabb::EMPTY, area: 0.0 });
            for (part, area) in &boxes {
                let (mut below, mut above) = (*part, *part);
                below.max[axis] = below.max[axis].min(place);
                above.min[axis] = above.min[axis].max(place);
                let length = part.max[axis] - part.min[axis];
                for (side, own) in sides.iter_mut().zip([below, above]) {
                    if own.min[axis] <= own.max[axis] {
                        side.bounds.add(own.min);
                        side.bounds.add(own.max);
                        let left = own.max[axis] - own.min[axis];
                        side.area += if length > 0.0 { area * left / length } else { *area };
                    }
                }
            }
            let both = sides.iter().map(|side| side.open_volume(excess)).sum();
            if both < best.0 {
                best = (both, axis, place);
            }
        }
    }
    (best.1, best.2)
}

/// Area of a convex part of a triangle, square metres.
fn area(part: &Corners) -> f64 {
    let triangles = (2..part.len()).map(|k| {
        let normal = cross(minus(part[k - 1], part[0]), minus(part[k], part[0]));
        dot(normal, normal).sqrt() / 2.0
    });
    triangles.sum()
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| a[i] - b[i])
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

/// The hull of all parts, or their box where no hull holds them all: hulls are found in single
/// precision, and leave out what rises a millimetre above a plate of metres.
fn piece(parts: &[Corners]) -> SurfaceMesh {
    let own = bounds(parts);
    let middle = <[f64; 3]>::from(own.center().coords);
    let moved = |v: &[f64; 3]| {
        let v = [0, 1, 2].map(|i| v[i] - middle[i]);
        let by = |k: usize, i: usize| if k >> i & 1 == 1 { THICKER } else { -THICKER };
        (0..8).map(move |k| [0, 1, 2].map(|i| (v[i] + by(k, i)) as f32))
    };
    let corners: Vec<[f32; 3]> = parts.iter().flatten().flat_map(moved).collect();
    let local = |v: &[f64; 3]| minus(*v, middle);
    let holds = |found: &Mesh| parts.iter().flatten().all(|v| is_within(found, local(v)));
    let Some(found) = hull(&corners).filter(holds) else {
        let mut whole = SurfaceMesh::default();
        let around = own.grown(THICKER);
        whole.add_box(around.min, around.max);
        return whole;
    };
    let world = |v: &[f32; 3]| std::array::from_fn(|i| f64::from(v[i]) + middle[i]);
    SurfaceMesh {
        vertices: found.vertices.iter().map(world).collect(),
        triangles: found.triangles,
        seam: Vec::new(),
    }
}

/// Whether a place is on the inner side of all faces of a hull.
fn is_within(hull: &Mesh, at: [f64; 3]) -> bool {
    hull.triangles.iter().all(|t| {
        let [a, b, c] = t.map(|k| hull.vertices[k as usize].map(f64::from));
        dot(cross(minus(b, a), minus(c, a)), minus(at, a)) <= 0.0
    })
}

/// Whether a hull is thin, and its sides lie on the mesh.
fn keeps_to(piece: &SurfaceMesh, grid: &TriangleGrid, excess: f64) -> bool {
    let (mut volume, mut area) = (0.0, 0.0);
    let origin = piece.vertices[0];
    for triangle in &piece.triangles {
        let [a, b, c] = piece.corners(*triangle);
        let normal = cross(minus(b, a), minus(c, a));
        volume += dot(minus(a, origin), normal) / 6.0;
        area += dot(normal, normal).sqrt() / 2.0;
    }
    // The largest ball in a convex body is no wider than three times volume over area.
    if 3.0 * volume > 2.0 * excess * area {
        return false;
    }
    let most = (excess * excess) as f32;
    let is_near = |at: [f64; 3]| grid.square(at, most) <= most;
    let middles = piece.triangles.iter().map(|t| {
        let [a, b, c] = piece.corners(*t);
        [0, 1, 2].map(|i| (a[i] + b[i] + c[i]) / 3.0)
    });
    middles.into_iter().all(is_near)
        && piece.triangles.iter().all(|t| {
            let [a, b, c] = piece.corners(*t);
            let (u, v) = (minus(b, a), minus(c, a));
            let far = dot(u, u).max(dot(v, v)).max(dot(minus(c, b), minus(c, b))).sqrt();
            let n = (far / (SAMPLE * excess)).ceil().max(1.0) as usize;
            (0..=n).all(|j| {
                (0..=n - j).all(|k| {
                    let [s, t] = [j, k].map(|x| x as f64 / n as f64);
                    is_near([0, 1, 2].map(|i| a[i] + s * u[i] + t * v[i]))
                })
            })
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box without a lid, thin as a shell, turned about z.
    fn open_box(turn: f64) -> SurfaceMesh {
        let mut mesh = SurfaceMesh::default();
        for (low, high) in [
            ([0.0, 0.0, 0.0], [1.0, 1.0, 0.004]),
            ([0.0, 0.0, 0.0], [0.004, 1.0, 0.8]),
            ([0.996, 0.0, 0.0], [1.0, 1.0, 0.8]),
            ([0.0, 0.0, 0.0], [1.0, 0.004, 0.8]),
            ([0.0, 0.996, 0.0], [1.0, 1.0, 0.8]),
        ] {
            mesh.add_box(low, high);
        }
        let (sin, cos) = f64::sin_cos(turn);
        for v in &mut mesh.vertices {
            *v = [cos * v[0] - sin * v[1] + 0.3, sin * v[0] + cos * v[1] + 0.2, v[2] + 0.1];
        }
        mesh
    }

    fn pieces(mesh: &SurfaceMesh, excess: f64) -> Vec<SurfaceMesh> {
        let blocks = convex_blocks(mesh);
        blocks.iter().flat_map(|(at, own)| convex_pieces(*at, own, excess)).collect()
    }

    /// Whether a place lies in a convex piece, up to single precision.
    fn holds(piece: &SurfaceMesh, at: [f64; 3]) -> bool {
        piece.triangles.iter().all(|t| {
            let [a, b, c] = piece.corners(*t);
            let n = [
                (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1]),
                (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2]),
                (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]),
            ];
            let length = n.iter().map(|v| v * v).sum::<f64>().sqrt();
            (0..3).map(|i| n[i] * (at[i] - a[i])).sum::<f64>() <= 1e-5 * length
        })
    }

    #[test]
    fn pieces_cover_the_mesh_and_leave_its_hollow_open() {
        for (turn, most) in [(0.0, 40), (0.35, 600)] {
            let mesh = open_box(turn);
            let excess = 0.02;
            let pieces = pieces(&mesh, excess);
            assert!(pieces.len() <= most, "{} pieces at {turn}", pieces.len());
            for triangle in &mesh.triangles {
                let [a, b, c] = mesh.corners(*triangle);
                for (s, t) in [(0.1, 0.1), (0.8, 0.1), (0.1, 0.8), (0.33, 0.33), (0.5, 0.5)] {
                    let at = [0, 1, 2].map(|i| a[i] + s * (b[i] - a[i]) + t * (c[i] - a[i]));
                    assert!(pieces.iter().any(|p| holds(p, at)), "{at:?} at {turn}");
                }
            }
            // The hollow: everything that is three times the excess from the sheets.
            let bounds = Aabb::of(mesh.vertices.iter().copied());
            let reach = 3.0 * excess;
            let grid = TriangleGrid::new(&mesh, &bounds, reach);
            for k in 0..20_usize.pow(3) {
                let share = [k / 400, k / 20 % 20, k % 20].map(|v| (v as f64 + 0.5) / 20.0);
                let at = [0, 1, 2].map(|i| bounds.min[i] + share[i] * bounds.size()[i]);
                if f64::from(grid.square(at, 0.0)).sqrt() > reach {
                    assert!(!pieces.iter().any(|p| holds(p, at)), "{at:?} at {turn}");
                }
            }
        }
    }

    #[test]
    fn a_box_around_a_single_point_is_covered_where_blocks_cut_it() {
        let mut mesh = SurfaceMesh::default();
        for low in [[-4.4926, -9.9895, -0.0015], [9.9966, 4.7303, -0.0005], [1.0, 2.0, 3.0]] {
            mesh.add_box(low, low.map(|v| v + 0.001));
        }
        let pieces = pieces(&mesh, 0.01);
        let all: Vec<Aabb> =
            pieces.iter().map(|piece| Aabb::of(piece.vertices.iter().copied())).collect();
        for at in &mesh.vertices {
            assert!(all.iter().any(|own| own.grown(1e-6).contains(*at)), "{at:?}, {all:?}");
        }
    }
}
