//! Converts the points of a published result to another format, in `OUT/export`. The next run into
//! OUT removes converted files whose points have changed, and reports it.

use super::copc;
use super::distance_export::export_distances;
use super::scene_export::SceneFormat;
use crate::cache::{EXPORT, VerifiedFiles, copc_name};
use crate::engine::{Amount, Engine};
use crate::io::own_paths::without_links;
use crate::job::Job;
use contract::{Error, Format, Kind, Result};
use export::{PLY, write_ply};
use std::path::{Path, PathBuf};

/// Formats that a result can be exported to: of points, of scenes, and of the scans themselves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum ExportFormat {
    /// One LAZ file of all points, as an octree that viewers load piece by piece (Potree, QGIS)
    Copc,
    /// Two PLY files: moving points and fixed points (Open3D, MeshLab)
    Ply,
    /// Robots in their place, each as a URDF with all that the library says of it (pinocchio,
    /// Drake, ROS)
    Urdf,
    /// The same with an SRDF: groups, the posture as found, links that may touch
    Srdf,
    /// The same with a planning scene: the fixed world and the other robots (MoveIt)
    Moveit,
    /// The whole scene as USD, with physics (Isaac Sim, Omniverse)
    Usd,
    /// The whole scene for MuJoCo, with the posture as a key frame
    Mjcf,
    /// The whole scene as an SDF world; joints count from the posture as found (Gazebo)
    Sdf,
    /// The whole scene as binary glTF, with joints in the nodes' extras (viewers, Blender)
    Gltf,
    /// The whole scene as a Python script for RoboDK
    Robodk,
    /// Distances of voxels around each robot from what stands still, as NumPy arrays (cuRobo,
    /// nvblox)
    Distance,
    /// Each E57 input as it was, with moving points flagged as invalid; class, robot and link of
    /// each point as an extension
    E57,
    /// Each PTX input as it was, with moving points as beams without return
    Ptx,
    /// The fixed world as collision mesh, which no fixed point leaves by more than a bound
    Mesh,
}

impl ExportFormat {
    /// The format as one of the scans that were read; `None` for one of points or scenes.
    #[must_use]
    pub fn scans(self) -> Option<Format> {
        match self {
            Self::E57 => Some(Format::E57),
            Self::Ptx => Some(Format::Ptx),
            _ => None,
        }
    }

    /// The format as one of scenes; `None` for one of points.
    #[must_use]
    pub fn scene(self) -> Option<SceneFormat> {
        match self {
            Self::Copc | Self::Ply | Self::Distance | Self::E57 | Self::Ptx | Self::Mesh => None,
            Self::Urdf => Some(SceneFormat::Urdf),
            Self::Srdf => Some(SceneFormat::Srdf),
            Self::Moveit => Some(SceneFormat::Moveit),
            Self::Usd => Some(SceneFormat::Usd),
            Self::Mjcf => Some(SceneFormat::Mjcf),
            Self::Sdf => Some(SceneFormat::Sdf),
            Self::Gltf => Some(SceneFormat::Gltf),
            Self::Robodk => Some(SceneFormat::Robodk),
        }
    }
}

/// Converts the points of the result in `out` and returns the paths of the files.
///
/// # Errors
/// There is no result, it has no tiles, another run uses the folder, or files cannot be read or
/// written.
pub fn convert(out: &Path, format: ExportFormat, engine: &Engine) -> Result<Vec<PathBuf>> {
    if format == ExportFormat::Distance {
        return export_distances(out, engine);
    }
    let files = VerifiedFiles::open(out)?;
    // No run can use a result that was copied without its store.
    let _lock = out.join("store").is_dir().then(|| Job::hold(out)).transpose()?;
    let into = without_links(out, EXPORT)?;
    // Only tiles that the manifest lists are read, and each is compared with it.
    let listed = files.manifest().files.iter().map(|file| &*file.path);
    let listed = listed.filter(|path| path.starts_with("tiles/")).collect();
    let tiles = engine.fan_out("compare", listed, |name: &str| files.compared(name))?;
    let written = match format {
        ExportFormat::Copc => {
            let to = into.join(copc_name());
            let written = copc::write(&tiles, &to, &into.join("scratch"), engine);
            let damaged = |e: Error| match e.kind() {
                Kind::Bug => {
                    e.hint("`stillpoint verify` says whether the result's tiles are whole")
                }
                _ => e,
            };
            written.map_err(damaged)?.then(|| vec![to])
        }
        ExportFormat::Ply => {
            let stage = engine.progress.stage("ply", Amount::items(0));
            let points = write_ply(&tiles, &into, || engine.cancel.check())?;
            points.iter().for_each(|n| stage.add(0, n.iter().sum(), 0));
            stage.finish();
            points.map(|_| PLY.map(|name| into.join(name)).to_vec())
        }
        other => {
            let what = format!("{other:?} is no format of points");
            return Err(Error::new(Kind::Bug, what));
        }
    };
    written.ok_or_else(|| {
        Error::bad_input("the result has no tiles to read its points from")
            .at(out.join("tiles").display())
            .hint("run with --set export.tiles=true")
    })
}
