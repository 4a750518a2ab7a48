//! Points around a robot against the truth: how many points of things that stand still `check`
//! drops as strays, and how many strays it keeps.

use super::scene_robot::SceneRobot;
use clearance::{Obstacles, PointCell};
use contract::Result;
use glamx::Vec3;
use parry3d::query::PointQueryWithLocation;
use parry3d::shape::TriMesh;
use serde::Serialize;
use simulate::{BodyShape, Shapes};
use std::collections::BTreeMap;

/// A point belongs to a thing if its cell is no farther from its surface, metres: three standard
/// deviations of a range, and half the diagonal of a cell.
const ON: f32 = 0.010;
/// A point farther from all surfaces is a stray, metres: beams that average two surfaces count as
/// mixed from 30 mm on.
const OFF: f32 = 0.025;

/// Cells of points of one kind of thing, or of strays.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub(super) struct PointCount {
    /// Of all cells.
    pub(super) n: u64,
    /// Of cells that are no obstacles.
    pub(super) n_dropped: u64,
}

impl PointCount {
    pub(super) fn add(&mut self, other: Self) {
        self.n += other.n;
        self.n_dropped += other.n_dropped;
    }
}

/// Counts by kind of thing; strays have the name [`STRAYS`].
pub(super) type PointCounts = BTreeMap<String, PointCount>;

/// Name of points that lie on nothing.
pub(super) const STRAYS: &str = "strays";

/// Counts the points around a robot by what they lie on. Those near things that move with robots
/// are left out.
///
/// # Errors
/// `BadInput` where nothing stands in the scene.
pub(super) fn counts(
    robot: &SceneRobot<'_>,
    shapes: &Shapes,
    obstacles: &Obstacles,
) -> Result<PointCounts> {
    let (mut corners, mut triangles, mut of) = (Vec::new(), Vec::new(), Vec::new());
    for (at, shape) in shapes.all.iter().enumerate() {
        for t in &shape.triangles {
            let first = corners.len() as u32;
            corners.extend(t.map(Vec3::from_array));
            triangles.push([first, first + 1, first + 2]);
            of.push(at);
        }
    }
    let bad = |_| contract::Error::bad_input("nothing stands in the scene");
    let all = TriMesh::new(corners, triangles).map_err(bad)?;
    let names: Vec<Option<String>> = shapes.all.iter().map(|s| thing(robot, s)).collect();
    let mut out = PointCounts::new();
    for PointCell { at, is_dropped, .. } in obstacles.point_cells() {
        let p = obstacles.world_from_base() * geometry::Point::from(at.map(f64::from));
        let p = Vec3::from_array(p.coords.map(|v| v as f32).into());
        let near = all.project_local_point_and_get_location_with_max_dist(p, true, OFF);
        let name = match near {
            None => STRAYS,
            Some((found, _)) if found.point.distance(p) > ON => continue,
            Some((_, (triangle, _))) => match &names[of[triangle as usize]] {
                Some(name) => name,
                None => continue,
            },
        };
        let own = out.entry(name.to_owned()).or_default();
        own.n += 1;
        own.n_dropped += u64::from(is_dropped);
    }
    Ok(out)
}

/// Kind of a thing that stands still, with the width of those that are thin; `None` for what moves
/// with a robot.
fn thing(robot: &SceneRobot<'_>, shape: &BodyShape) -> Option<String> {
    if shape.robot.is_some() {
        return None;
    }
    let (kind, name) = shape.name.split_once(' ').unwrap_or((&shape.name, ""));
    let width = robot.scene.hoses.iter().find(|h| h.name == name).map(|h| 2e3 * h.radius);
    let width = width.filter(|_| kind == "line").map(|w| format!(" of {w:.0} mm"));
    Some(format!("{kind}{}", width.unwrap_or_default()))
}
