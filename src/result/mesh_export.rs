//! Writes the fixed world of a published result as collision mesh, in `OUT/export/mesh`. Points are
//! read twice, tile by tile: once to mesh them, and once to measure how far they lie from the mesh.
//!
//! ```text
//! fixed.stl     the surface of all that stands still (or .ply, .obj, .glb)
//! unknown.stl   the space that no beam passed through, on request
//! convex.obj    convex pieces that cover the surface, on request: an object each
//! mesh.json     the bound, what was measured, what was left out
//! ```

use super::loose_points::LooseCells;
use super::mesh_build::{BoundedMesh, MeshedResult, convex, unknown};
use super::plant_state::PlantState;
use crate::cache::{EXPORT, VerifiedFiles, tiles_of};
use crate::engine::Engine;
use crate::io::own_paths::without_links;
use crate::job::Job;
use clearance::OwnSurface;
use contract::{Error, Kind, Result, Space};
use export::ResultFile;
use geometry::Aabb;
use serde_json::json;
use std::path::PathBuf;
use surface::{EDGE_PER_BOUND, FreeSpace, SurfaceMesh, surface_area};

/// Formats of collision meshes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum MeshFormat {
    /// Binary STL, single precision
    Stl,
    /// Binary PLY, double precision
    Ply,
    /// OBJ text, to a micrometre
    Obj,
    /// Binary glTF, y up
    Glb,
}

/// Which mesh is to be written.
#[derive(Debug, Clone)]
pub struct MeshRequest {
    /// Output folder of a run.
    pub out: PathBuf,
    /// Greatest distance of a fixed point from the mesh, metres.
    pub bound: f64,
    /// Most triangles; a coarser bound is taken where there would be more.
    pub triangles: Option<usize>,
    /// The format.
    pub format: MeshFormat,
    /// Robot to whose known space the mesh is limited; `None` for the whole plant.
    pub robot: Option<String>,
    /// Whether unknown space is written, too.
    pub with_unknown: bool,
    /// Whether convex pieces are written, too.
    pub with_convex: bool,
}

impl MeshFormat {
    fn ending(self) -> &'static str {
        match self {
            Self::Stl => "stl",
            Self::Ply => "ply",
            Self::Obj => "obj",
            Self::Glb => "glb",
        }
    }

    fn bytes(self, mesh: &SurfaceMesh) -> Result<Vec<u8>> {
        Ok(match self {
            Self::Stl => surface::surface_stl(mesh),
            Self::Ply => surface::surface_ply(mesh),
            Self::Obj => surface::surface_obj(mesh),
            Self::Glb => surface::surface_glb(mesh)?,
        })
    }

    /// Largest rounding of a coordinate of this size, metres.
    fn rounding(self, far: f64) -> f64 {
        match self {
            Self::Stl => far * f64::from(f32::EPSILON) / 2.0,
            Self::Ply => 0.0,
            Self::Obj => 0.5e-6,
            // Counted from the middle of the mesh.
            Self::Glb => far.min(1e4) * f64::from(f32::EPSILON) / 2.0,
        }
    }
}

/// A published result.
#[derive(Clone, Copy)]
pub(crate) struct Published<'a> {
    pub(crate) files: &'a VerifiedFiles,
    pub(crate) result: &'a ResultFile,
    pub(crate) state: &'a PlantState,
}

/// What was written.
#[derive(Debug)]
pub(crate) struct MeshOutcome {
    /// Paths of the files.
    pub paths: Vec<PathBuf>,
    /// The mesh in a sentence.
    pub words: String,
    /// What was asked for and could not be kept to.
    pub warnings: Vec<String>,
}

/// Writes the mesh, without uncertain points on the surfaces of robots, which `find_robots` finds,
/// and in the air beside them; with these where robots cannot be placed, as without their models.
///
/// # Errors
/// There is no result, it has no tiles or no such robot, or files cannot be read or written.
pub(crate) fn export_mesh(
    request: &MeshRequest,
    find_robots: impl FnOnce(Published<'_>) -> Result<Vec<OwnSurface>>,
    engine: &Engine,
) -> Result<MeshOutcome> {
    let out = &request.out;
    let files = VerifiedFiles::open(out)?;
    // No run can use a result that was copied without its store.
    let _lock = out.join("store").is_dir().then(|| Job::hold(out)).transpose()?;
    let (result, state) = (files.result()?, PlantState::read(&files)?);
    let (spaces, region) = spaces(request, &files, &result)?;
    let mut free = FreeSpace::default();
    spaces.iter().for_each(|space| free.add(space));
    let tiles = tiles(request, &files, &state, region.as_ref())?;
    let folder = format!("{EXPORT}/mesh");
    let scratch = without_links(out, &format!("{folder}/scratch"))?;
    let mut warnings = Vec::new();
    let robots = find_robots(Published { files: &files, result: &result, state: &state });
    let robots = robots.unwrap_or_else(|error| none_placed(&error, &mut warnings));
    let (files, state, loose) = (&files, &state, LooseCells::default());
    let meshed = MeshedResult { files, state, tiles, region, free, robots, loose, scratch, engine };
    let meshed = meshed.without_loose()?;
    let found = meshed.within(request.bound, request.triangles, &mut warnings)?;
    let place = |name: String| without_links(out, &format!("{folder}/{name}"));
    let ending = request.format.ending();
    let mut paths = vec![place(format!("fixed.{ending}"))?];
    export::atomic::write(&paths[0], &request.format.bytes(&found.mesh)?)?;
    let mut report = report(request, &found, &meshed);
    if request.with_unknown {
        let mesh = unknown(&spaces, meshed.region.as_ref(), engine)?;
        let path = place(format!("unknown.{ending}"))?;
        export::atomic::write(&path, &request.format.bytes(&mesh)?)?;
        report["unknown"] = json!({
            "file": format!("unknown.{ending}"),
            "triangles": mesh.triangles.len(),
            "area": surface_area(&mesh, &FreeSpace::default()).all,
        });
        paths.push(path);
    }
    if request.with_convex {
        let pieces = convex(&found.mesh, found.bound, engine)?;
        let path = place("convex.obj".into())?;
        export::atomic::write(&path, &surface::pieces_obj(&pieces))?;
        report["convex"] = json!({
            "file": "convex.obj", "pieces": pieces.len(), "excess": found.bound,
        });
        paths.push(path);
    }
    let text = serde_json::to_string_pretty(&report)
        .map_err(|e| Error::new(Kind::Bug, "a report does not serialize").because(e))?;
    let path = place("mesh.json".into())?;
    export::atomic::write(&path, (text + "\n").as_bytes())?;
    paths.push(path);
    let words = format!(
        "{} triangles; no fixed point is farther from them than {:.1} mm",
        found.mesh.triangles.len(),
        found.farthest * 1e3
    );
    Ok(MeshOutcome { paths, words, warnings })
}

/// No surfaces of robots, and why.
fn none_placed(error: &Error, warnings: &mut Vec<String>) -> Vec<OwnSurface> {
    warnings.push(format!("uncertain points on and beside robots are kept in the mesh: {error}"));
    Vec::new()
}

/// Known space of all robots, and the bounds of that of the requested one.
fn spaces(
    request: &MeshRequest,
    files: &VerifiedFiles,
    result: &ResultFile,
) -> Result<(Vec<Space>, Option<Aabb>)> {
    let (mut spaces, mut region) = (Vec::new(), None);
    for robot in &result.robots {
        let Some(entry) = &robot.space else { continue };
        files.compared(&entry.grid)?;
        let space = entry.read(&request.out)?;
        if request.robot.as_ref() == Some(&robot.id) {
            region = Some(space.grid().bounds());
        }
        spaces.push(space);
    }
    let lacks = |what: String| {
        let hint =
            "robots and their known space are in result.json; `stillpoint report OUT` lists them";
        Err(Error::bad_input(what).at(request.out.display()).hint(hint))
    };
    match &request.robot {
        Some(id) if region.is_none() => lacks(format!("the result knows no space around \"{id}\"")),
        _ if request.with_unknown && spaces.is_empty() => {
            lacks("the result knows no space around robots, so none is known to be unseen".into())
        }
        _ => Ok((spaces, region)),
    }
}

/// Names of the tiles with points of the region.
fn tiles(
    request: &MeshRequest,
    files: &VerifiedFiles,
    state: &PlantState,
    region: Option<&Aabb>,
) -> Result<Vec<String>> {
    let listed = &files.manifest().files;
    let all = || listed.iter().map(|file| file.path.clone());
    let names: Vec<String> = match (region, state.records.tile_edge()) {
        (Some(region), Some(edge)) => tiles_of(listed, edge, &[region]),
        _ => all().filter(|path| path.starts_with("tiles/")).collect(),
    };
    if names.is_empty() {
        return Err(Error::bad_input("the result has no tiles to read its points from")
            .at(request.out.join("tiles").display())
            .hint("run with --set export.tiles=true"));
    }
    Ok(names)
}

fn report(
    request: &MeshRequest,
    found: &BoundedMesh,
    meshed: &MeshedResult<'_>,
) -> serde_json::Value {
    let area = surface_area(&found.mesh, &meshed.free);
    let far = found.mesh.vertices.as_flattened().iter().fold(0.0_f64, |far, v| far.max(v.abs()));
    let knows_free = !meshed.free.is_empty();
    json!({
        "schema": "stillpoint.mesh/1",
        "file": format!("fixed.{}", request.format.ending()),
        "frame": "plant, metres, z up (glTF: its root node turns z up to y up)",
        "bound": found.bound,
        "measured_maximum": found.farthest,
        "rounding": request.format.rounding(far),
        "triangles": found.mesh.triangles.len(),
        "most_triangles": request.triangles,
        "triangles_before_reduction": found.n_fine,
        "boxes": found.n_boxes,
        "points": found.n_points,
        "voxel_edge": EDGE_PER_BOUND * found.bound,
        "area": area.all,
        "area_in_free_space": knows_free.then_some(area.in_free),
        "robot": request.robot,
        "region": meshed.region.map(|region| [region.min, region.max]),
        "left_out": {
            "points_of_robots_and_attachments": found.n_moving,
            "uncertain_points_on_robots": found.n_own,
            "uncertain_points_in_the_air_beside_robots": found.n_loose,
        },
    })
}
