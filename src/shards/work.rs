//! The work of one shard: one step of the plan, whose result becomes a piece of the store.

use super::list::Shard;
use super::listing::{GroundAndRegions, Listing, PART, ShardTask, input_tiles, keep_ground};
use crate::cache::{Cache, Key, settle_folder};
use crate::detect::ground::{Ground, GroundPart};
use crate::detect::robots::RobotList;
use crate::detect::search::{PreparedLibrary, Search};
use crate::detect::tools::attach_tools;
use crate::engine::guarded;
use crate::job::Outcome;
use crate::label::input_labels;
use crate::label::joined_files::{self, FileGroup};
use crate::label::known_space::KnownSpaces;
use crate::label::labelling::{Labelling, ScansToLabel};
use crate::label::near_robots::NearRobots;
use crate::plan::{Opened, Run};
use crate::store::{Store, spatial_tiles};
use contract::{Error, Fit, Kind, Region, Result};
use export::atomic;
use serde::Serialize;
use std::path::Path;

/// How a shard came to be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum HowDone {
    /// This process has made it.
    Made,
    /// It was there already, or another process was faster.
    Before,
    /// The job goes on without it.
    LeftOut,
    /// The result can be gathered now.
    #[serde(skip)]
    Ready,
}

/// A shard that is made, for the engine that asked for it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DoneShard {
    /// Its id.
    pub id: String,
    /// How it was made.
    pub how: HowDone,
    /// Wall-clock time, seconds.
    pub seconds: f64,
    /// What it was about; `None` for a shard of a job that is finished.
    #[serde(skip)]
    pub shard: Option<Shard>,
    /// Outcome of the job, where the shard was its last.
    #[serde(skip)]
    pub outcome: Option<Outcome>,
}

impl DoneShard {
    pub(super) fn of(shard: Shard, how: HowDone) -> Self {
        Self { id: shard.id.clone(), how, seconds: 0.0, shard: Some(shard), outcome: None }
    }

    /// A shard of a job whose result is there.
    pub(super) fn late(id: &str) -> Self {
        Self { id: id.into(), how: HowDone::Before, seconds: 0.0, shard: None, outcome: None }
    }
}

/// Does the work of the shard at a position of the list, whose needs are all made.
pub(super) fn work(run: &Run<'_>, listing: &Listing, at: usize) -> Result<HowDone> {
    let task = listing.shards[at].1;
    let Listing { opened, tiles, plant, .. } = listing;
    match task {
        ShardTask::Tiles(at) => {
            let input = &opened.sources.inputs[at];
            input_tiles(run, opened).of_one(input, run.digests)?;
        }
        ShardTask::Planes(at) => planes(run, opened, at)?,
        _ => {
            let (keys, store) =
                input_tiles(run, opened).of_all(&opened.sources.inputs, run.digests)?;
            if tiles.as_ref() != Some(&keys) {
                return Err(Error::new(Kind::Io, "the tiles of the job have changed meanwhile")
                    .hint("list the shards again"));
            }
            match (task, plant) {
                (ShardTask::Ground, _) => ground(run, opened, &keys, store)?,
                (_, Some(plant)) => {
                    let of = OfPlant { run, opened, tiles: &keys, store, plant };
                    of.work(task)?;
                }
                _ => return Err(Error::new(Kind::Bug, "a shard of an unknown plant is made")),
            }
        }
    }
    Ok(HowDone::Made)
}

/// Planes and occupied space of one input.
fn planes(run: &Run<'_>, opened: &Opened, at: usize) -> Result<()> {
    let (input, scans) = (&opened.sources.inputs[at], &opened.sources.scans);
    let (_, store) = input_tiles(run, opened).of_one(input, run.digests)?;
    let part = Ground::part(scans, &store, run.settings, run.engine)?;
    let key = run.digests.ground_part_key(input, scans, run.settings);
    let key = key.ok_or_else(|| Error::new(Kind::Bug, "an input has no digest"))?;
    Cache::new(run.output.fits(), key).keep(PART, &part)
}

/// The ground of the plant.
fn ground(run: &Run<'_>, opened: &Opened, tiles: &[Key], store: Store) -> Result<()> {
    let (scans, settings) = (&opened.sources.scans, run.settings);
    // A run ends here where its result would have too many tiles.
    spatial_tiles::checked(store, scans, &settings.export, run.engine)?;
    let parts = opened.sources.inputs.iter().map(|input| -> Result<GroundPart> {
        let key = run.digests.ground_part_key(input, scans, settings);
        let part = key.and_then(|key| Cache::new(run.output.fits(), key).get(PART));
        part.ok_or_else(|| {
            Error::new(Kind::Io, "the planes of an input are missing or damaged")
                .at(input.path.display())
                .hint("remove the store of the job, and start it again")
        })
    });
    let ground = Ground::join(parts, scans, settings)?;
    keep_ground(run, tiles, &ground)
}

/// A plant whose regions are known.
struct OfPlant<'a> {
    run: &'a Run<'a>,
    opened: &'a Opened,
    tiles: &'a [Key],
    store: Store,
    plant: &'a GroundAndRegions,
}

impl OfPlant<'_> {
    fn work(&self, task: ShardTask) -> Result<()> {
        let Self { run, opened, tiles, store, plant } = self;
        let kept = || Cache::new(run.output.fits(), run.digests.fits_key(tiles, run.settings));
        let (fits, pieces) = (kept(), kept());
        let library = PreparedLibrary::new(&opened.library.models);
        let scans = &opened.sources.scans;
        let search = Search::new(&library, scans, store, &plant.ground, run.settings);
        let search = search.over(&plant.regions).keeping(&pieces);
        match task {
            ShardTask::Region(at) => self.region(&plant.regions[at], &search, &fits),
            ShardTask::Robots => self.robots(&search, &fits),
            ShardTask::Space(at) => self.space(at, &search),
            ShardTask::Labels(at) => self.labels(at, &search),
            ShardTask::Files(group) => self.files(group),
            _ => Err(Error::new(Kind::Bug, "this shard is made without a plant")),
        }
    }

    fn region(&self, region: &Region, search: &Search<'_, '_>, fits: &Cache) -> Result<()> {
        let find = || {
            let fits = search.region(region)?;
            self.likely_tools(&fits, search);
            Ok(fits)
        };
        let found: Vec<Vec<Fit>> = self.run.engine.fan_out("fit", vec![()], |()| {
            guarded("fit", 0, || fits.get_or_compute(&format!("{region:?}"), find))
        })?;
        drop(found);
        Ok(())
    }

    /// Looks for tools of the robots that this region alone would have, while its models are
    /// prepared: the choice among all regions, which one process makes, finds most of them in the
    /// store. What is wrong with one is told there.
    fn likely_tools(&self, fits: &[Fit], search: &Search<'_, '_>) {
        let mut models = self.opened.library.models.clone();
        let likely = fit::choose(fits.to_vec(), &models, |_| false);
        let _ = attach_tools(likely, &mut models, search, self.run.engine);
    }

    /// Chooses the robots among the fits of all regions, and labels the points near them.
    fn robots(&self, search: &Search<'_, '_>, fits: &Cache) -> Result<()> {
        let Self { run, opened, tiles, plant, .. } = self;
        let failures = run.region_failures();
        let found = run.engine.fan_out("fit", plant.regions.clone(), |region| {
            let find = || search.region(&region);
            failures.spare(&region, || fits.get_or_compute(&format!("{region:?}"), find))
        })?;
        let chosen = run.chosen(tiles);
        let find = || run.robots(found.concat(), search, opened, &plant.ground);
        let (robots, _) = run.kept_robots(Some(&chosen), &opened.library, find)?;
        let near = self.labelling(&robots).near_robots(&self.store, run.engine)?;
        near.keep(&chosen, &opened.sources.masks)
    }

    /// The robots that were chosen before.
    fn chosen(&self) -> Result<(Cache, RobotList)> {
        let chosen = self.run.chosen(self.tiles);
        let lost = || {
            Err(Error::new(Kind::Io, "the robots of the job are missing in its store")
                .hint("list the shards again"))
        };
        let (robots, _) = self.run.kept_robots(Some(&chosen), &self.opened.library, lost)?;
        Ok((chosen, robots))
    }

    fn labelling<'l>(&'l self, robots: &'l RobotList) -> Labelling<'l> {
        let Self { run, opened, store, plant, .. } = self;
        let (sources, floor) = (&opened.sources, &plant.ground.surfaces.floor);
        let scans = ScansToLabel { sources, store, floor, clusters: &plant.clusters };
        Labelling::new(robots.view(), &scans, run.settings)
    }

    fn space(&self, at: usize, search: &Search<'_, '_>) -> Result<()> {
        let (chosen, robots) = self.chosen()?;
        let spaces = KnownSpaces { robots: robots.view(), search, settings: self.run.settings };
        let grid = spaces.grids().get(at).copied().flatten();
        let grid = grid.ok_or_else(|| Error::new(Kind::Bug, "a robot has no space"))?;
        let one = |()| chosen.get_or_compute(&KnownSpaces::piece(at), || spaces.one(at, grid));
        self.run.engine.fan_out("space", vec![()], one).map(drop)
    }

    /// Joins a group of files from the labels of all inputs.
    fn files(&self, group: FileGroup) -> Result<()> {
        let Self { run, opened, .. } = self;
        let (chosen, robots) = self.chosen()?;
        let pieces = run.label_folders(&chosen, &opened.sources.inputs);
        let groups = run.file_groups(&chosen, &opened.sources);
        let place = groups.into_iter().find(|(other, _)| *other == group);
        let (_, place) = place.ok_or_else(|| Error::new(Kind::Bug, "no such group of files"))?;
        let prefix = format!("new-files-{}-", group.at);
        let new = run.output.labels().join(format!("{prefix}{}", atomic::own_word()));
        let labelling = self.labelling(&robots);
        let written = joined_files::write(&labelling, &pieces, group, &new, run.engine);
        settled(written, &new, &place, &prefix, joined_files::is_whole)
    }

    fn labels(&self, at: usize, search: &Search<'_, '_>) -> Result<()> {
        let Self { run, opened, .. } = self;
        let (chosen, robots) = self.chosen()?;
        let spaces = KnownSpaces { robots: robots.view(), search, settings: run.settings };
        let input = &opened.sources.inputs[at];
        let near = NearRobots::kept(&chosen, &opened.sources.masks, Some(input.id))?;
        let prefix = format!("new-{at}-");
        let new = run.output.labels().join(format!("{prefix}{}", atomic::own_word()));
        let place = &run.label_folders(&chosen, std::slice::from_ref(input))[0];
        let grids = spaces.grids();
        let labelling = self.labelling(&robots).keeping(&chosen);
        let written = input_labels::write(labelling, &near, &grids, input, &new, run.engine);
        let written = written.and_then(|()| run.digests.check(input));
        settled(written, &new, place, &prefix, input_labels::is_whole)
    }
}

/// Gives the new folder of a piece its place, or removes it where it could not be written.
fn settled(
    written: Result<()>,
    new: &Path,
    place: &Path,
    prefix: &str,
    is_whole: impl Fn(&Path) -> bool,
) -> Result<()> {
    if let Err(error) = written {
        let _ = std::fs::remove_dir_all(new);
        return Err(error);
    }
    settle_folder(new, place, prefix, is_whole)
}
