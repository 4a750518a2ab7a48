//! Makes the mesh of a published result: tiles into voxels, chunks into surfaces, which are joined
//! and measured against all points.

use super::loose_points::{BesideRobots, LooseCells};
use super::mesh_chunks::VoxelScratch;
use super::plant_state::PlantState;
use crate::cache::{VerifiedFiles, tiles_of};
use crate::engine::{Engine, Task};
use clearance::OwnSurface;
use contract::{PointKind, Result, Space, SpaceKind};
use export::read_tile;
use geometry::Aabb;
use std::path::PathBuf;
use surface::{
    ChunkVoxels, EDGE_PER_BOUND, ERROR_PER_BOUND, FarPoints, FreeSpace, OccupiedVoxels,
    SurfaceMesh, TriangleGrid, VoxelLattice, chunk_surface, convex_blocks, convex_pieces,
    join_surfaces,
};

/// Bounds that a mesh may have, metres.
pub(crate) const BOUNDS: [f64; 2] = [0.002, 0.5];

/// Number of bounds that are tried to keep to a number of triangles.
const TRIES: usize = 8;
/// Smallest and largest factor from one bound to the next.
const FACTORS: [f64; 2] = [1.15, 3.0];

/// What is left of the bound for the noise of beams, metres: a point that lies farther from the
/// surface than the rest is put into a box, so that hardly any true surface is farther than the
/// bound. Ranges are off by 5 mm or more once in eighty times where noise is 2 mm.
const NOISE: f64 = 0.005;
/// Least and largest distance beyond which a point is put into a box, as shares of the bound.
const HELD: [f64; 2] = [0.5, 0.75];

/// Middle of a chunk of the lattice that is the middle of a voxel, too, in voxels.
const MIDDLE_OF_CHUNK: f64 = 64.5;

/// Least share of the way from one tried bound to the other that the next one keeps from both.
const WITHIN: f64 = 0.2;

/// A result of which a mesh is made.
pub(super) struct MeshedResult<'a> {
    pub(super) files: &'a VerifiedFiles,
    pub(super) state: &'a PlantState,
    pub(super) tiles: Vec<String>,
    pub(super) region: Option<Aabb>,
    pub(super) free: FreeSpace,
    /// What uncertain points may lie on without standing in a robot's way.
    pub(super) robots: Vec<OwnSurface>,
    /// Where they hang in the air beside a robot.
    pub(super) loose: LooseCells,
    pub(super) scratch: PathBuf,
    pub(super) engine: &'a Engine,
}

/// A mesh that keeps to a bound, and how it was measured.
pub(super) struct BoundedMesh {
    pub(super) mesh: SurfaceMesh,
    pub(super) bound: f64,
    /// Distance of the farthest point, metres.
    pub(super) farthest: f64,
    pub(super) n_points: u64,
    pub(super) n_moving: u64,
    pub(super) n_own: u64,
    pub(super) n_loose: u64,
    pub(super) n_fine: usize,
    pub(super) n_boxes: usize,
}

/// What a mesh makes of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PointPart {
    /// It moves with a robot, and is left out.
    Moves,
    /// It is uncertain and on a moving link of a robot, and is left out: a robot would stand in it.
    Own,
    /// It is uncertain and hangs in the air beside a robot, and is left out.
    Loose,
    /// It is covered.
    Stands,
}

/// Points of a tile that are read.
#[derive(Default)]
struct ReadPoints {
    n: u64,
    n_moving: u64,
    n_own: u64,
    n_loose: u64,
    /// Bounds of those that stand still.
    bounds: Aabb,
}

impl MeshedResult<'_> {
    /// The mesh with the requested bound, or with the finest one above it that keeps to the number
    /// of triangles.
    pub(super) fn within(
        &self,
        finest: f64,
        triangles: Option<usize>,
        warnings: &mut Vec<String>,
    ) -> Result<BoundedMesh> {
        let mut found = self.mesh(finest)?;
        let Some(most) = triangles else { return Ok(found) };
        // The coarsest bound that is known to be too fine, and its number of triangles.
        let mut too_fine: Option<(f64, usize)> = None;
        for _ in 0..TRIES {
            let n = found.mesh.triangles.len();
            let next = match too_fine {
                _ if n > most => {
                    too_fine = Some((found.bound, n));
                    let factor = (n as f64 / most as f64).sqrt().clamp(FACTORS[0], FACTORS[1]);
                    (found.bound * factor).min(BOUNDS[1])
                }
                Some((low, n_low)) if found.bound > low * FACTORS[0] => {
                    // Between the two on a line of logarithms, but clearly within.
                    let share = (n_low as f64 / most as f64).ln() / (n_low as f64 / n as f64).ln();
                    low * (found.bound / low).powf(share.clamp(WITHIN, 1.0 - WITHIN))
                }
                _ => break,
            };
            if next <= found.bound && n > most {
                break;
            }
            let other = self.mesh(next)?;
            let n_other = other.mesh.triangles.len();
            if n <= most && n_other > most {
                too_fine = Some((next, n_other));
            } else {
                found = other;
            }
        }
        let n = found.mesh.triangles.len();
        if n > most {
            warnings.push(format!("{most} triangles cannot be kept to: there are {n}"));
        }
        Ok(found)
    }

    /// The lattice of a bound: its origin is near the tiles, so that places keep their precision in
    /// map coordinates, and floors at whole metres lie in the middle of a voxel and of a chunk:
    /// at the face of a voxel their noise would make two layers, and at that of a chunk they would
    /// be reduced without a look at free space.
    fn lattice(&self, bound: f64) -> VoxelLattice {
        let edge = EDGE_PER_BOUND * bound;
        let offset = self.state.records.las().quantum.offset;
        VoxelLattice { origin: offset.map(|v| v.round() - MIDDLE_OF_CHUNK * edge), edge }
    }

    /// The mesh that no point leaves by more than the bound.
    fn mesh(&self, bound: f64) -> Result<BoundedMesh> {
        let lattice = self.lattice(bound);
        let scratch = VoxelScratch::create(&self.scratch)?;
        let counted = self.engine.fan_out("voxels", self.tiles.clone(), |tile| {
            let mut voxels = OccupiedVoxels::new(lattice);
            let mut own = ReadPoints::default();
            self.each_point(&tile, |world, part| {
                match part {
                    PointPart::Moves => own.n_moving += 1,
                    PointPart::Own => own.n_own += 1,
                    PointPart::Loose => own.n_loose += 1,
                    PointPart::Stands => {
                        own.n += 1;
                        own.bounds.add(world);
                        voxels.add(world)?;
                    }
                }
                Ok(())
            })?;
            scratch.add(voxels.into_chunks())?;
            Ok(own)
        })?;
        let chunks = scratch.chunks();
        let error = ERROR_PER_BOUND * bound;
        let parts = self.engine.fan_out(Task::new("surface").large(), chunks, |at| {
            let chunk = ChunkVoxels::new(lattice, at, &scratch.read(at)?);
            let found = chunk_surface(&chunk, &self.free, error)?;
            Ok((at, found))
        })?;
        drop(scratch);
        let n_fine = parts.iter().map(|(_, part)| part.n_fine).sum();
        let parts = parts.into_iter().map(|(at, part)| (at, part.mesh)).collect();
        let mesh = join_all(parts, error, self.engine)?;
        let found = BoundedMesh {
            mesh,
            bound,
            farthest: 0.0,
            n_points: counted.iter().map(|own| own.n).sum(),
            n_moving: counted.iter().map(|own| own.n_moving).sum(),
            n_own: counted.iter().map(|own| own.n_own).sum(),
            n_loose: counted.iter().map(|own| own.n_loose).sum(),
            n_fine,
            n_boxes: 0,
        };
        self.measured(found, &counted)
    }

    /// Measures all points, and puts boxes around those beyond the bound.
    fn measured(&self, mut found: BoundedMesh, counted: &[ReadPoints]) -> Result<BoundedMesh> {
        let (bound, mesh) = (found.bound, &found.mesh);
        let lattice = self.lattice(bound);
        let tiles = self.tiles.iter().zip(counted).collect();
        let measured =
            self.engine.fan_out("measure", tiles, |(tile, ReadPoints { bounds, .. })| {
                let mut far = FarPoints::new(lattice, bound);
                if bounds.is_empty() {
                    return Ok((0.0, far));
                }
                let grid = TriangleGrid::new(mesh, bounds, bound);
                let held = (bound - NOISE).clamp(HELD[0] * bound, HELD[1] * bound);
                let (most, mut farthest) = (held.powi(2) as f32, 0.0_f32);
                self.each_point(tile, |world, part| {
                    if part != PointPart::Stands {
                        return Ok(());
                    }
                    let square = grid.square(world, farthest);
                    if square > most {
                        far.add(world);
                    } else {
                        farthest = farthest.max(square);
                    }
                    Ok(())
                })?;
                Ok((farthest, far))
            })?;
        let mut far = FarPoints::new(lattice, bound);
        let mut farthest = 0.0_f32;
        for (own, points) in measured {
            farthest = farthest.max(own);
            far.join(points);
        }
        let (n_boxes, in_boxes) = far.append_to(&mut found.mesh);
        found.n_boxes = n_boxes;
        found.farthest = f64::from(farthest).sqrt().max(in_boxes);
        Ok(found)
    }

    fn is_on_robot(&self, world: [f64; 3]) -> bool {
        self.robots.iter().any(|robot| robot.contains(world))
    }

    /// The same result, with what hangs in the air beside its robots known.
    pub(super) fn without_loose(mut self) -> Result<Self> {
        let near: Vec<Aabb> = self.robots.iter().map(|r| r.bounds().grown(1.0)).collect();
        let tiles = match self.state.records.tile_edge() {
            Some(edge) => {
                let touched =
                    tiles_of(&self.files.manifest().files, edge, &near.iter().collect::<Vec<_>>());
                self.tiles.iter().filter(|t| touched.contains(t)).cloned().collect()
            }
            None => self.tiles.clone(),
        };
        let found = self.engine.fan_out("beside robots", tiles, |tile| {
            let mut beside = BesideRobots::default();
            self.read(&tile, |world, kind| {
                if !matches!(kind, PointKind::Link | PointKind::Attachment) {
                    beside.add(world, kind, &self.robots);
                }
                Ok(())
            })?;
            Ok(beside)
        })?;
        let mut all = BesideRobots::default();
        found.into_iter().for_each(|beside| all.join(beside));
        self.loose = all.loose();
        Ok(self)
    }

    /// Passes each point of a tile in the region, and what the mesh makes of it.
    fn each_point(
        &self,
        tile: &str,
        mut take: impl FnMut([f64; 3], PointPart) -> Result<()>,
    ) -> Result<()> {
        self.read(tile, |world, kind| {
            let part = match kind {
                PointKind::Link | PointKind::Attachment => PointPart::Moves,
                PointKind::Uncertain if self.is_on_robot(world) => PointPart::Own,
                PointKind::Uncertain if self.loose.contains(world) => PointPart::Loose,
                _ => PointPart::Stands,
            };
            take(world, part)
        })
    }

    /// Passes each point of a tile in the region, and its kind.
    fn read(
        &self,
        tile: &str,
        mut take: impl FnMut([f64; 3], PointKind) -> Result<()>,
    ) -> Result<()> {
        let (path, stated) = self.files.stated(tile)?;
        read_tile(&path, &self.state.records.las(), stated, |points| {
            self.engine.cancel.check()?;
            for point in points {
                let is_inside = self.region.is_none_or(|region| region.contains(point.world));
                if is_inside {
                    take(point.world, point.label.kind)?;
                }
            }
            Ok(())
        })
    }
}

/// Joins the meshes of all chunks, eight neighbours at a time.
fn join_all(
    mut parts: Vec<([i32; 3], SurfaceMesh)>,
    error: f64,
    engine: &Engine,
) -> Result<SurfaceMesh> {
    while parts.len() > 1 {
        let parent = |at: [i32; 3]| at.map(|v| v.div_euclid(2));
        parts.sort_by_key(|(at, _)| (parent(*at), *at));
        let mut groups: Vec<([i32; 3], Vec<SurfaceMesh>)> = Vec::new();
        for (at, mesh) in parts {
            match groups.last_mut() {
                Some((own, meshes)) if *own == parent(at) => meshes.push(mesh),
                _ => groups.push((parent(at), vec![mesh])),
            }
        }
        // Chunks on both sides of the origin have no common parent below it.
        let is_stuck = groups.len() > 1
            && groups
                .iter()
                .all(|(at, own)| own.len() == 1 && at.iter().all(|v| (-1..=0).contains(v)));
        if is_stuck {
            groups = vec![([0; 3], groups.into_iter().flat_map(|(_, own)| own).collect())];
        }
        let join = |(at, meshes)| Ok((at, join_surfaces(meshes, error)?));
        parts = engine.fan_out("join", groups, join)?;
    }
    Ok(parts.pop().map(|(_, mesh)| mesh).unwrap_or_default())
}

/// Convex pieces that cover a mesh, whose sides are no farther from it than `excess`, metres.
pub(super) fn convex(mesh: &SurfaceMesh, excess: f64, engine: &Engine) -> Result<Vec<SurfaceMesh>> {
    let blocks = convex_blocks(mesh);
    let pieces = engine.fan_out(Task::new("convex").large(), blocks, |(at, own)| {
        Ok(convex_pieces(at, &own, excess))
    })?;
    Ok(pieces.into_iter().flatten().collect())
}

/// The surface of all voxels that are unknown in some space and known in none.
pub(super) fn unknown(
    spaces: &[Space],
    region: Option<&Aabb>,
    engine: &Engine,
) -> Result<SurfaceMesh> {
    /// Error up to which flat sides are joined, as a share of a voxel's edge.
    const FLAT: f64 = 0.01;
    let Some(edge) = spaces.iter().map(|space| space.grid().edge).reduce(f64::min) else {
        return Ok(SurfaceMesh::default());
    };
    let lattice = VoxelLattice { origin: [0.0; 3], edge };
    let mut voxels = OccupiedVoxels::new(lattice);
    let is_known = |at: [f64; 3]| {
        let kind = |space: &Space| space.grid().index(at).map(|i| space.voxels()[i]);
        spaces.iter().filter_map(kind).any(|kind| kind != SpaceKind::Unknown)
    };
    for space in spaces {
        engine.cancel.check()?;
        let all = space.voxels().iter().enumerate();
        for (at, _) in all.filter(|(_, kind)| **kind == SpaceKind::Unknown) {
            let middle = space.grid().middle(at);
            if region.is_none_or(|region| region.contains(middle)) && !is_known(middle) {
                voxels.add(middle)?;
            }
        }
    }
    let chunks: Vec<_> = voxels.into_chunks().into_iter().collect();
    let parts = engine.fan_out("unknown", chunks, |(at, bytes)| {
        let chunk = ChunkVoxels::cubes(lattice, at, &bytes);
        Ok((at, chunk_surface(&chunk, &FreeSpace::default(), FLAT * edge)?.mesh))
    })?;
    join_all(parts, FLAT * edge, engine)
}
