//! Known space around each robot: which voxels beams have passed through, which the robot and
//! others fill, and which no scan has seen. Points are marked in it while they are labelled.

use crate::cache::Cache;
use crate::detect::robots::{FittedRobots, poses, region, standing};
use crate::detect::search::Search;
use crate::engine::{AllThreads, Engine, Task};
use crate::job::Settings;
use contract::{Fit, Label, Region, Result, Space, SpaceGrid, SpaceKind, Verdict};
use freespace::PassedVoxels;
use geometry::{Aabb, Point, Vector};
use lattice::ViewSettings;
use robot::Model;
use std::ops::Range;

/// Number of cells of a depth image per voxel edge, so that each voxel is looked at through its
/// middle.
const CELLS_PER_EDGE: f64 = 3.0;
/// Depth behind a base that belongs to its robot's space, as a share of its reach: a robot on a
/// pedestal reaches below its base.
const BEHIND: f64 = 0.5;
/// Least vertical component of a base's axis for a standing or hanging robot: 60° of tilt.
const UPRIGHT: f64 = 0.5;

/// Robots and search from which known spaces are computed.
pub(crate) struct KnownSpaces<'a, 's> {
    /// Robots of the plant and their models.
    pub(crate) robots: FittedRobots<'a>,
    /// The search, which has the views of the scans.
    pub(crate) search: &'a Search<'a, 's>,
    pub(crate) settings: &'a Settings,
}

impl KnownSpaces<'_, '_> {
    /// The spaces of all robots, in the order of the fits; `None` where no scan has beams.
    /// Where `kept` is given, spaces are taken from it or stored in it.
    pub(crate) fn all(&self, kept: Option<&Cache>, engine: &Engine) -> Result<Vec<Option<Space>>> {
        if !self.settings.freespace.enabled {
            return Ok(vec![None; self.robots.fits.len()]);
        }
        let grids = self.grids().into_iter().enumerate().collect();
        engine.fan_out(Task::new("space").large(), grids, |(i, grid)| {
            let Some(grid) = grid else { return Ok(None) };
            match kept {
                Some(kept) => kept.get_or_compute(&Self::piece(i), || self.one(i, grid)),
                None => self.one(i, grid),
            }
        })
    }

    /// Name of the space of a robot as a cached piece.
    pub(crate) fn piece(robot: usize) -> String {
        format!("space {robot}")
    }

    /// The grids of the spaces of all robots; `None` where spaces are not requested.
    pub(crate) fn grids(&self) -> Vec<Option<SpaceGrid>> {
        let FittedRobots { fits, models } = self.robots;
        let edge = self.settings.freespace.edge;
        let known = self.search.bounds().grown(edge);
        let grid = |fit: &Fit| {
            let reached = bounds(fit, models[fit.model].reach());
            SpaceGrid::over(&reached.shared(&known), edge)
        };
        let is_wanted = self.settings.freespace.enabled;
        fits.iter().map(|fit| is_wanted.then(|| grid(fit))).collect()
    }

    /// The space of one robot; `None` where no scan has beams.
    pub(crate) fn one(&self, robot: usize, grid: SpaceGrid) -> Result<Option<Space>> {
        let mut space = self.seen(robot, grid)?;
        space.iter_mut().for_each(|space| self.fill_robots(space, robot));
        Ok(space)
    }

    /// The voxels of `grid` that beams have passed through; `None` where no scan has beams.
    pub(crate) fn seen(&self, robot: usize, grid: SpaceGrid) -> Result<Option<Space>> {
        let base: Point = self.robots.fits[robot].world_from_base.translation.vector.into();
        let region = region(&base, &grid.bounds());
        let view =
            ViewSettings { min_cell: grid.edge / CELLS_PER_EDGE, ..self.settings.view.clone() };
        let views = self.search.images(&region, &view)?;
        if views.iter().all(|v| v.images.is_empty()) {
            return Ok(None);
        }
        let mut space = Space::unknown(grid);
        let fit = &self.robots.fits[robot];
        let model = &self.robots.models[fit.model];
        let passed = PassedVoxels::new(&region, &views, grid.edge).about(model, &poses(fit, model));
        freespace::mark_free(&mut space, &passed, &AllThreads);
        Ok(Some(space))
    }

    /// Fills the voxels of all robots, last those of the robot whose space it is.
    pub(crate) fn fill_robots(&self, space: &mut Space, robot: usize) {
        let FittedRobots { fits, models } = self.robots;
        let bounds = space.grid().bounds();
        let is_other = |i: usize, fit: &Fit| {
            let stands = i != robot && fit.verdict != Verdict::Refused;
            stands && standing(fit, &models[fit.model]).touches(&bounds)
        };
        for (_, fit) in fits.iter().enumerate().filter(|(i, fit)| is_other(*i, fit)) {
            let model = &models[fit.model];
            freespace::mark_body(space, SpaceKind::Other, model, &poses(fit, model));
        }
        let own = &models[fits[robot].model];
        freespace::mark_body(space, SpaceKind::Robot, own, &poses(&fits[robot], own));
    }
}

/// The region of all positions that a robot can reach.
pub(crate) fn reach(fit: &Fit, model: &Model) -> Region {
    let base: Point = fit.world_from_base.translation.vector.into();
    region(&base, &bounds(fit, model.reach()))
}

/// Bounds of all positions within `reach` of a robot, but behind its foot no farther than pedestals
/// are high: below a standing robot, above a hanging one (world frame, metres).
pub(crate) fn bounds(fit: &Fit, reach: f64) -> Aabb {
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

/// Index of a space, index of a voxel in it, and the kind that a point gives to that voxel.
pub(crate) type VoxelMark = (usize, usize, SpaceKind);

/// Grids of spaces, with their bounds in the world frame.
pub(crate) struct SpaceGrids(Vec<Option<(SpaceGrid, Aabb)>>);

impl SpaceGrids {
    pub(crate) fn of(spaces: &[Option<Space>]) -> Self {
        let grid = |s: &Option<Space>| s.as_ref().map(|s| (*s.grid(), s.grid().bounds()));
        Self(spaces.iter().map(grid).collect())
    }

    /// The voxels of labelled points for which `counts` is true, without repeats of the same voxel
    /// in a row. `blocks` are the bounds of runs of points.
    pub(crate) fn spots(
        &self,
        world: &[[f64; 3]],
        labels: &[Label],
        blocks: &[(Range<usize>, Aabb)],
        counts: impl Fn(usize) -> bool,
    ) -> Vec<VoxelMark> {
        let mut out: Vec<VoxelMark> = Vec::new();
        for (s, grid) in self.0.iter().enumerate() {
            let Some((grid, bounds)) = grid else { continue };
            for (range, _) in blocks.iter().filter(|(_, own)| own.touches(bounds)) {
                for i in range.clone().filter(|i| counts(*i)) {
                    let at = bounds.contains(world[i]).then(|| grid.index(world[i])).flatten();
                    let Some(at) = at else { continue };
                    let spot = (s, at, Space::kind_of(labels[i], s));
                    if out.last() != Some(&spot) {
                        out.push(spot);
                    }
                }
            }
        }
        out
    }
}

/// Marks the voxels of points in their spaces.
pub(crate) fn mark(spaces: &mut [Option<Space>], spots: impl IntoIterator<Item = VoxelMark>) {
    for (space, voxel, kind) in spots {
        spaces[space].iter_mut().for_each(|s| s.mark(voxel, kind));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Pose;
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
