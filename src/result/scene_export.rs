//! Writes the scene of a published result for planners and simulators, in `OUT/export`: robots as
//! they stand with everything that the library says of them, and what stands still around them.

use super::plant_state::PlantState;
use crate::cache::{EXPORT, VerifiedFiles};
use crate::detect::library;
use crate::detect::robots::{RobotList, poses};
use crate::engine::Engine;
use crate::io::own_paths::without_links;
use crate::job::{Job, Means};
use contract::{Error, Fit, Floor, Result, SpaceKind, Verdict, quote};
use export::{BasePose, ResultFile, RobotEntry, mesh_files};
use geometry::{Aabb, Point, Pose, Vector};
use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use robot::{Mesh, Model, ModelDetails};
use scene::{
    FixedBox, FloorPatch, FoundHulls, PlantRobot, PlantScene, SceneFile, SceneFiles, TouchingBoxes,
    voxel_boxes,
};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Formats of scenes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SceneFormat {
    /// A URDF of each robot.
    Urdf,
    /// With its SRDF.
    Srdf,
    /// With its planning scene.
    Moveit,
    /// USD text.
    Usd,
    /// MuJoCo.
    Mjcf,
    /// Gazebo.
    Sdf,
    /// Binary glTF.
    Gltf,
    /// A script for RoboDK.
    Robodk,
}

/// Which scene is to be written.
#[derive(Debug, Clone)]
pub struct SceneRequest {
    /// Output folder of a run.
    pub out: PathBuf,
    /// The format.
    pub format: SceneFormat,
    /// Robot library; `None` for that of the run.
    pub robots: Option<PathBuf>,
    /// Name of the ROS package in which mesh paths of URDFs lie; `None` for relative paths.
    pub package: Option<String>,
}

impl SceneFormat {
    fn folder(self) -> &'static str {
        match self {
            Self::Urdf => "urdf",
            Self::Srdf => "srdf",
            Self::Moveit => "moveit",
            Self::Usd => "usd",
            Self::Mjcf => "mjcf",
            Self::Sdf => "sdf",
            Self::Gltf => "gltf",
            Self::Robodk => "robodk",
        }
    }

    /// Whether URDFs are written, whose mesh paths may be those of a ROS package.
    #[must_use]
    pub fn has_urdfs(self) -> bool {
        matches!(self, Self::Urdf | Self::Srdf | Self::Moveit)
    }

    fn write(self, plant: &PlantScene, package: Option<&str>) -> Result<SceneFiles> {
        match self {
            Self::Urdf => scene::urdf(plant, package),
            Self::Srdf => scene::srdf(plant, package),
            Self::Moveit => scene::moveit(plant, package),
            Self::Usd => scene::usd(plant),
            Self::Mjcf => scene::mjcf(plant),
            Self::Sdf => scene::sdf(plant),
            Self::Gltf => scene::gltf(plant),
            Self::Robodk => scene::robodk(plant),
        }
    }
}

/// Writes a scene; returns the paths of the files to open, and notes.
///
/// # Errors
/// There is no result, its library has changed, or files cannot be read or written.
pub fn export_scene(
    request: &SceneRequest,
    means: &Means,
    engine: &Engine,
) -> Result<(Vec<PathBuf>, Vec<String>)> {
    let out = &request.out;
    let files = VerifiedFiles::open(out)?;
    // No run can use a result that was copied without its store.
    let _lock = out.join("store").is_dir().then(|| Job::hold(out)).transpose()?;
    let (result, state) = (files.result()?, PlantState::read(&files)?);
    if result.robots.len() != state.fits.len() {
        let what = "result.json and plant.bin of this folder are of different runs";
        return Err(Error::bad_input(what).at(out.display()).hint("run the same job again"));
    }
    let mut notes = Vec::new();
    let robots = scene_robots(request, &files, &result, &state, means, engine, &mut notes)?;
    let floor = floor_patch(&state.floor).filter(|floor| {
        let below = robots.iter().find(|robot| reaches_below(floor, robot));
        notes.extend(below.map(|robot| {
            format!("{} reaches below the largest level of the floor, which is left out", robot.id)
        }));
        below.is_none()
    });
    let (fixed, touching) = fixed_boxes(out, &files, &result, &robots)?;
    let plant = PlantScene { name: "plant".into(), robots, fixed, touching, floor };
    if plant.fixed.is_empty() {
        notes.push("the result knows no space around robots: the fixed world is left out".into());
    }
    let written = request.format.write(&plant, request.package.as_deref())?;
    notes.extend(written.notes);
    Ok((write(out, request.format, written.files, engine)?, notes))
}

/// Writes the files of a scene and removes those of an earlier one that are no part of it; returns
/// the paths of all but meshes.
fn write(
    out: &Path,
    format: SceneFormat,
    files: Vec<SceneFile>,
    engine: &Engine,
) -> Result<Vec<PathBuf>> {
    let folder = format!("{EXPORT}/{}", format.folder());
    let place = |name: &str| without_links(out, &format!("{folder}/{name}"));
    let list = place(LIST)?;
    let names: BTreeSet<&str> = files.iter().map(|file| file.path.as_str()).collect();
    let earlier = std::fs::read_to_string(&list).unwrap_or_default();
    let is_below = |name: &str| !name.is_empty() && !name.split('/').any(|part| part == "..");
    for name in earlier.lines().filter(|name| is_below(name) && !names.contains(name)) {
        // What is gone or cannot be removed is no part of the new scene either way.
        let _ = std::fs::remove_file(place(name)?);
    }
    let text: String = names.iter().map(|name| format!("{name}\n")).collect();
    export::atomic::write(&list, text.as_bytes())?;
    let mut paths = Vec::new();
    for file in &files {
        engine.cancel.check()?;
        let path = place(&file.path)?;
        export::atomic::write(&path, &file.bytes)?;
        let is_mesh = file.path.split('/').any(|part| part == "meshes");
        paths.extend((!is_mesh).then_some(path));
    }
    Ok(paths)
}

/// Name of the list of a scene's files, by which the next scene knows what to remove.
const LIST: &str = "files.txt";

/// All robots that are reported.
fn scene_robots(
    request: &SceneRequest,
    files: &VerifiedFiles,
    result: &ResultFile,
    state: &PlantState,
    means: &Means,
    engine: &Engine,
    notes: &mut Vec<String>,
) -> Result<Vec<PlantRobot>> {
    let dir = request.robots.as_deref().unwrap_or(&state.robots);
    let stands = |fit: &Fit| fit.verdict != Verdict::Refused;
    let (entries, fits): (Vec<&RobotEntry>, Vec<Fit>) = (result.robots.iter())
        .zip(&state.fits)
        .filter(|(_, fit)| stands(fit))
        .map(|(entry, fit)| (entry, fit.clone()))
        .unzip();
    if fits.is_empty() {
        return Err(Error::bad_input("the result reports no robot, so there is no scene to write")
            .at(request.out.display())
            .hint("`stillpoint report OUT` tells what was found"));
    }
    let is_wanted = |name: &str| {
        let is_it = |fit: &Fit| {
            fit.model_name == name || fit.tool.as_ref().is_some_and(|tool| tool.model == name)
        };
        fits.iter().any(is_it)
    };
    let settings = robot::Settings { clouds: false, ..means.settings.robot };
    let library = library::load_those(dir, is_wanted, &settings, None, engine)?;
    let bare = |name: &str| library.model(name).map(|at| &library.models[at]);
    let RobotList { fits, models } = library::robots_of(fits, &library)?;
    let mut out = Vec::new();
    for (entry, fit) in entries.into_iter().zip(&fits) {
        let model = &models[fit.model];
        is_of_the_library(entry, fit, model, files)?;
        let details = |name: &str| match bare(name) {
            Some(model) => ModelDetails::load(&dir.join(name), model, &settings),
            None => Err(Error::bad_input(format!("the library has no model \"{name}\""))),
        };
        let mut own = details(&fit.model_name)?;
        if let Some(tool) = &fit.tool {
            own = own.with_tool(&details(&tool.model)?);
        }
        let id = &entry.id;
        notes.extend(doubts(id, fit));
        out.push(PlantRobot {
            id: id.clone(),
            model: model.clone(),
            details: own,
            world_from_base: fit.world_from_base,
            posture: fit.joints.iter().map(|joint| joint.value).collect(),
            hanging: hanging(id, model, files)?,
        });
    }
    Ok(out)
}

/// What is to be known of a fit before its robot is relied upon.
fn doubts(id: &str, fit: &Fit) -> Vec<String> {
    let mut out = Vec::new();
    if fit.verdict != Verdict::Trusted {
        out.push(format!("{id} is {}: {}", fit.verdict.word(), fit.reasons.join("; ")));
    }
    if !fit.stays.is_empty() {
        out.push(format!("{id} moved between scans; it stands in the first posture"));
    }
    out
}

/// Refuses a model whose links, joints, joint frames or meshes differ from those of the run.
fn is_of_the_library(
    entry: &RobotEntry,
    fit: &Fit,
    model: &Model,
    files: &VerifiedFiles,
) -> Result<()> {
    let bad = |what: &str| {
        let what = format!("the library's {} has {what} than {} has", model.name, entry.id);
        Err(Error::bad_input(what).hint("give the library of the run with --robots"))
    };
    let joints = model.free.iter().map(|&j| &model.joints[j].name);
    if !model.links.iter().map(|link| &link.name).eq(&entry.links)
        || !joints.eq(entry.joints.0.iter().map(|(name, _)| name))
    {
        return bad("other links or joints");
    }
    let is_there = |(pose, (_, stated)): (&Pose, &(String, BasePose))| {
        let [w, x, y, z] = stated.quat_wxyz;
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        let off = Pose::from_parts(Translation3::from(stated.xyz), turn).inv_mul(pose);
        off.translation.vector.norm() < SAME_PLACE && off.rotation.angle() < SAME_PLACE
    };
    let stated = &entry.link_poses.0;
    if !poses(fit, model).iter().zip(stated).all(is_there) || stated.len() != model.links.len() {
        return bad("other frames of joints");
    }
    for (link, file) in model.links.iter().zip(mesh_files(&entry.id, model)) {
        let Some((path, n_bytes)) = file else { continue };
        let is_same = files.has(&path) && {
            let bytes = files.bytes(&path)?;
            bytes.len() as u64 == n_bytes && bytes == link.mesh.to_stl()
        };
        if !is_same {
            return bad("other meshes");
        }
    }
    Ok(())
}

/// Deviation up to which links stand where the result says, metres or radians.
const SAME_PLACE: f64 = 1e-6;

/// Convex pieces of what hangs on each link, from the result.
fn hanging(id: &str, model: &Model, files: &VerifiedFiles) -> Result<BTreeMap<usize, Vec<Mesh>>> {
    let mut out: BTreeMap<usize, Vec<Mesh>> = BTreeMap::new();
    for (l, link) in model.links.iter().enumerate() {
        let name = |k: usize| {
            let link = quote::file_name(&link.name);
            format!("robots/{id}/meshes/{l:02}_{link}_hanging_{k}.stl")
        };
        for path in (0..).map(name).take_while(|path| files.has(path)) {
            let mesh = Mesh::from_stl(&files.bytes(&path)?).ok_or_else(|| {
                Error::bad_input("the mesh of an attached thing is no whole binary STL")
                    .at(path.as_str())
                    .hint("run the same job again")
            })?;
            out.entry(l).or_default().push(mesh);
        }
    }
    Ok(out)
}

/// Boxes that cover the fixed voxels around all robots, apart those that meet robots as found.
fn fixed_boxes(
    out: &Path,
    files: &VerifiedFiles,
    result: &ResultFile,
    robots: &[PlantRobot],
) -> Result<(Vec<FixedBox>, Vec<TouchingBoxes>)> {
    // Very large robots have wider voxels.
    let mut by_edge: BTreeMap<u64, BTreeSet<[i64; 3]>> = BTreeMap::new();
    for entry in result.robots.iter().filter_map(|robot| robot.space.as_ref()) {
        files.compared(&entry.grid)?;
        let space = entry.read(out)?;
        let (grid, own) = (*space.grid(), by_edge.entry(entry.edge.to_bits()).or_default());
        for (at, _) in space.voxels().iter().enumerate().filter(|(_, v)| **v == SpaceKind::Fixed) {
            let cell = grid.cell(at);
            own.insert(std::array::from_fn(|i| grid.first[i] + cell[i] as i64));
        }
    }
    let hulls = FoundHulls::of(robots);
    let mut groups: BTreeMap<Vec<[usize; 2]>, Vec<FixedBox>> = BTreeMap::new();
    for (edge, cells) in by_edge {
        let edge = f64::from_bits(edge);
        let mut by_links: BTreeMap<Vec<[usize; 2]>, BTreeSet<[i64; 3]>> = BTreeMap::new();
        for cell in cells {
            let center = cell.map(|v| (v as f64 + 0.5) * edge);
            let links = hulls.met_by(&FixedBox { center, size: [edge; 3] });
            by_links.entry(links).or_default().insert(cell);
        }
        for (links, cells) in by_links {
            groups.entry(links).or_default().extend(voxel_boxes(&cells, edge));
        }
    }
    let fixed = groups.remove(&[][..]).unwrap_or_default();
    let touching = groups.into_iter().map(|(links, boxes)| TouchingBoxes { boxes, links });
    Ok((fixed, touching.collect()))
}

/// Whether a part of the robot is clearly below the floor's rectangle, as in a pit or under a
/// platform.
fn reaches_below(floor: &FloorPatch, robot: &PlantRobot) -> bool {
    /// Depth that is more than an uneven floor, metres.
    const DEPTH: f64 = 0.1;
    let half = floor.size.map(|edge| edge / 2.0);
    let floor_from_world = floor.world_from_floor.inverse();
    robot.model.links.iter().zip(robot.world_from_links()).any(|(link, world_from_link)| {
        let floor_from_link = floor_from_world * world_from_link;
        link.mesh.vertices.iter().any(|v| {
            let p = floor_from_link * Point::from(v.map(f64::from));
            p.x.abs() < half[0] && p.y.abs() < half[1] && p.z < -DEPTH
        })
    })
}

/// The largest level of the floor, as a rectangle around its cells.
fn floor_patch(floor: &Floor) -> Option<FloorPatch> {
    let level = floor.levels.first()?;
    let ends = |(cell, height): &([i32; 2], f64)| {
        let at = |i: usize, k: i32| f64::from(cell[i] + k) * level.cell;
        [[at(0, 0), at(1, 0), *height], [at(0, 1), at(1, 1), *height]]
    };
    let bounds = Aabb::of(level.heights.iter().flat_map(ends));
    if bounds.is_empty() {
        return None;
    }
    let (middle, size) = (bounds.center(), bounds.size());
    let normal = level.plane.normal;
    // The mean plane at the middle of its cells.
    let z = (level.plane.offset - normal.x * middle.x - normal.y * middle.y) / normal.z;
    let turn = UnitQuaternion::rotation_between(&Vector::z(), &normal)?;
    let place = Translation3::new(middle.x, middle.y, z);
    let is_level = z.is_finite() && size[0] > 0.0 && size[1] > 0.0;
    is_level.then(|| FloorPatch {
        world_from_floor: Pose::from_parts(place, turn),
        size: [size[0], size[1]],
    })
}
