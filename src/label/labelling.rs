//! Labels all points of the inputs, in the order of their files, and writes masks, clouds and
//! pictures.
//!
//! Tiles near robots are segmented, and bodies attached to robots are decided over all scans, which
//! gives a sorted list of labels by place. Then each input is streamed again: a point's label is
//! that of the list, or else that of its position alone (floor or fixed).

use super::cluster_lookup::ClusterLookup;
use super::known_space::{SpaceGrids, mark};
use super::label_strips::{LabelStrip, LabelledStrip};
use super::masks::{MaskCount, Masks};
use super::near_robots::{NearRobots, ScansNearRobots};
use crate::cache::Cache;
use crate::detect::robot_id::robot_id;
use crate::detect::robots::{FittedRobots, poses};
use crate::engine::{AllThreads, Engine, PipeSender, PipedItems, Task};
use crate::io::read_parts::InputReader;
use crate::job::Settings;
use crate::store::Store;
use attach::AttachedPieces;
use contract::{Cluster, Fit, Floor, Input, InputId, Mask, Result, Space, Verdict};
use export::{
    Clouds, FileSum, LasSettings, PROJECTION, Pack, PlanPicture, PlanRobot, Quantum, RawVlr,
    RobotPicture, SpaceEntry, Spool, Tiles, WrittenFiles, write_space,
};
use geometry::{Aabb, Point, Pose};
use ingest::{Sources, Want};
use robot::Model;
use segment::FloorHeights;
use std::path::Path;

/// Factor on the channel bytes for records that wait for their tiles, where memory is short.
const SPOOLED: usize = 8;

/// Job, scans, robots and floor that labelling reads.
pub(crate) struct Labelling<'a> {
    pub(super) fits: &'a [Fit],
    pub(super) models: &'a [Model],
    pub(super) sources: &'a Sources,
    floor: &'a Floor,
    clusters: &'a [Cluster],
    ground: FloorHeights,
    settings: segment::Settings,
    attach: attach::Settings,
    /// Bounds of each scan's points, world frame, metres.
    bounds: Vec<Aabb>,
    pub(super) export: export::Settings,
    /// Clusters, where each point is to get the number of its cluster.
    bodies: Option<ClusterLookup>,
    /// Where outlines of robots are kept for other processes.
    pub(super) outlines: Option<&'a Cache>,
}

/// The scans whose points are labelled, and floor and clusters in them.
pub(crate) struct ScansToLabel<'a> {
    pub(crate) sources: &'a Sources,
    pub(crate) store: &'a Store,
    pub(crate) floor: &'a Floor,
    pub(crate) clusters: &'a [Cluster],
}

/// Folders of the files that are written.
#[derive(Clone, Copy)]
pub(crate) struct LabelFolders<'l> {
    /// Folder of masks, tiles, pictures and files of robots.
    pub(crate) out: &'l Path,
    /// Folder of clouds.
    pub(crate) clouds: &'l Path,
}

/// Receivers of the points of the second pass besides masks and clouds.
struct PointTakers<'t> {
    spaces: &'t mut [Option<Space>],
    robots: &'t mut [RobotPicture],
    tiles: &'t mut Option<Tiles>,
}

/// Settings for labelling points and packing records.
struct SecondPass<'p> {
    near: &'p NearRobots,
    scope: &'p Scope,
    pack: &'p Pack,
    out: &'p Path,
}

/// The part of a plant that is written; the default is all of it.
#[derive(Default)]
pub(crate) struct Scope {
    /// Indices of the fits whose files are written; `None` for all.
    pub(crate) robots: Option<Vec<usize>>,
    /// As [`LabelStrip::cell`].
    pub(crate) cell: Option<Aabb>,
    /// As [`LabelStrip::moved`].
    pub(crate) moved: Vec<Option<Pose>>,
    /// Layout of LAS records, where clouds must match earlier ones.
    pub(crate) las: Option<LasSettings>,
    /// Whether spatial tiles are left open, so that more points can be added.
    pub(crate) leaves_open: bool,
    /// The only input that is read; `None` for all.
    pub(crate) input: Option<InputId>,
}

/// Counts and names of the files that were written.
pub(crate) struct WrittenLabels {
    pub(crate) clouds: WrittenFiles,
    /// For each mask the numbers of its entries, of dropped points and of points labelled as
    /// moving.
    pub(crate) masks: Vec<MaskCount>,
    /// Paths of pictures, relative to the output folder.
    pub(crate) pictures: Vec<String>,
    /// Entry of the known space of each robot.
    pub(crate) spaces: Vec<Option<SpaceEntry>>,
    /// Checksums of masks, tiles and clouds.
    pub(crate) digests: Vec<FileSum>,
    /// Layout of the LAS records of clouds.
    pub(crate) las: LasSettings,
    /// Messages about odd points of the inputs.
    pub(crate) oddities: Vec<String>,
}

/// State after masks and clouds are written; the files of robots are written by
/// [`Streamed::finish`].
pub(crate) struct Streamed<'l> {
    pub(super) labelling: &'l Labelling<'l>,
    pub(super) near: &'l NearRobots,
    /// Known space of each fit.
    pub(super) spaces: Vec<Option<Space>>,
    /// Indices of the fits whose files are written, with their pictures.
    pub(super) robots: Vec<(usize, RobotPicture)>,
    /// Tiles that were left open.
    pub(super) open: Vec<Spool>,
    pub(super) out: &'l Path,
    pub(super) done: WrittenLabels,
}

impl Streamed<'_> {
    /// Takes the spatial tiles that were left open.
    pub(crate) fn take_open(&mut self) -> Vec<Spool> {
        std::mem::take(&mut self.open)
    }

    /// Takes the spaces of all fits so that more can be marked in them; they are then not written
    /// here.
    pub(crate) fn take_spaces(&mut self) -> Vec<Option<Space>> {
        let none = vec![None; self.spaces.len()];
        std::mem::replace(&mut self.spaces, none)
    }

    /// Writes the files of robots.
    pub(crate) fn finish(mut self, engine: &Engine) -> Result<WrittenLabels> {
        let shown = self.robots.iter().map(|(i, picture)| (*i, picture)).collect();
        let written = engine.each(shown, |(i, picture)| {
            let space = self.spaces[i].as_ref();
            self.labelling.write_robot(i, &self.near.hanging[i], space, picture, self.out)
        })?;
        for ((i, _), (space, names)) in self.robots.iter().zip(written) {
            self.done.spaces[*i] = space;
            self.done.pictures.extend(names);
        }
        Ok(self.done)
    }
}

impl<'a> Labelling<'a> {
    pub(crate) fn new(
        robots: FittedRobots<'a>,
        scans: &ScansToLabel<'a>,
        settings: &Settings,
    ) -> Self {
        let FittedRobots { fits, models } = robots;
        let &ScansToLabel { sources, store, floor, clusters } = scans;
        let ground = FloorHeights::new(floor, &settings.segment);
        let mut bounds = vec![Aabb::EMPTY; sources.scans.len()];
        for entry in store.entries() {
            let scan = &mut bounds[entry.at.scan.0 as usize];
            *scan = scan.union(&entry.bounds);
        }
        let export = settings.export;
        let bodies = export.bodies.then(|| ClusterLookup::new(clusters));
        let (settings, attach) = (settings.segment, settings.attach);
        Self {
            fits,
            models,
            sources,
            floor,
            clusters,
            ground,
            settings,
            attach,
            bounds,
            export,
            bodies,
            outlines: None,
        }
    }

    /// The robots with their models.
    pub(super) fn robots(&self) -> FittedRobots<'a> {
        FittedRobots { fits: self.fits, models: self.models }
    }

    /// The floor, for the label of a point that is near no robot.
    pub(crate) fn ground(&self) -> &FloorHeights {
        &self.ground
    }

    /// Labels of points near the robots, and the bodies attached to them.
    pub(crate) fn near_robots(&self, store: &Store, engine: &Engine) -> Result<NearRobots> {
        let robots = self.robots();
        let (scans, n_masks) = (self.sources.scans.as_slice(), self.sources.masks.len());
        let scans =
            ScansNearRobots { store, floor: self.floor, clusters: self.clusters, scans, n_masks };
        NearRobots::find(robots, &scans, self.settings, self.attach, engine)
    }

    /// Streams every input again and writes its labels and tiles, and clouds to their own folder;
    /// then entries and files of robots.
    pub(crate) fn write<'l>(
        &'l self,
        near: &'l NearRobots,
        mut spaces: Vec<Option<Space>>,
        scope: &Scope,
        to: LabelFolders<'l>,
        engine: &Engine,
    ) -> Result<Streamed<'l>> {
        let out = to.out;
        let las = scope.las.clone().unwrap_or_else(|| self.las());
        let waiting_bytes = self.export.waiting_bytes.min(SPOOLED * engine.channel_bytes);
        let export = export::Settings { waiting_bytes, ..self.export };
        let records = export.records(&las);
        let mut tiles = Tiles::create(out, &records, &export)?;
        let mut clouds = Clouds::create(to.clouds, &records, &export)?;
        let mut masks = Masks::new(out, self.masks_of(scope));
        let is_written = |i: &usize| scope.robots.as_ref().is_none_or(|r| r.contains(i));
        let chosen: Vec<usize> = (0..self.fits.len()).filter(is_written).collect();
        let mut robots = self.robot_pictures(&chosen, engine)?;
        let pack = Pack::of_clouds(&records, &export);
        // Tiles have as many bytes as masks and clouds together, so each of the two has its own
        // writing thread.
        let apart = |strips: PipedItems<'_, LabelledStrip>| {
            for strip in strips {
                let strip = strip?;
                masks.add(&strip)?;
                clouds.add(&strip.packed)?;
            }
            Ok((masks.finish()?, clouds.finish()?))
        };
        let along = |hand: PipeSender<'_, LabelledStrip>| {
            let pass = SecondPass { near, scope, pack: &pack, out };
            let takers =
                PointTakers { spaces: &mut spaces, robots: &mut robots, tiles: &mut tiles };
            let pictures = self.stream(&pass, takers, engine, hand)?;
            let Some(tiles) = tiles else { return Ok((Vec::new(), Vec::new(), pictures)) };
            if scope.leaves_open {
                return Ok((Vec::new(), tiles.open(), pictures));
            }
            let finished = engine.pool()?.install(|| tiles.finish(&AllThreads))?;
            Ok((finished, Vec::new(), pictures))
        };
        let (((masks, mut digests), (moving, fixed)), (tiles, open, pictures)) =
            engine.pipe("clouds", apart, along)?;
        let clouds = WrittenFiles { tiles, robots: moving, fixed };
        digests.extend(clouds.sums().cloned());
        let said = vec![None; self.fits.len()];
        let oddities = self.read_inputs(scope).iter();
        let oddities = oddities.flat_map(|input| self.sources.oddities_of(input.id)).collect();
        let done = WrittenLabels { clouds, masks, pictures, spaces: said, digests, las, oddities };
        let robots = chosen.into_iter().zip(robots).collect();
        Ok(Streamed { labelling: self, near, spaces, robots, open, out, done })
    }

    /// Streams every input again: marks spaces, draws pictures, adds records to tiles and passes
    /// strips on to `hand`. Returns the names of the plans that were drawn.
    fn stream(
        &self,
        pass: &SecondPass<'_>,
        takers: PointTakers<'_>,
        engine: &Engine,
        hand: PipeSender<'_, LabelledStrip>,
    ) -> Result<Vec<String>> {
        let &SecondPass { near, scope, pack, out } = pass;
        let PointTakers { spaces, robots, tiles } = takers;
        let grids = SpaceGrids::of(spaces);
        let shown: Vec<Aabb> = robots.iter().map(|r| *r.bounds()).collect();
        let (disks, mut pictures) = (engine.disks()?, Vec::new());
        for input in self.read_inputs(scope) {
            let heights = self.floor.levels.iter().flat_map(|level| &level.heights);
            let highest = heights.map(|(_, height)| *height).max_by(f64::total_cmp);
            let plan = PlanPicture::new(&self.bounds_of(input.id)).over_floor(highest);
            let label = LabelStrip {
                near: &near.labels,
                ground: &self.ground,
                scans: &self.sources.scans,
                grids: &grids,
                shown: &shown,
                plan: &plan,
                pack: pack.clone(),
                cell: scope.cell,
                moved: &scope.moved,
                bodies: self.bodies.as_ref(),
            };
            self.each_strip(input, &label, engine, |mut strip| {
                mark(spaces, strip.spots.drain(..));
                for (robot, point, label) in strip.shown.drain(..) {
                    robots[robot].add(point, label);
                }
                tiles.iter_mut().try_for_each(|tiles| tiles.add(&strip.packed, &disks))?;
                hand(strip)
            })?;
            pictures.push(self.draw_plan(&plan, input.id, out)?);
        }
        Ok(pictures)
    }

    /// The inputs that are read, which are consecutive.
    fn read_inputs(&self, scope: &Scope) -> &'a [Input] {
        let all = self.sources.opened();
        let at = scope.input.and_then(|id| all.iter().position(|input| input.id == id));
        at.map_or(all, |at| &all[at..=at])
    }

    /// The masks of the inputs that are read.
    fn masks_of(&self, scope: &Scope) -> &'a [Mask] {
        let all = self.sources.opened_masks();
        let Some(id) = scope.input else { return all };
        let first = all.partition_point(|mask| mask.input < id);
        &all[first..first + all[first..].partition_point(|mask| mask.input == id)]
    }

    /// Streams an input again and passes labelled strips on, in the order of the file.
    fn each_strip(
        &self,
        input: &Input,
        label: &LabelStrip<'_>,
        engine: &Engine,
        sink: impl FnMut(LabelledStrip) -> Result<()>,
    ) -> Result<()> {
        let reading = InputReader { sources: self.sources, input, want: Want::Everything };
        let task = Task::new("write").of(reading.amount());
        reading.each(task, label, None, engine, sink)
    }

    /// Writes the files of one robot: model, space and pictures. Returns the entry of its space and
    /// the names of the pictures.
    fn write_robot(
        &self,
        i: usize,
        hanging: &AttachedPieces,
        space: Option<&Space>,
        picture: &RobotPicture,
        out: &Path,
    ) -> Result<(Option<SpaceEntry>, [String; 2])> {
        let (fit, id) = (&self.fits[i], robot_id(i));
        let model = &self.models[fit.model];
        export::write_robot(out, &id, fit, model, hanging)?;
        let space = space.map(|space| write_space(out, &id, space)).transpose()?;
        let names = [format!("pictures/{id}.png"), format!("pictures/{id}_evidence.png")];
        let title = format!("{id} {} {}", fit.model_name, fit.verdict.word());
        picture.draw(&title).write(&out.join(&names[0]))?;
        export::draw_evidence(&title, picture, fit, model).write(&out.join(&names[1]))?;
        Ok((space, names))
    }

    pub(super) fn las(&self) -> LasSettings {
        let with_color = self.sources.has_color();
        // Tiles are in the same coordinates as the LAS inputs, so that they share their system.
        let system = self.sources.system().into_iter().flat_map(|system| &system.records);
        let vlrs = system.map(|(record_id, data)| RawVlr {
            user_id: PROJECTION.into(),
            record_id: *record_id,
            description: String::new(),
            data: data.clone(),
        });
        let vlrs = vlrs.collect();
        LasSettings { with_color, vlrs, ..LasSettings::new(self.quantum()) }
    }

    /// Scale and offset of the clouds: those of a LAS input where they are valid for all points, so
    /// that its coordinates stay the same.
    fn quantum(&self) -> Quantum {
        let all = self.bounds.iter().fold(Aabb::EMPTY, |all, bounds| all.union(bounds));
        let of_input = self.sources.las_quantum();
        Quantum::holding(&all, of_input.map(|(scale, offset)| Quantum { scale, offset }))
    }

    /// A robot as the plan shows it: one that was refused without outline and reach.
    fn robot_in_plan(&self, i: usize) -> PlanRobot {
        let fit = &self.fits[i];
        let p = fit.world_from_base.translation.vector;
        let name = robot_id(i);
        if fit.verdict == Verdict::Refused {
            return PlanRobot { name, at: [p.x, p.y], reach: 0.0, body: Vec::new() };
        }
        let model = &self.models[fit.model];
        let poses = poses(fit, model);
        let body = poses.iter().zip(&model.links).flat_map(|(pose, link)| {
            link.cad.points.iter().map(move |point| {
                let world = pose * Point::from(point.map(f64::from));
                [world.x, world.y]
            })
        });
        PlanRobot { name, at: [p.x, p.y], reach: model.reach(), body: body.collect() }
    }

    fn draw_plan(
        &self,
        plan: &PlanPicture,
        input: InputId,
        out: &std::path::Path,
    ) -> Result<String> {
        let robots: Vec<PlanRobot> = (0..self.fits.len()).map(|i| self.robot_in_plan(i)).collect();
        let scanners: Vec<_> = self
            .sources
            .scans
            .iter()
            .filter(|s| s.input == input && s.has_beams())
            .map(|s| {
                (s.name.clone(), [s.world_from_scan.translation.x, s.world_from_scan.translation.y])
            })
            .collect();
        let path = &self.sources.inputs[input.0 as usize].path;
        let title = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        let name = format!("pictures/plan_{}.png", input.0);
        plan.draw(&title, &robots, &scanners).write(&out.join(&name))?;
        Ok(name)
    }

    pub(super) fn bounds_of(&self, input: InputId) -> Aabb {
        let own = self.sources.scans.iter().zip(&self.bounds).filter(|(s, _)| s.input == input);
        own.fold(Aabb::EMPTY, |all, (_, bounds)| all.union(bounds))
    }
}
