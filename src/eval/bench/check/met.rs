//! Which wires and pipes of a cell no beam met: no scan can tell that they are there.

use super::draw::off;
use crate::cache::{VerifiedFiles, tiles_of};
use crate::engine::{Engine, Task};
use crate::result::plant_state::PlantState;
use contract::{Error, Result};
use export::read_tile;
use geometry::{Aabb, Point};
use simulate::Scene;
use simulate::scene::Hose;
use std::collections::BTreeSet;
use std::path::Path;

/// A point belongs to a thing if it is no farther from its surface, metres: three standard
/// deviations of the range, and the rounding of tiles.
const NOISE: f64 = 0.007;
/// Points nearer to its ends may belong to what it is fastened to, metres.
const ENDS: f64 = 0.05;

/// Names of the bodies of those straight things that hang free on which no measured point lies.
///
/// # Errors
/// Files of the result cannot be read.
pub(super) fn unmet(scene: &Scene, out: &Path, engine: &Engine) -> Result<BTreeSet<String>> {
    let files = VerifiedFiles::open(out)?;
    let state = PlantState::read(&files)?;
    let edge = state.records.tile_edge();
    let edge = edge.ok_or_else(|| Error::bad_input("the result has no tiles").at(out.display()))?;
    let las = state.records.las();
    let straight: Vec<(&Hose, [Point; 2])> = scene.hoses.iter().filter_map(line).collect();
    let is_met = |(hose, ends): &(&Hose, [Point; 2])| {
        let bounds = Aabb::of(ends.iter().map(|p| p.coords.into())).grown(hose.radius + NOISE);
        let names = tiles_of(&files.manifest().files, edge, &[&bounds]);
        let is_on = |p: &Point| {
            off(p, ends) < hose.radius + NOISE && ends.iter().all(|end| (p - end).norm() > ENDS)
        };
        let met = engine.fan_out(Task::new("points on wires"), names, |name| {
            let (path, stated) = files.stated(&name)?;
            let mut n = 0;
            read_tile(&path, &las, stated, |points| {
                n += points.iter().filter(|p| is_on(&Point::from(p.world))).count();
                Ok(())
            })?;
            Ok(n > 0)
        })?;
        Ok::<bool, Error>(met.contains(&true))
    };
    let mut unmet = BTreeSet::new();
    for thing in &straight {
        if !is_met(thing)? {
            unmet.insert(format!("line {}", thing.0.name));
        }
    }
    Ok(unmet)
}

/// A thing from one place to another that no robot holds.
fn line(hose: &Hose) -> Option<(&Hose, [Point; 2])> {
    let [a, b] = &hose.anchors[..] else { return None };
    let is_free = hose.sag == 0.0 && a.robot.is_none() && b.robot.is_none();
    is_free.then(|| (hose, [Point::from(a.xyz), Point::from(b.xyz)]))
}
