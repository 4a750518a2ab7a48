//! Fits in; the label of every point out, in the order of its file, written as masks, clouds and
//! pictures.
//!
//! Tiles near robots are segmented and what hangs on the robots is decided over all scans; that
//! leaves a sorted list of labels by place. Then each input is streamed once more: a point's label
//! is that of the list, or else that of its place alone (floor or fixed).

use super::cluster_lookup::ClusterLookup;
use super::known_space::{SpaceGrids, mark, poses};
use super::label_strips::{LabelStrip, LabelledStrip};
use super::masks::{MaskCount, Masks};
use super::near_robots::{NearRobots, ScansNearRobots};
use crate::detect::robot_id::robot_id;
use crate::detect::robots::FittedRobots;
use crate::engine::{AllThreads, Engine, PipeSender, PipedItems, Task};
use crate::io::read_parts::InputReader;
use crate::job::Settings;
use crate::store::Store;
use attach::AttachedPieces;
use contract::{Cluster, Fit, Floor, Input, InputId, Result, Space};
use export::{
    Clouds, FileSum, LasSettings, Pack, PlanPicture, Quantum, RobotPicture, SpaceEntry, Spool,
    Tiles, WrittenFiles, write_space,
};
use geometry::{Aabb, Pose};
use ingest::{Sources, Want};
use robot::Model;
use segment::FloorHeights;
use std::path::Path;

/// Records that wait for their tiles may take so many times what a channel does, where memory is
/// short.
const SPOOLED: usize = 8;

/// What labelling reads.
pub(crate) struct Labelling<'a> {
    fits: &'a [Fit],
    models: &'a [Model],
    sources: &'a Sources,
    floor: &'a Floor,
    ground: FloorHeights,
    settings: segment::Settings,
    attach: attach::Settings,
    /// World bounds of each scan's points, metres.
    bounds: Vec<Aabb>,
    export: export::Settings,
    /// Where points are to be told which body is theirs.
    bodies: Option<ClusterLookup>,
}

/// The scans whose points are labelled, and what stands in them besides robots.
pub(crate) struct ScansToLabel<'a> {
    pub(crate) sources: &'a Sources,
    pub(crate) store: &'a Store,
    pub(crate) floor: &'a Floor,
    pub(crate) clusters: &'a [Cluster],
}

/// Where files go.
#[derive(Clone, Copy)]
pub(crate) struct LabelFolders<'l> {
    /// Masks, tiles, pictures and files of robots.
    pub(crate) out: &'l Path,
    /// Clouds.
    pub(crate) clouds: &'l Path,
}

/// What takes the points of the second pass, beside masks and clouds.
struct PointTakers<'t> {
    spaces: &'t mut [Option<Space>],
    robots: &'t mut [RobotPicture],
    tiles: &'t mut Option<Tiles>,
}

/// How points are labelled and packed.
struct SecondPass<'p> {
    near: &'p NearRobots,
    scope: &'p Scope,
    pack: &'p Pack,
    out: &'p Path,
}

/// Which part of a plant is written: all of it, unless said otherwise.
#[derive(Default)]
pub(crate) struct Scope {
    /// Robots whose files are written, by their places among the fits; all where left out.
    pub(crate) robots: Option<Vec<usize>>,
    /// As in [`LabelStrip`].
    pub(crate) cell: Option<Aabb>,
    /// As in [`LabelStrip`].
    pub(crate) moved: Vec<Option<Pose>>,
    /// What records hold, where clouds are to be like others.
    pub(crate) las: Option<LasSettings>,
    /// Whether spatial tiles are left open: something else comes into them.
    pub(crate) leaves_open: bool,
}

/// What was written.
pub(crate) struct WrittenLabels {
    pub(crate) clouds: WrittenFiles,
    /// For each mask: entries, points that were dropped, and points that are said to move.
    pub(crate) masks: Vec<MaskCount>,
    /// Pictures, relative to the output folder.
    pub(crate) pictures: Vec<String>,
    /// What is known of the space around each robot.
    pub(crate) spaces: Vec<Option<SpaceEntry>>,
    /// Checksums of the files that are as large as the cloud.
    pub(crate) digests: Vec<FileSum>,
    /// What records of the clouds hold.
    pub(crate) las: LasSettings,
}

/// Masks and clouds that are written; the files of robots are still to be.
pub(crate) struct Streamed<'l> {
    labelling: &'l Labelling<'l>,
    near: &'l NearRobots,
    /// By fit.
    spaces: Vec<Option<Space>>,
    /// Fits whose files are to be written, with their pictures.
    robots: Vec<(usize, RobotPicture)>,
    /// Tiles that were left open.
    open: Vec<Spool>,
    out: &'l Path,
    done: WrittenLabels,
}

impl Streamed<'_> {
    /// The tiles that were left open.
    pub(crate) fn take_open(&mut self) -> Vec<Spool> {
        std::mem::take(&mut self.open)
    }

    /// The spaces, by fit, where something else is still to be marked in them; they are not written
    /// then.
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
        Self { fits, models, sources, floor, ground, settings, attach, bounds, export, bodies }
    }

    /// The floor, for the label of a point that is near no robot.
    pub(crate) fn ground(&self) -> &FloorHeights {
        &self.ground
    }

    /// The labels of points near the robots, and what hangs on them.
    pub(crate) fn near_robots(&self, store: &Store, engine: &Engine) -> Result<NearRobots> {
        let robots = FittedRobots { fits: self.fits, models: self.models };
        let (scans, n_masks) = (self.sources.scans.as_slice(), self.sources.masks.len());
        let scans = ScansNearRobots { store, floor: self.floor, scans, n_masks };
        NearRobots::find(robots, &scans, self.settings, self.attach, engine)
    }

    /// Streams every input once more and writes its labels and tiles, clouds to another folder;
    /// then what is said of robots.
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
        let mut masks = Masks::new(out, self.sources.opened_masks());
        let is_written = |i: &usize| scope.robots.as_ref().is_none_or(|r| r.contains(i));
        let chosen: Vec<usize> = (0..self.fits.len()).filter(is_written).collect();
        let mut robots = self.robot_pictures(&chosen, engine)?;
        let pack = Pack::of_clouds(&records, &export);
        // Tiles are as many bytes as masks and clouds: each has a thread that copies them to their
        // files.
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
        let done = WrittenLabels { clouds, masks, pictures, spaces: said, digests, las };
        let robots = chosen.into_iter().zip(robots).collect();
        Ok(Streamed { labelling: self, near, spaces, robots, open, out, done })
    }

    /// Streams every input once more: into spaces, pictures of robots and tiles, and on to `hand`;
    /// names of the plans drawn.
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
        for input in self.sources.opened() {
            let plan = PlanPicture::new(&self.bounds_of(input.id));
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

    /// Streams an input once more; labelled strips in the order of the file.
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

    /// The files of one robot: model, space, pictures; what is said of its space, and the pictures'
    /// names.
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
        let title = format!("{id} {} {}", fit.model_name, fit.label_verdict().word());
        picture.draw(&title).write(&out.join(&names[0]))?;
        export::draw_evidence(&title, picture, fit, model).write(&out.join(&names[1]))?;
        Ok((space, names))
    }

    fn las(&self) -> LasSettings {
        let with_color = self.sources.has_color();
        LasSettings { with_color, ..LasSettings::new(self.quantum()) }
    }

    /// Scale and offset of the clouds: those of a LAS input where they hold, so that its
    /// coordinates stay what they are.
    fn quantum(&self) -> Quantum {
        let all = self.bounds.iter().fold(Aabb::EMPTY, |all, bounds| all.union(bounds));
        let of_input = self.sources.las_quantum();
        Quantum::holding(&all, of_input.map(|(scale, offset)| Quantum { scale, offset }))
    }

    fn robot_pictures(&self, chosen: &[usize], engine: &Engine) -> Result<Vec<RobotPicture>> {
        engine.each(chosen.to_vec(), |i| {
            let fit = &self.fits[i];
            let model = &self.models[fit.model];
            Ok(RobotPicture::new(i as i16, model, &poses(fit, model), &AllThreads))
        })
    }

    fn draw_plan(
        &self,
        plan: &PlanPicture,
        input: InputId,
        out: &std::path::Path,
    ) -> Result<String> {
        let robots: Vec<_> = self
            .fits
            .iter()
            .enumerate()
            .map(|(i, f)| {
                let p = f.world_from_base.translation.vector;
                (robot_id(i), [p.x, p.y])
            })
            .collect();
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

    fn bounds_of(&self, input: InputId) -> Aabb {
        let own = self.sources.scans.iter().zip(&self.bounds).filter(|(s, _)| s.input == input);
        own.fold(Aabb::EMPTY, |all, (_, bounds)| all.union(bounds))
    }
}
