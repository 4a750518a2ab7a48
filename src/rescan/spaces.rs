//! Spaces of robots as the earlier result has them, and what the new scans saw, in; spaces in and beside the cell, brought up to
//! date, out. Points are marked into them while they are labelled and while tiles are written.

use super::write::Written;
use crate::engine::{Engine, Task};
use crate::report::id;
use crate::spaces::{Around, Spot, bounds, mark};
use contract::{Result, Space, SpaceGrid, SpaceKind};
use export::{SpaceEntry, write_space};
use geometry::Aabb;
use std::path::Path;

impl Written<'_, '_> {
    /// By fit: spaces of robots that stand otherwise, and of others that reach to where points are looked at again.
    pub(super) fn spaces(&self, engine: &Engine) -> Result<Vec<Option<Space>>> {
        let mut out: Vec<Option<Space>> = vec![None; self.fits.len()];
        let settings = self.session.settings;
        if !settings.merge.space {
            return Ok(out);
        }
        let search = self.session.search();
        let around = Around { robots: (self.fits, self.models), search: &search, settings };
        let places = self.places();
        let meets = |i: usize| {
            let grid = self.entry(i).map(|entry| entry.voxels().bounds());
            grid.is_some_and(|grid| places.iter().any(|place| place.touches(&grid)))
        };
        let is_gone = |i: usize| self.robots.gone.contains(&i);
        let is_renewed = |i: &usize| self.robots.changed.contains(i) || (!is_gone(*i) && meets(*i));
        let renewed: Vec<usize> = (0..self.fits.len()).filter(is_renewed).collect();
        let spaces = engine.fan_out(Task::new("space").large(), renewed.clone(), |i| {
            let old = self.entry(i).map(|entry| entry.read(&self.base.out)).transpose()?;
            let edge = old.as_ref().map_or(settings.merge.space_edge, |old| old.grid().edge);
            let known = old.as_ref().map_or(Aabb::EMPTY, |old| old.grid().bounds());
            let known = known.union(&search.bounds().grown(edge));
            let fit = &self.fits[i];
            let reach = bounds(fit, self.models[fit.model].reach());
            let grid = SpaceGrid::over(&reach.shared(&known), edge);
            let seen = around.one(i, grid)?;
            let Some(old) = old else { return Ok(seen) };
            let unseen = || {
                let mut space = Space::unknown(grid);
                around.stand(&mut space, i);
                space
            };
            Ok(Some(renewed_in(&places, &old, seen.unwrap_or_else(unseen))))
        })?;
        renewed.into_iter().zip(spaces).for_each(|(i, space)| out[i] = space);
        Ok(out)
    }

    /// Marks what is left of the old points and writes them; by fit, what is said of them.
    pub(super) fn write_spaces(
        &self,
        mut spaces: Vec<Option<Space>>,
        left: Vec<Spot>,
        next: &Path,
        engine: &Engine,
    ) -> Result<Vec<Option<SpaceEntry>>> {
        mark(&mut spaces, left);
        engine.each(spaces.into_iter().enumerate().collect(), |(i, space)| {
            space.map(|space| write_space(next, &id(i), &space)).transpose()
        })
    }

    /// Where points of the earlier result are looked at again, one by one: the cell, and where robots stood. Nowhere, where
    /// it has no tiles of them.
    pub(super) fn places(&self) -> Vec<Aabb> {
        let has_tiles = self.base.state.records.tile_edge().is_some();
        let places = self.robots.left.iter().chain([&self.session.past.cell]);
        places.filter(|_| has_tiles).copied().collect()
    }

    /// What the earlier result says of the space of a robot.
    fn entry(&self, robot: usize) -> Option<&SpaceEntry> {
        self.base.result.robots.get(robot)?.space.as_ref()
    }
}

/// A space as beams of the new scans and models have it within some places, else as it was. What points they hold is not known
/// yet within the places; what was seen free and is not seen now stays free.
fn renewed_in(places: &[Aabb], old: &Space, mut seen: Space) -> Space {
    let grid = *seen.grid();
    for (at, voxel) in seen.voxels_mut().iter_mut().enumerate() {
        let own = grid.voxel(at);
        let was = old.grid().index(own.center().into());
        let was = was.map_or(SpaceKind::Unknown, |at| old.voxels()[at]);
        let is_within = places.iter().any(|p| p.contains(own.min) && p.contains(own.max));
        *voxel = match (*voxel, was) {
            (SpaceKind::Unknown, SpaceKind::Free) => SpaceKind::Free,
            (now, _) if is_within => now,
            (now @ (SpaceKind::Robot | SpaceKind::Other), was) if was != SpaceKind::Fixed => now,
            (_, was) => was,
        };
    }
    seen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voxels_are_renewed_where_points_are_looked_at_again_and_nowhere_else() {
        use SpaceKind::{Fixed, Free, Other, Robot, Unknown};
        let bounds = Aabb { min: [0.0; 3], max: [0.4, 0.1, 0.1] };
        let space = |kinds: [SpaceKind; 4]| {
            let mut space = Space::unknown(SpaceGrid::over(&bounds, 0.1));
            space.voxels_mut().copy_from_slice(&kinds);
            space
        };
        // The place ends within the third voxel: that is not all looked at.
        let place = Aabb { min: [-0.01; 3], max: [0.25, 0.11, 0.11] };
        let renewed = |was, now| renewed_in(&[place], &space(was), space(now)).voxels().to_vec();
        assert_eq!(
            renewed([Fixed; 4], [Free, Unknown, Free, Unknown]),
            [Free, Unknown, Fixed, Fixed]
        );
        assert_eq!(
            renewed([Free; 4], [Unknown, Other, Unknown, Robot]),
            [Free, Other, Free, Robot]
        );
        assert_eq!(
            renewed([Robot, Other, Robot, Fixed], [Unknown, Free, Unknown, Robot]),
            [Unknown, Free, Robot, Fixed]
        );
    }
}
