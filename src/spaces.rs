//! Fits and what the scans saw about them in; around each robot, which space was seen free, which it fills itself and
//! which nobody has seen, out. Points are marked into it while they are labelled.

use crate::engine::{AllThreads, Engine, Task};
use crate::job::Settings;
use crate::search::Search;
use contract::{Fit, Label, Region, Result, Space, SpaceGrid, SpaceKind};
use geometry::{Aabb, Point, Pose, Vector};
use lattice::ViewSettings;
use robot::Model;
use std::ops::Range;

/// Depth images need cells this much smaller than the voxels, so that each voxel is looked at through its middle.
const CELLS_PER_EDGE: f64 = 3.0;
/// Room behind a base that belongs to its robot's space, as a share of its reach: what stands on a pedestal reaches below.
const BEHIND: f64 = 0.5;
/// Vertical part of a base's axis from which on its robot stands, or hangs: 60°.
const UPRIGHT: f64 = 0.5;

/// The spaces of all robots, in the order of the fits; none where no scan says where its beams went.
pub(crate) fn around(
    fits: &[Fit],
    models: &[Model],
    (search, settings): (&Search<'_, '_>, &Settings),
    engine: &Engine,
) -> Result<Vec<Option<Space>>> {
    if !settings.merge.space {
        return Ok(vec![None; fits.len()]);
    }
    engine.fan_out(Task::new("space").large(), fits.iter().collect(), |fit| {
        let model = &models[fit.model];
        let base: Point = fit.world_from_base.translation.vector.into();
        let edge = settings.merge.space_edge;
        let bounds = bounds(fit, model.reach()).shared(&search.bounds().grown(edge));
        let grid = SpaceGrid::over(&bounds, edge);
        let region = region(&base, &grid.bounds());
        let min_cell = grid.edge / CELLS_PER_EDGE;
        let views = search.images(&region, &ViewSettings { min_cell, ..settings.view.clone() })?;
        if views.iter().all(|v| v.images.is_empty()) {
            return Ok(None);
        }
        let mut space = Space::unknown(grid);
        merge::see(&mut space, &region, &views, &AllThreads);
        merge::stand(&mut space, model, &poses(fit, model));
        Ok(Some(space))
    })
}

/// The region of all that a robot can get to.
pub(crate) fn reach(fit: &Fit, model: &Model) -> Region {
    let base: Point = fit.world_from_base.translation.vector.into();
    region(&base, &bounds(fit, model.reach()))
}

/// A region of the world, its frame near `middle`.
pub(crate) fn region(middle: &Point, world: &Aabb) -> Region {
    let origin = middle.map(f64::round);
    let shift = |p: [f64; 3]| std::array::from_fn(|i| p[i] - origin[i]);
    Region { origin, bounds: Aabb { min: shift(world.min), max: shift(world.max) } }
}

/// All that a robot can get to, and no more behind its foot than pedestals are high: below one that stands, above one that hangs.
fn bounds(fit: &Fit, reach: f64) -> Aabb {
    let base = fit.world_from_base.translation.vector;
    let mut out = Aabb::EMPTY;
    out.add(base.add_scalar(-reach).into());
    out.add(base.add_scalar(reach).into());
    let up = (fit.world_from_base * Vector::z()).z;
    if up > UPRIGHT {
        out.min[2] = base.z - BEHIND * reach;
    } else if up < -UPRIGHT {
        out.max[2] = base.z + BEHIND * reach;
    }
    out
}

/// World from the links of a fitted robot.
pub(crate) fn poses(fit: &Fit, model: &Model) -> Vec<Pose> {
    let posture: Vec<f64> = fit.joints.iter().map(|j| j.value).collect();
    model.poses(&posture).into_iter().map(|p| fit.world_from_base * p).collect()
}

/// A point in a voxel of a space: number of the space, of the voxel, and what the point makes of it.
pub(crate) type Spot = (usize, usize, SpaceKind);

/// Which voxels labelled points fall into; the same voxel once in a row. `blocks` are bounds of runs of points.
pub(crate) fn spots(
    grids: &[Option<(SpaceGrid, Aabb)>],
    world: &[[f64; 3]],
    labels: &[Label],
    blocks: &[(Range<usize>, Aabb)],
) -> Vec<Spot> {
    let mut out: Vec<Spot> = Vec::new();
    for (s, grid) in grids.iter().enumerate() {
        let Some((grid, bounds)) = grid else { continue };
        for (range, _) in blocks.iter().filter(|(_, own)| own.touches(bounds)) {
            for i in range.clone() {
                let at = bounds.contains(world[i]).then(|| grid.index(world[i])).flatten();
                let Some(at) = at else { continue };
                let spot = (s, at, Space::kind_of(labels[i]));
                if out.last() != Some(&spot) {
                    out.push(spot);
                }
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    #[test]
    fn a_robot_that_hangs_has_its_space_below() {
        let at = |tilt: f64| {
            let turn = nalgebra::UnitQuaternion::from_axis_angle(&Vector::x_axis(), tilt);
            let shift = nalgebra::Translation3::new(0.0, 0.0, 3.0);
            let fit = Fit { world_from_base: Pose::from_parts(shift, turn), ..Fit::default() };
            let bounds = bounds(&fit, 2.0);
            [bounds.min[2], bounds.max[2]]
        };
        assert_eq!([at(0.0), at(PI), at(FRAC_PI_2)], [[2.0, 5.0], [1.0, 4.0], [1.0, 5.0]]);
    }
}
