//! Known space around robots after a rescan: spaces of the earlier result, brought up to date
//! within the cell by the new scans. Points are marked in them while they are labelled and tiles
//! are written.

use super::found::RescanFindings;
use crate::detect::robot_id::robot_id;
use crate::detect::robots::FittedRobots;
use crate::detect::robots::poses;
use crate::engine::{Engine, Task};
use crate::label::known_space::{KnownSpaces, VoxelMark, bounds, mark};
use contract::{Result, Space, SpaceGrid, SpaceKind};
use export::{SpaceEntry, write_space};
use freespace::PassedVoxels;
use geometry::Aabb;
use std::path::Path;

impl RescanFindings<'_, '_> {
    /// For each fit, the space of a robot that has moved, or whose space reaches places with
    /// compared points.
    pub(super) fn spaces(&self, engine: &Engine) -> Result<Vec<Option<Space>>> {
        let mut out: Vec<Option<Space>> = vec![None; self.fits.len()];
        let settings = self.session.settings;
        if !settings.freespace.enabled {
            return Ok(out);
        }
        let search = self.session.search();
        let robots = FittedRobots { fits: self.fits, models: self.models };
        let around = KnownSpaces { robots, search: &search, settings };
        let places = self.places();
        let meets = |i: usize| {
            let grid = self.entry(i).map(|entry| entry.voxels().bounds());
            grid.is_some_and(|grid| places.iter().any(|place| place.touches(&grid)))
        };
        let is_gone = |i: usize| self.robots.gone.contains(&i);
        let is_renewed = |i: &usize| self.robots.changed.contains(i) || (!is_gone(*i) && meets(*i));
        let renewed: Vec<usize> = (0..self.fits.len()).filter(is_renewed).collect();
        let spaces = engine.fan_out(Task::new("space").large(), renewed.clone(), |i| {
            self.space(i, &around, &places)
        })?;
        renewed.into_iter().zip(spaces).for_each(|(i, space)| out[i] = space);
        Ok(out)
    }

    /// The space of one robot, before points of the places are marked.
    fn space(
        &self,
        i: usize,
        around: &KnownSpaces<'_, '_>,
        places: &[Aabb],
    ) -> Result<Option<Space>> {
        let read = |entry: &SpaceEntry| {
            self.base.files.compared(&entry.grid)?;
            entry.read(&self.base.out)
        };
        let old = self.entry(i).map(read).transpose()?;
        let edge = old.as_ref().map_or(around.settings.freespace.edge, |old| old.grid().edge);
        let known = old.as_ref().map_or(Aabb::EMPTY, |old| old.grid().bounds());
        let known = known.union(&around.search.bounds().grown(edge));
        let fit = &self.fits[i];
        let reach = bounds(fit, self.models[fit.model].reach()).shared(&known);
        let grid = SpaceGrid::over(&reach, edge);
        let Some(old) = old.filter(|_| !places.is_empty()) else {
            let mut seen = around.seen(i, grid)?;
            seen.iter_mut().for_each(|space| around.fill_robots(space, i));
            return Ok(seen);
        };
        let mut space = Space::unknown(grid);
        around.fill_robots(&mut space, i);
        let model = &self.models[fit.model];
        let passed = PassedVoxels::new(&self.session.cell, &self.session.new_views, grid.edge)
            .about(model, &poses(fit, model));
        renew(&mut space, &old, places, |middle| passed.is_free(middle));
        Ok(Some(space))
    }

    /// Marks the remaining old points and writes the spaces; returns the entry of each fit.
    pub(super) fn write_spaces(
        &self,
        mut spaces: Vec<Option<Space>>,
        left: Vec<VoxelMark>,
        next: &Path,
        engine: &Engine,
    ) -> Result<Vec<Option<SpaceEntry>>> {
        mark(&mut spaces, left);
        engine.each(spaces.into_iter().enumerate().collect(), |(i, space)| {
            space.map(|space| write_space(next, &robot_id(i), &space)).transpose()
        })
    }

    /// Bounds within which points of the earlier result are compared one by one: the cell, and the
    /// earlier postures of robots. Empty where the result has no tiles.
    fn places(&self) -> Vec<Aabb> {
        let has_tiles = self.base.state.records.tile_edge().is_some();
        let places = self.robots.left.iter().chain([&self.session.past.cell]);
        places.filter(|_| has_tiles).copied().collect()
    }

    /// The earlier result's entry of a robot's space.
    fn entry(&self, robot: usize) -> Option<&SpaceEntry> {
        self.base.result.robots.get(robot)?.space.as_ref()
    }
}

/// Completes a space that robots fill already: within `places` by new beams, elsewhere by the
/// earlier space. Points are marked later; a voxel that was free and is not seen now stays free.
fn renew(space: &mut Space, old: &Space, places: &[Aabb], is_free: impl Fn([f64; 3]) -> bool) {
    use SpaceKind::{Fixed, Free, Other, Robot, Unknown};
    let grid = *space.grid();
    for (at, voxel) in space.voxels_mut().iter_mut().enumerate() {
        let middle = grid.middle(at);
        let was = old.grid().index(middle).map_or(Unknown, |at| old.voxels()[at]);
        if (*voxel, was) == (Unknown, Free) {
            *voxel = Free;
            continue;
        }
        let own = Aabb { min: middle, max: middle }.grown(0.5 * grid.edge);
        let is_within = places.iter().any(|p| p.contains(own.min) && p.contains(own.max));
        *voxel = match (*voxel, was) {
            (Unknown, _) if is_within && is_free(middle) => Free,
            (body, _) if is_within => body,
            (body @ (Robot | Other), was) if was != Fixed => body,
            (_, was) => was,
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn space(kinds: [SpaceKind; 4]) -> Space {
        let bounds = Aabb { min: [0.0; 3], max: [0.4, 0.1, 0.1] };
        let mut space = Space::unknown(SpaceGrid::over(&bounds, 0.1));
        space.voxels_mut().copy_from_slice(&kinds);
        space
    }

    #[test]
    fn voxels_are_renewed_where_points_are_looked_at_again_and_nowhere_else() {
        use SpaceKind::{Fixed, Free, Other, Robot, Unknown};
        // The place ends within the third voxel, which is therefore not covered as a whole.
        let place = Aabb { min: [-0.01; 3], max: [0.25, 0.11, 0.11] };
        let after = |was, free: [bool; 4], bodies| {
            let (mut space, old) = (space(bodies), space(was));
            renew(&mut space, &old, &[place], |p| free[(p[0] / 0.1) as usize]);
            space.voxels().to_vec()
        };
        let (unseen, nobody) = ([false; 4], [Unknown; 4]);
        let seen = [true, false, true, true];
        assert_eq!(after([Fixed; 4], seen, nobody), [Free, Unknown, Fixed, Fixed]);
        let bodies = [Unknown, Other, Unknown, Robot];
        assert_eq!(after([Free; 4], unseen, bodies), [Free, Other, Free, Robot]);
        let was = [Robot, Other, Robot, Fixed];
        assert_eq!(after(was, unseen, bodies), [Unknown, Other, Robot, Fixed]);
        // The voxels of a robot stay filled whatever beams have passed through them.
        assert_eq!(after([Unknown; 4], [true; 4], bodies), [Free, Other, Unknown, Robot]);
    }
}
