//! A result and one of its robots in; what hangs on that robot, and all that stands around it, out.

use super::CheckedRobot;
use crate::cache::{VerifiedFiles, tiles_of};
use crate::engine::{Engine, Task};
use crate::label::known_space::poses;
use crate::result::plant_state::PlantState;
use clearance::{
    AttachedPoints, CELL, Cells, KnownBounds, ObstacleKind, Obstacles, ScannerAt, Shadow,
    attached_points,
};
use contract::{Error, Fit, PointKind, Result, Scan, Space};
use export::{OldPoint, ResultFile, SpaceEntry, read_tile};
use geometry::{Aabb, Point, Pose};
use robot::Model;
use std::collections::BTreeMap;
use std::path::Path;

/// Points of a tile that are looked at before each cell is kept once.
const SETTLED: usize = 1 << 22;

/// Scanners that are farther off tell few points about a robot, metres.
const SCANNED_FROM: f64 = 30.0;

/// A result.
pub(super) struct Surroundings<'a> {
    pub(super) out: &'a Path,
    pub(super) files: &'a VerifiedFiles,
    pub(super) state: &'a PlantState,
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
    /// By LAS `point_source_id`: what robots hide from the scanners that its points may be of.
    shadows: BTreeMap<u16, Vec<&'a Shadow>>,
    /// By LAS `point_source_id`, where it is that of one scanner: that scanner.
    eyes: BTreeMap<u16, ScannerAt>,
}

/// Points of a tile.
struct Sorted {
    cells: Cells,
    n_waiting: usize,
    /// Cells of points that hang on each link, and whether all beams to them grazed an edge.
    hung: BTreeMap<usize, BTreeMap<[i32; 3], bool>>,
}

impl Surroundings<'_> {
    /// What hangs on a robot, and what stands around it no farther than so on each axis of its
    /// base, metres: points, `others`, and space that no beam went through.
    pub(super) fn gather(
        &self,
        robot: &CheckedRobot<'_>,
        others: &[(usize, &Fit)],
        models: &[Model],
        far: f64,
        engine: &Engine,
    ) -> Result<(AttachedPoints, Obstacles)> {
        let moves = robot.model.moving();
        let base_from_world = &robot.fit.world_from_base.inverse();
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
        let shadows = self.shadows(robot, &others, engine)?;
        let mut sorting = sorting(robot, far, &moves);
        sorting.shadows = self.told_by(&shadows);
        sorting.eyes = self.eyes(base_from_world);
        let (cells, hung) = self.points(&sorting, engine)?;
        let read = |entry: &SpaceEntry| {
            self.files.compared(&entry.grid)?;
            entry.read(self.out)
        };
        let space: Option<Space> = robot.entry.space.as_ref().map(read).transpose()?;
        let bounds = space.as_ref().map_or(Aabb::EMPTY, |space| space.grid().bounds());
        let known = KnownBounds { world_from_base: robot.fit.world_from_base, bounds };
        Ok((hung, Obstacles::new(&cells, &others, space.as_ref(), known)))
    }

    /// Cells of all points that may stand in the way, and points that hang on the robot.
    fn points(&self, sorting: &Sorting<'_>, engine: &Engine) -> Result<(Cells, AttachedPoints)> {
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
            let mut own = Sorted::new(sorting);
            let (path, stated) = self.files.stated(&name)?;
            read_tile(&path, &las, stated, |points| {
                points.iter().try_for_each(|p| self.sort(sorting, p, &mut own))?;
                own.settle(SETTLED);
                engine.cancel.check()
            })?;
            own.settle(0);
            Ok(own)
        })?;
        let mut all = Sorted::new(sorting);
        for own in tiles {
            all.cells.join(own.cells);
            for (link, cells) in own.hung {
                let own = all.hung.entry(link).or_default();
                cells.into_iter().for_each(|(cell, is_grazed)| meet(own, cell, is_grazed));
            }
        }
        all.cells.remove_duplicates();
        let middle = |cell: [i32; 3]| cell.map(|v| ((f64::from(v) + 0.5) * CELL) as f32);
        let hung = all.hung.into_iter().map(|(link, cells)| {
            let all: Vec<_> = cells.into_iter().map(|(cell, told)| (middle(cell), told)).collect();
            (link, attached_points(&all))
        });
        Ok((all.cells, hung.collect()))
    }

    /// What the robots that stand hide from each scanner that is known; frame of the base.
    fn shadows(
        &self,
        robot: &CheckedRobot<'_>,
        others: &[(i16, &Model, Vec<Pose>)],
        engine: &Engine,
    ) -> Result<Vec<(usize, Shadow)>> {
        let own = robot.model.poses(&robot.found());
        let others = others.iter().map(|(_, model, poses)| (*model, &poses[..]));
        let all: Vec<(&Model, &[Pose])> =
            std::iter::once((robot.model, &own[..])).chain(others).collect();
        let scans = self.state.scans.iter().enumerate();
        let base = robot.fit.world_from_base.translation.vector;
        let is_near =
            |scan: &Scan| (scan.world_from_scan.translation.vector - base).norm() < SCANNED_FROM;
        let known = scans.filter(|(_, scan)| scan.lattice.is_some() && is_near(scan)).collect();
        engine.fan_out(Task::new("outlines"), known, |(at, scan)| {
            let eye = robot.fit.world_from_base.inverse()
                * Point::from(scan.world_from_scan.translation.vector);
            Ok((at, Shadow::new(&all, eye)))
        })
    }

    /// The shadows by the `point_source_id` of the points that they may be of: those of files that
    /// had such ids keep them, others have the number of their scan, from 1.
    fn told_by<'s>(&self, shadows: &'s [(usize, Shadow)]) -> BTreeMap<u16, Vec<&'s Shadow>> {
        let mut out: BTreeMap<u16, Vec<&Shadow>> = BTreeMap::new();
        for (at, shadow) in shadows {
            if let Some(id) = self.source_id(*at) {
                out.entry(id).or_default().push(shadow);
            }
        }
        out
    }

    fn source_id(&self, scan: usize) -> Option<u16> {
        self.state.scans[scan].source_id.or(u16::try_from(scan + 1).ok())
    }

    /// The scanners that are known, where points tell of which they are.
    fn eyes(&self, base_from_world: &Pose) -> BTreeMap<u16, ScannerAt> {
        let mut all: BTreeMap<u16, Vec<&Scan>> = BTreeMap::new();
        for (at, scan) in self.state.scans.iter().enumerate() {
            self.source_id(at).into_iter().for_each(|id| all.entry(id).or_default().push(scan));
        }
        let eye = |(id, scans): (u16, Vec<&Scan>)| {
            let [scan] = scans[..] else { return None };
            let lattice = scan.lattice.as_ref()?;
            let at = base_from_world * Point::from(scan.world_from_scan.translation.vector);
            Some((id, ScannerAt { at, step: lattice.row_step.max(lattice.col_step) }))
        };
        all.into_iter().filter_map(eye).collect()
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
        into.cells.add_measurement(&p, point.source_id);
        let shadows = sorting.shadows.get(&point.source_id);
        let is_grazed = shadows.is_some_and(|all| all.iter().all(|shadow| shadow.is_grazed(&p)));
        let what = match label.kind {
            PointKind::Link if is_own => return Ok(()),
            PointKind::Attachment if is_own => {
                let link = usize::try_from(label.link).ok();
                match link.filter(|link| sorting.moves.get(*link).copied().unwrap_or(false)) {
                    Some(link) => {
                        let own = sorting.link_from_base[link] * p;
                        let cell = own.coords.map(|v| (v / CELL).floor() as i32).into();
                        meet(into.hung.entry(link).or_default(), cell, is_grazed);
                        return Ok(());
                    }
                    // What hangs on its foot stays where it is.
                    None if is_inside => ObstacleKind::Uncertain,
                    None => return Ok(()),
                }
            }
            PointKind::Link | PointKind::Attachment if label.robot >= 0 => {
                self.named(label.robot, point)?
            }
            PointKind::Fixed => ObstacleKind::Fixed,
            PointKind::Floor => ObstacleKind::Floor,
            _ => ObstacleKind::Uncertain,
        };
        into.cells.add(p.coords.into(), what, is_grazed, point.source_id);
        into.n_waiting += 1;
        Ok(())
    }

    /// Another robot of the result.
    fn named(&self, number: i16, point: &OldPoint) -> Result<ObstacleKind> {
        if (number as usize) < self.result.robots.len() {
            return Ok(ObstacleKind::Robot(number));
        }
        let [x, y, z] = point.world;
        Err(Error::bad_input(format!(
            "a point at ({x:.3}, {y:.3}, {z:.3}) is of robot {number}, which the result has not"
        ))
        .at(self.out.join("tiles").display())
        .hint("`stillpoint verify` checks whether the result is complete"))
    }
}

fn sorting<'m>(robot: &CheckedRobot<'_>, far: f64, moves: &'m [bool]) -> Sorting<'m> {
    let (fit, model) = (robot.fit, robot.model);
    let posture: Vec<f64> = fit.joints.iter().map(|j| j.value).collect();
    Sorting {
        number: robot.number as i16,
        base_from_world: fit.world_from_base.inverse(),
        far,
        link_from_base: model.poses(&posture).iter().map(Pose::inverse).collect(),
        moves,
        shadows: BTreeMap::new(),
        eyes: BTreeMap::new(),
    }
}

/// Adds a point to the cells that hang on a link.
fn meet(cells: &mut BTreeMap<[i32; 3], bool>, cell: [i32; 3], is_grazed: bool) {
    *cells.entry(cell).or_insert(is_grazed) &= is_grazed;
}

impl Sorting<'_> {
    /// Frame of the base.
    fn bounds(&self) -> Aabb {
        Aabb { min: [-self.far; 3], max: [self.far; 3] }
    }
}

impl Sorted {
    fn new(sorting: &Sorting<'_>) -> Self {
        let cells = Cells::within(sorting.far, &sorting.eyes);
        Self { cells, n_waiting: 0, hung: BTreeMap::new() }
    }

    fn settle(&mut self, most: usize) {
        if self.n_waiting > most {
            self.cells.remove_duplicates();
            self.n_waiting = 0;
        }
    }
}
