//! Surroundings of a robot: bodies attached to it, and all obstacles within its reach.

use super::CheckedRobot;
use super::outlines::{Outlines, ScanShadow};
use crate::cache::{VerifiedFiles, tiles_of};
use crate::detect::robots::poses;
use crate::engine::{AllThreads, Engine, Task};
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

/// Number of points of a tile after which repeated cells are merged.
const SETTLED: usize = 1 << 22;

/// A result, from whose tiles and spaces surroundings are gathered.
pub(super) struct Surroundings<'a> {
    pub(super) out: &'a Path,
    pub(super) files: &'a VerifiedFiles,
    pub(super) state: &'a PlantState,
    pub(super) result: &'a ResultFile,
    /// Shadows that were found already.
    pub(super) outlines: Outlines,
}

/// Rules by which points near a robot are sorted to obstacles and attached bodies.
struct Sorting<'a> {
    number: i16,
    base_from_world: Pose,
    /// Greatest distance from the base along each of its axes, metres.
    far: f64,
    /// Pose of the base in each link's frame, in the found posture.
    link_from_base: Vec<Pose>,
    /// For each link, whether joints move it.
    moves: &'a [bool],
    /// By LAS `point_source_id`: shadows of robots as seen from the scanners that may have
    /// measured its points; world frame.
    shadows: BTreeMap<u16, Vec<&'a Shadow>>,
    /// By LAS `point_source_id`, where it belongs to one scanner: that scanner.
    eyes: BTreeMap<u16, ScannerAt>,
}

/// Sorted points of a tile.
struct SortedPoints {
    cells: Cells,
    n_waiting: usize,
    /// Cells of points attached to each link, and whether all beams to them grazed an edge.
    hung: BTreeMap<usize, BTreeMap<[i32; 3], bool>>,
}

impl Surroundings<'_> {
    /// Gathers bodies attached to the robot, and obstacles up to a distance along each axis of its
    /// base, metres: points, `others`, and space without beams.
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
        let shadows = self.outlines.near(robot, others, models, self.state, engine)?;
        let standing = |(number, fit): &(usize, &Fit)| {
            // The robot may return to each posture in which it was scanned.
            let all = std::iter::once(*fit).chain(&fit.stays);
            let placed = |fit: &Fit| {
                let model = &models[fit.model];
                let from_links = poses(fit, model).iter().map(|p| base_from_world * p).collect();
                (*number as i16, model, from_links)
            };
            all.map(placed).collect::<Vec<(i16, &Model, Vec<Pose>)>>()
        };
        let others: Vec<_> = others.iter().flat_map(standing).collect();
        let mut sorting = sorting(robot, far, &moves);
        sorting.shadows = self.shadows_by_source(&shadows);
        sorting.eyes = self.eyes(base_from_world);
        let (cells, hung) = self.points(&sorting, engine)?;
        let read = |entry: &SpaceEntry| {
            self.files.compared(&entry.grid)?;
            entry.read(self.out)
        };
        let space: Option<Space> = robot.entry.space.as_ref().map(read).transpose()?;
        let bounds = space.as_ref().map_or(Aabb::EMPTY, |space| space.grid().bounds());
        let known = KnownBounds { world_from_base: robot.fit.world_from_base, bounds };
        let new = || Obstacles::new(&cells, &others, space.as_ref(), known, &AllThreads);
        Ok((hung, engine.pool()?.install(new)))
    }

    /// Cells of all points that may be obstacles, and points attached to the robot.
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
            let mut own = SortedPoints::new(sorting);
            let (path, stated) = self.files.stated(&name)?;
            read_tile(&path, &las, stated, |points| {
                points.iter().try_for_each(|p| self.sort(sorting, p, &mut own))?;
                own.settle(SETTLED);
                engine.cancel.check()
            })?;
            own.settle(0);
            Ok(own)
        })?;
        let mut all = SortedPoints::new(sorting);
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

    /// Shadows by the `point_source_id` of points that may lie in them: files with such ids keep
    /// them, others use the number of the scan, from 1.
    fn shadows_by_source<'s>(&self, shadows: &'s [ScanShadow]) -> BTreeMap<u16, Vec<&'s Shadow>> {
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

    /// Known scanners whose points can be identified, by `point_source_id`.
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

    fn sort(&self, sorting: &Sorting<'_>, point: &OldPoint, into: &mut SortedPoints) -> Result<()> {
        let world = Point::from(point.world);
        let p = sorting.base_from_world * world;
        let label = point.label;
        let is_own = label.robot == sorting.number;
        // Attached points count wherever they are.
        let is_hung = is_own && label.kind == PointKind::Attachment;
        let is_inside = sorting.bounds().contains(p.coords.into());
        if !is_inside && !is_hung {
            return Ok(());
        }
        into.cells.add_measurement(&p, point.source_id);
        let shadows = sorting.shadows.get(&point.source_id);
        let is_grazed =
            shadows.is_some_and(|all| all.iter().all(|shadow| shadow.is_grazed(&world)));
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
                    // Points attached to its foot do not move.
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

    /// The obstacle that is another robot of the result.
    fn named(&self, number: i16, point: &OldPoint) -> Result<ObstacleKind> {
        if (number as usize) < self.result.robots.len() {
            return Ok(ObstacleKind::Robot(number));
        }
        let [x, y, z] = point.world;
        Err(Error::bad_input(format!(
            "a point at ({x:.3}, {y:.3}, {z:.3}) belongs to robot {number}, which is not in the result"
        ))
        .at(self.out.join("tiles").display())
        .hint("`stillpoint verify` tells whether the result is complete"))
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

/// Adds a point to the cells attached to a link.
fn meet(cells: &mut BTreeMap<[i32; 3], bool>, cell: [i32; 3], is_grazed: bool) {
    *cells.entry(cell).or_insert(is_grazed) &= is_grazed;
}

impl Sorting<'_> {
    /// Bounds of the surroundings, frame of the base, metres.
    fn bounds(&self) -> Aabb {
        Aabb { min: [-self.far; 3], max: [self.far; 3] }
    }
}

impl SortedPoints {
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
