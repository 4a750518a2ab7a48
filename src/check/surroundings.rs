//! A result and one of its robots in; what hangs on that robot, and all that stands around it, out.

use super::Robot;
use crate::engine::{Engine, Task};
use crate::rescan::{State, tiles_of};
use crate::reuse::Vouched;
use crate::spaces::poses;
use clearance::{CELL, Cells, Hung, Known, Obstacles, What};
use contract::{Error, Fit, PointKind, Result, Space};
use export::{OldPoint, ResultFile, SpaceEntry, read_tile};
use geometry::{Aabb, Point, Pose};
use robot::Model;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Points of a tile that are looked at before each cell is kept once.
const SETTLED: usize = 1 << 22;

/// A result.
pub(super) struct Surroundings<'a> {
    pub(super) out: &'a Path,
    pub(super) files: &'a Vouched,
    pub(super) state: &'a State,
    pub(super) result: &'a ResultFile,
}

/// What is taken of the points near a robot.
struct Sorting<'a> {
    number: i16,
    base_from_world: Pose,
    /// Farthest from the base on each of its axes, metres.
    far: f64,
    /// Links from the base, as the robot was found.
    link_from_base: Vec<Pose>,
    /// By link: whether joints move it.
    moves: &'a [bool],
}

/// Points of a tile.
struct Sorted {
    cells: Cells,
    n_waiting: usize,
    /// Cells of points that hang on each link.
    hung: BTreeMap<usize, BTreeSet<[i32; 3]>>,
}

impl Surroundings<'_> {
    /// What hangs on a robot, and what stands around it no farther than so on each axis of its
    /// base, metres: points, `others`, and space that no beam went through.
    pub(super) fn gather(
        &self,
        robot: &Robot<'_>,
        (others, models): (&[(usize, &Fit)], &[Model]),
        far: f64,
        engine: &Engine,
    ) -> Result<(Hung, Obstacles)> {
        let moves = robot.model.moving();
        let sorting = sorting(robot, far, &moves);
        let (cells, hung) = self.points(&sorting, engine)?;
        let base_from_world = &sorting.base_from_world;
        let standing = |(number, fit): &(usize, &Fit)| {
            // However it stood, it may stand so again.
            let all = std::iter::once(*fit).chain(&fit.stays);
            let placed = |fit: &Fit| {
                let model = &models[fit.model];
                let from_links = poses(fit, model).iter().map(|p| base_from_world * p).collect();
                (*number as i16, model, from_links)
            };
            all.map(placed).collect::<Vec<(i16, &Model, Vec<Pose>)>>()
        };
        let others: Vec<_> = others.iter().flat_map(standing).collect();
        let read = |entry: &SpaceEntry| {
            self.files.compared(&entry.grid)?;
            entry.read(self.out)
        };
        let space: Option<Space> = robot.entry.space.as_ref().map(read).transpose()?;
        let bounds = space.as_ref().map_or(Aabb::EMPTY, |space| space.grid().bounds());
        let known = Known { world_from_base: robot.fit.world_from_base, bounds };
        Ok((hung, Obstacles::new(&cells, &others, (space.as_ref(), known))))
    }

    /// Cells of all points that may stand in the way, and points that hang on the robot.
    fn points(&self, sorting: &Sorting<'_>, engine: &Engine) -> Result<(Cells, Hung)> {
        let Some(edge) = self.state.records.tile_edge() else {
            return Err(Error::bad_input("the result has no tiles to read its points from")
                .at(self.out.join("tiles").display())
                .hint("run with --set export.tiles=true"));
        };
        let corners =
            sorting.bounds().corners().map(|c| sorting.base_from_world.inverse() * Point::from(c));
        let world = Aabb::of(corners.iter().map(|c| c.coords.into()));
        let names = tiles_of(&self.files.manifest().files, edge, &[&world]);
        let las = self.state.records.las();
        let tiles = engine.fan_out(Task::new("points"), names, |name| {
            let mut own = Sorted::new(sorting.far);
            let (path, stated) = self.files.stated(&name)?;
            read_tile(&path, &las, stated, |points| {
                points.iter().try_for_each(|p| self.sort(sorting, p, &mut own))?;
                own.settle(SETTLED);
                engine.cancel.check()
            })?;
            own.settle(0);
            Ok(own)
        })?;
        let mut all = Sorted::new(sorting.far);
        for own in tiles {
            all.cells.join(own.cells);
            for (link, cells) in own.hung {
                all.hung.entry(link).or_default().extend(cells);
            }
        }
        all.cells.settle();
        let middle = |cell: &[i32; 3]| cell.map(|v| ((f64::from(v) + 0.5) * CELL) as f32);
        let hung =
            all.hung.into_iter().map(|(link, cells)| (link, cells.iter().map(middle).collect()));
        Ok((all.cells, hung.collect()))
    }

    fn sort(&self, sorting: &Sorting<'_>, point: &OldPoint, into: &mut Sorted) -> Result<()> {
        let p = sorting.base_from_world * Point::from(point.world);
        let label = point.label;
        let is_own = label.robot == sorting.number;
        // What hangs on the robot counts wherever it is.
        let is_hung = is_own && label.kind == PointKind::Attachment;
        let is_inside = sorting.bounds().contains(p.coords.into());
        if !is_inside && !is_hung {
            return Ok(());
        }
        let what = match label.kind {
            PointKind::Link if is_own => return Ok(()),
            PointKind::Attachment if is_own => {
                let link = usize::try_from(label.link).ok();
                match link.filter(|link| sorting.moves.get(*link).copied().unwrap_or(false)) {
                    Some(link) => {
                        let own = sorting.link_from_base[link] * p;
                        let cell = own.coords.map(|v| (v / CELL).floor() as i32).into();
                        into.hung.entry(link).or_default().insert(cell);
                        return Ok(());
                    }
                    // What hangs on its foot stays where it is.
                    None if is_inside => What::Uncertain,
                    None => return Ok(()),
                }
            }
            PointKind::Link | PointKind::Attachment if label.robot >= 0 => {
                self.named(label.robot, point)?
            }
            PointKind::Fixed => What::Fixed,
            PointKind::Floor => What::Floor,
            _ => What::Uncertain,
        };
        into.cells.add(p.coords.into(), what);
        into.n_waiting += 1;
        Ok(())
    }

    /// Another robot of the result.
    fn named(&self, number: i16, point: &OldPoint) -> Result<What> {
        if (number as usize) < self.result.robots.len() {
            return Ok(What::Robot(number));
        }
        let [x, y, z] = point.world;
        Err(Error::bad_input(format!(
            "a point at ({x:.3}, {y:.3}, {z:.3}) is of robot {number}, which the result has not"
        ))
        .at(self.out.join("tiles").display())
        .hint("`stillpoint verify` says whether the result is whole"))
    }
}

fn sorting<'m>(robot: &Robot<'_>, far: f64, moves: &'m [bool]) -> Sorting<'m> {
    let (fit, model) = (robot.fit, robot.model);
    let posture: Vec<f64> = fit.joints.iter().map(|j| j.value).collect();
    Sorting {
        number: robot.number as i16,
        base_from_world: fit.world_from_base.inverse(),
        far,
        link_from_base: model.poses(&posture).iter().map(Pose::inverse).collect(),
        moves,
    }
}

impl Sorting<'_> {
    /// Frame of the base.
    fn bounds(&self) -> Aabb {
        Aabb { min: [-self.far; 3], max: [self.far; 3] }
    }
}

impl Sorted {
    fn new(far: f64) -> Self {
        Self { cells: Cells::within(far), n_waiting: 0, hung: BTreeMap::new() }
    }

    fn settle(&mut self, most: usize) {
        if self.n_waiting > most {
            self.cells.settle();
            self.n_waiting = 0;
        }
    }
}
