//! Makes convex pieces of the voxels that are attached to each link of a robot, in the frame of the
//! link. A motion planner adds them to the robot's own model. The number of triangles is bounded.

use crate::attached::Attached;
use contract::{Fit, PointKind, RESIDUAL_EDGE, Voxel};
use geometry::{Point, Pose};
use robot::{Mesh, Model};
use std::collections::BTreeMap;

/// What is attached to one robot: for each link by index, convex pieces in the frame of the link,
/// metres.
pub type AttachedPieces = BTreeMap<usize, Vec<Mesh>>;

/// Edge of the cells that attached voxels are grouped by, metres: one convex piece a cell, small
/// enough to follow the bend of a hose. It is doubled until the number of triangles is within the
/// limit.
const CELL: f64 = 0.12;
/// Limit of triangles of all that is attached to one robot. Planners check each triangle against
/// each obstacle.
const MAX_TRIANGLES: usize = 2000;
/// Cells with fewer voxels give no piece: they are stray points.
const MIN_VOXELS: usize = 2;

/// The convex pieces of the attached voxels for each fit, in the order of `fits`. `models` are
/// those of the library, by [`Fit::model`].
#[must_use]
pub fn attached_pieces(attached: &Attached, fits: &[Fit], models: &[Model]) -> Vec<AttachedPieces> {
    let mut by_robot: Vec<BTreeMap<usize, Vec<Voxel>>> = vec![BTreeMap::new(); fits.len()];
    for (voxel, label) in attached.voxels.iter().filter(|v| v.1.kind == PointKind::Attachment) {
        let (robot, link) = (usize::try_from(label.robot), usize::try_from(label.link));
        if let (Ok(robot), Ok(link)) = (robot, link)
            && let Some(links) = by_robot.get_mut(robot)
        {
            links.entry(link).or_default().push(*voxel);
        }
    }
    fits.iter().zip(by_robot).map(|(fit, links)| pieces(fit, &models[fit.model], &links)).collect()
}

fn pieces(fit: &Fit, model: &Model, links: &BTreeMap<usize, Vec<Voxel>>) -> AttachedPieces {
    let posture: Vec<f64> = fit.joints.iter().map(|j| j.value).collect();
    let poses = model.poses(&posture);
    let mut cell = CELL;
    loop {
        let all: AttachedPieces = links
            .iter()
            .filter_map(|(&link, voxels)| {
                let link_from_world = (fit.world_from_base * poses.get(link)?).inverse();
                Some((link, link_pieces(voxels, &link_from_world, cell)))
            })
            .collect();
        let n: usize = all.values().flatten().map(|mesh| mesh.triangles.len()).sum();
        // Above 2 m all voxels of a link are in one cell, so that a larger cell changes nothing.
        if n <= MAX_TRIANGLES || cell > 2.0 {
            return all;
        }
        cell *= 2.0;
    }
}

/// The convex hulls of the voxels of one link: one hull for each cell of the link's frame. `cell`
/// is the edge of the cells, metres.
fn link_pieces(voxels: &[Voxel], link_from_world: &Pose, cell: f64) -> Vec<Mesh> {
    let mut cells: BTreeMap<[i64; 3], (usize, Vec<[f32; 3]>)> = BTreeMap::new();
    for voxel in voxels {
        let corner = |k: usize| {
            let at: [f64; 3] = std::array::from_fn(|i| {
                (f64::from(voxel[i]) + (k >> i & 1) as f64) * RESIDUAL_EDGE
            });
            let p = link_from_world * Point::from(at);
            [p.x as f32, p.y as f32, p.z as f32]
        };
        let middle =
            link_from_world * Point::from(voxel.map(|v| (f64::from(v) + 0.5) * RESIDUAL_EDGE));
        let key = [middle.x, middle.y, middle.z].map(|v| (v / cell).floor() as i64);
        let (n, points) = cells.entry(key).or_default();
        *n += 1;
        points.extend((0..8).map(corner));
    }
    let whole = cells.into_values().filter(|(n, _)| *n >= MIN_VOXELS);
    whole.filter_map(|(_, points)| robot::hull(&points)).collect()
}
