//! The stage alone: points as raw little-endian doubles in, a mesh out.

use std::time::Instant;
use surface::{
    ChunkVoxels, EDGE_PER_BOUND, ERROR_PER_BOUND, FarPoints, FreeSpace, OccupiedVoxels,
    TriangleGrid, VoxelLattice, chunk_surface, join_surfaces, surface_area, surface_ply,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let (from, to) = (words.next().ok_or("points")?, words.next().ok_or("mesh")?);
    let bound: f64 = words.next().map_or(Ok(0.01), |w| w.parse())?;
    let share: f64 = words.next().map_or(Ok(EDGE_PER_BOUND), |w| w.parse())?;
    let error: f64 = bound * words.next().map_or(Ok(ERROR_PER_BOUND), |w| w.parse())?;
    let bytes = std::fs::read(from)?;
    let number = |b: &[u8]| f64::from_le_bytes(std::array::from_fn(|i| b[i]));
    let points: Vec<[f64; 3]> = (bytes.chunks_exact(24))
        .map(|b| [number(&b[..8]), number(&b[8..16]), number(&b[16..])])
        .collect();
    let lattice = VoxelLattice { origin: [0.0; 3], edge: share * bound };
    let started = Instant::now();
    let took = |what: &str, n: usize| {
        println!("{:7.2} s {what}: {n}", started.elapsed().as_secs_f64());
    };
    let mut voxels = OccupiedVoxels::new(lattice);
    points.iter().try_for_each(|p| voxels.add(*p))?;
    took("points in voxels", points.len());
    let chunks = voxels.into_chunks();
    took("chunks", chunks.len());
    let free = FreeSpace::default();
    let (mut parts, mut n_fine) = (Vec::new(), 0);
    for (at, bytes) in chunks {
        let chunk = ChunkVoxels::new(lattice, at, &bytes);
        if chunk.is_empty() {
            continue;
        }
        let found = chunk_surface(&chunk, &free, error)?;
        n_fine += found.n_fine;
        parts.push(found.mesh);
    }
    took("fine triangles", n_fine);
    took("reduced by chunk", parts.iter().map(|m| m.triangles.len()).sum());
    let mut mesh = join_surfaces(parts, error)?;
    took("joined", mesh.triangles.len());
    let bounds = geometry::Aabb::of(points.iter().copied());
    let grid = TriangleGrid::new(&mesh, &bounds, bound);
    took("grid", 0);
    let (mut most, mut n_lost) = (0.0_f32, 0);
    let mut far = FarPoints::new(lattice, bound);
    for p in &points {
        let square = grid.square(*p, most);
        if square > (bound * bound) as f32 {
            n_lost += 1;
            far.add(*p);
        } else {
            most = most.max(square);
        }
    }
    took("points beyond the bound", n_lost);
    println!("farthest other: {:.2} mm", most.sqrt() * 1e3);
    let (n_boxes, _) = far.append_to(&mut mesh);
    took("boxes", n_boxes);
    took("triangles", mesh.triangles.len());
    println!("{:?}", surface_area(&mesh, &free));
    std::fs::write(to, surface_ply(&mesh))?;
    Ok(())
}
