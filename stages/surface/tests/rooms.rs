//! Rooms with thin things, meshed as a whole: what the mesh promises, whatever the cuts.

use contract::Result;
use geometry::Aabb;
use std::collections::BTreeMap;
use surface::{
    ChunkAt, ChunkVoxels, EDGE_PER_BOUND, ERROR_PER_BOUND, FarPoints, FreeSpace, OccupiedVoxels,
    SurfaceMesh, TriangleGrid, VoxelLattice, chunk_surface, join_surfaces,
};

const BOUND: f64 = 0.01;

/// Numbers between -1 and 1 that look random.
fn noise(k: usize, of: u64) -> f64 {
    let mut v =
        (k as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ of.wrapping_mul(0xd1b5_4a32_d192_ed03);
    v = (v ^ v >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (v >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

/// A floor and a wall, 3 m by 3 m, an oblique wire and a pipe of 20 mm, with noise of 2 mm.
fn room() -> Vec<[f64; 3]> {
    let mut points = Vec::new();
    for k in 0..40_000_usize {
        let (u, v) = ((k / 200) as f64 * 0.015, (k % 200) as f64 * 0.015);
        points.push([u, v, 0.0]);
        points.push([u, 0.0, v]);
    }
    for k in 0..1_000_usize {
        let t = k as f64 * 0.0025;
        points.push([0.2 + t, 0.4 + 0.7 * t, 0.3 + 0.4 * t]);
        let turn = k as f64 * 2.4;
        points.push([0.3 + 0.01 * turn.cos(), 1.2 + 0.01 * turn.sin(), 0.1 + t]);
    }
    for (k, point) in points.iter_mut().enumerate() {
        for (i, v) in point.iter_mut().enumerate() {
            *v += 0.002 * noise(k, i as u64);
        }
    }
    points
}

/// The mesh of points that come in so many tiles, how many triangles it was made of, and how many
/// boxes it took.
fn meshed(points: &[[f64; 3]], n_tiles: usize) -> Result<(SurfaceMesh, [usize; 2])> {
    let lattice = VoxelLattice { origin: [0.0; 3], edge: EDGE_PER_BOUND * BOUND };
    let mut chunks: BTreeMap<ChunkAt, Vec<u8>> = BTreeMap::new();
    // The last tile comes first, as when another thread is faster.
    for tile in (0..n_tiles).rev() {
        let mut voxels = OccupiedVoxels::new(lattice);
        for point in points.iter().skip(tile).step_by(n_tiles) {
            voxels.add(*point)?;
        }
        for (at, bytes) in voxels.into_chunks() {
            chunks.entry(at).or_default().extend(bytes);
        }
    }
    let error = ERROR_PER_BOUND * BOUND;
    let part = |(at, bytes): (ChunkAt, Vec<u8>)| {
        let chunk = ChunkVoxels::new(lattice, at, &bytes);
        chunk_surface(&chunk, &FreeSpace::default(), error)
    };
    let parts = chunks.into_iter().map(part).collect::<Result<Vec<_>>>()?;
    assert!(parts.len() > 1, "the room has seams");
    let n_fine = parts.iter().map(|part| part.n_fine).sum();
    let parts = parts.into_iter().map(|part| part.mesh).collect();
    let mut mesh = join_surfaces(parts, error)?;
    let grid = TriangleGrid::new(&mesh, &Aabb::of(points.iter().copied()), BOUND);
    let mut far = FarPoints::new(lattice, BOUND);
    let is_far = |p: &&[f64; 3]| grid.square(**p, 0.0) > (BOUND * BOUND) as f32;
    points.iter().filter(is_far).for_each(|p| far.add(*p));
    let (n_boxes, _) = far.append_to(&mut mesh);
    Ok((mesh, [n_fine, n_boxes]))
}

#[test]
fn no_point_is_beyond_the_bound_and_few_triangles_do_it() -> Result<()> {
    let points = room();
    let (mesh, [n_fine, n_boxes]) = meshed(&points, 1)?;
    let grid = TriangleGrid::new(&mesh, &Aabb::of(points.iter().copied()), BOUND);
    let most = (BOUND * BOUND * 1.001) as f32;
    assert!(points.iter().all(|p| grid.square(*p, 0.0) <= most));
    let n = mesh.triangles.len();
    assert!(10 * n < n_fine, "{n} of {n_fine} triangles");
    assert!(n_boxes < 400, "{n_boxes} boxes");
    // Nor does the mesh stand out: each vertex is near points.
    let all = points.iter().map(|p| p.map(|v| (v / 0.03).floor() as i64));
    let full: std::collections::BTreeSet<[i64; 3]> = all.collect();
    for vertex in &mesh.vertices {
        let at = vertex.map(|v| (v / 0.03).floor() as i64);
        let is_near = (0..27)
            .any(|k| full.contains(&[at[0] + k / 9 - 1, at[1] + k / 3 % 3 - 1, at[2] + k % 3 - 1]));
        assert!(is_near, "{vertex:?}");
    }
    Ok(())
}

#[test]
fn seams_do_not_gape() -> Result<()> {
    let (mesh, _) = meshed(&room(), 1)?;
    let mut edges: BTreeMap<[u32; 2], i32> = BTreeMap::new();
    for t in &mesh.triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
        }
    }
    let open = edges.values().filter(|n| **n != 0).count();
    assert_eq!(open, 0, "of {} edges", edges.len());
    Ok(())
}

#[test]
fn tiles_of_any_number_give_the_same_mesh() -> Result<()> {
    let points = room();
    let (whole, _) = meshed(&points, 1)?;
    assert!(meshed(&points, 7)?.0 == whole, "seven tiles give another mesh");
    Ok(())
}
