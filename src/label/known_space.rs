//! Fits and what the scans saw about them in; around each robot, which space was seen free, which
//! it and other robots fill and which nobody has seen, out. Points are marked into it while they
//! are labelled.

use crate::detect::robots::FittedRobots;
use crate::detect::search::Search;
use crate::engine::{AllThreads, Engine, Task};
use crate::job::Settings;
use contract::{Fit, Label, Region, Result, Space, SpaceGrid, SpaceKind, Verdict};
use freespace::PassedVoxels;
use geometry::{Aabb, Point, Pose, Vector};
use lattice::ViewSettings;
use robot::Model;
use std::ops::Range;

/// Depth images need cells this much smaller than the voxels, so that each voxel is looked at
/// through its middle.
const CELLS_PER_EDGE: f64 = 3.0;
/// Room behind a base that belongs to its robot's space, as a share of its reach: what stands on a
/// pedestal reaches below.
const BEHIND: f64 = 0.5;
/// Vertical part of a base's axis from which on its robot stands, or hangs: 60°.
const UPRIGHT: f64 = 0.5;

/// What spaces are made of.
pub(crate) struct KnownSpaces<'a, 's> {
    /// Robots of the plant, and the models that they are of.
    pub(crate) robots: FittedRobots<'a>,
    /// Who has what the scans saw.
    pub(crate) search: &'a Search<'a, 's>,
    pub(crate) settings: &'a Settings,
}

impl KnownSpaces<'_, '_> {
    /// The spaces of all robots, in the order of the fits; none where no scan says where its beams
    /// went.
    pub(crate) fn all(&self, engine: &Engine) -> Result<Vec<Option<Space>>> {
        let FittedRobots { fits, models } = self.robots;
        if !self.settings.freespace.enabled {
            return Ok(vec![None; fits.len()]);
        }
        let edge = self.settings.freespace.edge;
        let known = self.search.bounds().grown(edge);
        engine.fan_out(Task::new("space").large(), (0..fits.len()).collect(), |i| {
            let model = &models[fits[i].model];
            let grid = SpaceGrid::over(&bounds(&fits[i], model.reach()).shared(&known), edge);
            let mut space = self.seen(i, grid)?;
            space.iter_mut().for_each(|space| self.stand(space, i));
            Ok(space)
        })
    }

    /// What beams went through about a robot, in these voxels; none where no scan says where its
    /// beams went.
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

    /// Fills what robots fill, last the one whose space it is.
    pub(crate) fn stand(&self, space: &mut Space, robot: usize) {
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

/// World bounds of a robot as it stands.
pub(crate) fn standing(fit: &Fit, model: &Model) -> Aabb {
    let mut out = Aabb::EMPTY;
    for (link, pose) in model.links.iter().zip(poses(fit, model)) {
        if !link.bounds.is_empty() {
            link.bounds.corners().into_iter().for_each(|c| out.add((pose * Point::from(c)).into()));
        }
    }
    out
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

/// All that a robot can get to, and no more behind its foot than pedestals are high: below one that
/// stands, above one that hangs.
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

/// World from the links of a fitted robot.
pub(crate) fn poses(fit: &Fit, model: &Model) -> Vec<Pose> {
    let posture: Vec<f64> = fit.joints.iter().map(|j| j.value).collect();
    model.poses(&posture).into_iter().map(|p| fit.world_from_base * p).collect()
}

/// A point in a voxel of a space: number of the space, of the voxel, and what the point makes of
/// it.
pub(crate) type VoxelMark = (usize, usize, SpaceKind);

/// Grids of spaces, with their bounds in the world.
pub(crate) struct SpaceGrids(Vec<Option<(SpaceGrid, Aabb)>>);

impl SpaceGrids {
    pub(crate) fn of(spaces: &[Option<Space>]) -> Self {
        let grid = |s: &Option<Space>| s.as_ref().map(|s| (*s.grid(), s.grid().bounds()));
        Self(spaces.iter().map(grid).collect())
    }

    /// Which voxels labelled points fall into, where `counts` says that a point counts; the same
    /// voxel once in a row. `blocks` are bounds of runs of points.
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

/// Puts points into their spaces.
pub(crate) fn mark(spaces: &mut [Option<Space>], spots: impl IntoIterator<Item = VoxelMark>) {
    for (space, voxel, kind) in spots {
        spaces[space].iter_mut().for_each(|s| s.mark(voxel, kind));
    }
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
