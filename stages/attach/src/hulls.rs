//! Voxels that hang on robots in; convex pieces for each link, in its frame, within a budget of
//! triangles, out: what a planner adds to the robot's own model.

use crate::Attached;
use contract::{Fit, PointKind, RESIDUAL_EDGE, Voxel};
use geometry::{Point, Pose};
use robot::{Mesh, Model};
use std::collections::BTreeMap;

/// What hangs on one robot: for links by their index, convex pieces in the link's frame.
pub type Hanging = BTreeMap<usize, Vec<Mesh>>;

/// Edge of the cells that pieces are made of, metres: a hose's bend keeps its shape; doubled until
/// the budget holds.
const CELL: f64 = 0.12;
/// Triangles for all that hangs on one robot: planners check each of them against each obstacle.
const MAX_TRIANGLES: usize = 2000;
/// A piece of fewer voxels is a speck.
const MIN_VOXELS: usize = 2;

/// The pieces for each fit, in their order.
#[must_use]
pub fn hang(attached: &Attached, fits: &[Fit], models: &[Model]) -> Vec<Hanging> {
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

fn pieces(fit: &Fit, model: &Model, links: &BTreeMap<usize, Vec<Voxel>>) -> Hanging {
    let posture: Vec<f64> = fit.joints.iter().map(|j| j.value).collect();
    let poses = model.poses(&posture);
    let mut cell = CELL;
    loop {
        let all: Hanging = links
            .iter()
            .filter_map(|(&link, voxels)| {
                let link_from_world = (fit.world_from_base * poses.get(link)?).inverse();
                Some((link, of_link(voxels, &link_from_world, cell)))
            })
            .collect();
        let n: usize = all.values().flatten().map(|mesh| mesh.triangles.len()).sum();
        // At 2 m everything is one piece a link.
        if n <= MAX_TRIANGLES || cell > 2.0 {
            return all;
        }
        cell *= 2.0;
    }
}

/// Hulls of the voxels of each cell of the link's frame.
fn of_link(voxels: &[Voxel], link_from_world: &Pose, cell: f64) -> Vec<Mesh> {
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
