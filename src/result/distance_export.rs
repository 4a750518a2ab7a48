//! Writes how far each voxel around a robot is from what stands still, for planners on graphics
//! processors, in `OUT/export/distance`.
//!
//! ```text
//! R1/fixed.npy      f32 by [x][y][z]: metres to fixed things and other robots, negative inside
//! R1/unknown.npy    the same, with unknown space as an obstacle
//! R1/grid.json      where the voxels lie
//! ```

use crate::cache::{EXPORT, VerifiedFiles};
use crate::engine::Engine;
use crate::io::own_paths::without_links;
use crate::job::Job;
use contract::{Error, Result, SpaceKind, quote};
use export::NpyWriter;
use scene::signed_distances;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Writes the distances around each robot of the result in `out`; returns the paths of the files.
///
/// # Errors
/// There is no result, it knows no space around robots, or files cannot be read or written.
pub fn export_distances(out: &Path, engine: &Engine) -> Result<Vec<PathBuf>> {
    let files = VerifiedFiles::open(out)?;
    // No run can use a result that was copied without its store.
    let _lock = out.join("store").is_dir().then(|| Job::hold(out)).transpose()?;
    let result = files.result()?;
    let mut written = Vec::new();
    for robot in &result.robots {
        let Some(entry) = &robot.space else { continue };
        engine.cancel.check()?;
        files.compared(&entry.grid)?;
        let space = entry.read(out)?;
        let (edge, size) = (entry.edge, space.grid().size);
        let folder = format!("{EXPORT}/distance/{}", quote::file_name(&robot.id));
        for (name, with_unknown) in [("fixed.npy", false), ("unknown.npy", true)] {
            let is_obstacle = |kind: &SpaceKind| {
                kind.is_obstacle() || with_unknown && *kind == SpaceKind::Unknown
            };
            let obstacles: Vec<bool> = space.voxels().iter().map(is_obstacle).collect();
            let edges = signed_distances(&obstacles, size);
            let metres: Vec<f32> =
                edges.iter().map(|v| (f64::from(*v) * edge).clamp(-FAR, FAR) as f32).collect();
            let path = without_links(out, &format!("{folder}/{name}"))?;
            let mut array = NpyWriter::create(path.clone())?;
            array.push(&metres)?;
            array.finish_as(&size)?;
            written.push(path);
        }
        let bounds = space.grid().bounds();
        let place = json!({
            "schema": "stillpoint.distance/1",
            "edge": edge,
            "size": size,
            "order": "[x][y][z]",
            "lowest_corner": bounds.min,
            "first_middle": bounds.min.map(|v| v + edge / 2.0),
            "middle": bounds.center().coords.as_slice(),
            "unit": "metre",
            "sign": "positive outside of obstacles, negative inside",
            "farthest": FAR,
        });
        let text = serde_json::to_string_pretty(&place)
            .map_err(|e| Error::new(contract::Kind::Bug, "a grid does not serialize").because(e))?;
        let path = without_links(out, &format!("{folder}/grid.json"))?;
        export::atomic::write(&path, (text + "\n").as_bytes())?;
        written.push(path);
    }
    if written.is_empty() {
        return Err(Error::bad_input("the result knows no space around robots")
            .at(out.display())
            .hint("it takes scanner positions and --set freespace.enabled=true"));
    }
    Ok(written)
}

/// Distance that stands for all larger ones, metres: no robot's space is as large.
const FAR: f64 = 1e3;
