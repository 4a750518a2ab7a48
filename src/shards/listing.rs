//! The list of a job's shards as the store has them: what is made, what can be made, and what
//! waits for others.

use super::list::{SCHEMA, Shard, ShardKind, ShardList, ShardState};
use crate::cache::input_tiles::InputTiles;
use crate::cache::{Cache, Key};
use crate::detect::ground::Ground;
use crate::detect::robots::{KeptRobots, RobotList};
use crate::estimate::shard_costs::{ShardCost, ShardCosts};
use crate::label::input_labels;
use crate::label::joined_files::{self, FileGroup};
use crate::label::known_space::KnownSpaces;
use crate::label::near_robots::NearRobots;
use crate::plan::{Opened, ROBOTS, Run};
use contract::{Cluster, Input, Region, Result};
use std::path::Path;

/// Name of the piece of what an input adds to the ground.
pub(super) const PART: &str = "part";
/// Name of the piece of the ground.
const GROUND: &str = "ground";
/// Name of the piece of what stands about in the plant, and its regions.
const BODIES: &str = "bodies";
/// Number of digits of an id, of its digest: enough for a billion shards.
const DIGITS: usize = 16;

/// What a shard is about: numbers of inputs, regions and robots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ShardTask {
    Tiles(usize),
    Planes(usize),
    Ground,
    Region(usize),
    Robots,
    Space(usize),
    Labels(usize),
    Files(FileGroup),
    Gather,
}

/// The shards of a job with what was found out on the way, which their work needs.
pub(super) struct Listing {
    pub(super) opened: Opened,
    pub(super) shards: Vec<(Shard, ShardTask)>,
    /// Keys of the tiles of all inputs, where all of them are known.
    pub(super) tiles: Option<Vec<Key>>,
    pub(super) plant: Option<GroundAndRegions>,
}

/// What is known when the ground is joined.
pub(super) struct GroundAndRegions {
    pub(super) ground: Ground,
    pub(super) clusters: Vec<Cluster>,
    pub(super) regions: Vec<Region>,
}

/// Id of the shard of a kind that is about `of`.
fn id(run: &Run<'_>, kind: &str, of: &impl std::fmt::Debug) -> String {
    let key = run.digests.shard_key(run.job, kind, of);
    format!("{kind}-{}", &key.name()[..DIGITS])
}

/// Id of the shard that makes the tiles of an input.
pub(super) fn tiles_id(run: &Run<'_>, path: &Path) -> String {
    id(run, "tiles", &path)
}

/// A list that grows shard by shard.
struct Growing<'r> {
    run: &'r Run<'r>,
    shards: Vec<(Shard, ShardTask)>,
}

/// Facts of a shard that is added to the list.
struct Added<'s> {
    task: ShardTask,
    kind: ShardKind,
    id: String,
    what: String,
    inputs: &'s [&'s Input],
    needs: Vec<String>,
    cost: ShardCost,
    is_done: bool,
}

impl Growing<'_> {
    /// Adds a shard and returns its id.
    fn add(&mut self, new: Added<'_>) -> String {
        let is_ready = new.needs.iter().all(|id| self.is_done(id));
        let state = match (new.is_done, is_ready) {
            (true, _) => ShardState::Done,
            (false, true) => ShardState::Ready,
            (false, false) => ShardState::Waiting,
        };
        let shard = Shard {
            id: new.id.clone(),
            kind: new.kind,
            what: new.what,
            inputs: new.inputs.iter().map(|input| input.path.display().to_string()).collect(),
            needs: new.needs,
            seconds: new.cost.seconds,
            memory_bytes: new.cost.memory_bytes,
            opens: matches!(new.kind, ShardKind::Ground | ShardKind::Robots),
            state,
        };
        self.shards.push((shard, new.task));
        new.id
    }

    fn is_done(&self, id: &str) -> bool {
        let known = self.shards.iter().find(|(shard, _)| shard.id == id);
        known.is_none_or(|(shard, _)| shard.state == ShardState::Done)
    }
}

impl Listing {
    /// Lists the shards of a job.
    ///
    /// # Errors
    /// Inputs, library or settings that cannot be used.
    pub(super) fn of(run: &Run<'_>) -> Result<Self> {
        let models = Cache::new(run.output.models(), run.digests.models_key(run.settings));
        let opened = run.open(&models)?;
        let mut list = Growing { run, shards: Vec::new() };
        let n_models = opened.library.models.len();
        let costs = ShardCosts::new(&opened.sources, &run.job.means, n_models);
        let (tiles, planes) = list.inputs(&opened, &costs);
        let ground = list.ground(&opened, &costs, tiles.as_deref(), planes);
        let known = tiles.as_deref().filter(|_| list.is_done(&ground));
        let plant = known.and_then(|tiles| plant(run, tiles));
        let last = match (&tiles, &plant) {
            (Some(tiles), Some(plant)) => list.search(&opened, &costs, tiles, plant)?,
            _ => vec![ground],
        };
        let id = id(run, "gather", &last);
        let inputs: Vec<&Input> = opened.sources.inputs.iter().collect();
        // What it needs is known only when the robots are.
        let is_open = last.len() > 1;
        list.add(Added {
            task: ShardTask::Gather,
            kind: ShardKind::Gather,
            id,
            what: "the result".into(),
            inputs: &inputs,
            needs: last,
            cost: costs.gather(),
            is_done: false,
        });
        let mut shards = list.shards;
        if !is_open {
            shards.pop();
        }
        Ok(Self { opened, shards, tiles, plant })
    }

    /// Position of the shard with this id.
    pub(super) fn find(&self, id: &str) -> Option<usize> {
        self.shards.iter().position(|(shard, _)| shard.id == id)
    }

    pub(super) fn is_done(&self, at: usize) -> bool {
        self.shards[at].0.state == ShardState::Done
    }

    /// The list for people and programs.
    pub(super) fn list(self, left_out: Vec<String>) -> ShardList {
        let shards = self.shards.into_iter().map(|(shard, _)| shard).collect();
        ShardList { schema: SCHEMA.into(), finished: false, shards, left_out }
    }

    /// The regions, as far as they are known.
    pub(super) fn regions(&self) -> &[Region] {
        self.plant.as_ref().map_or(&[], |plant| &plant.regions)
    }

    /// Name of the pieces of the search.
    pub(super) fn fits_name(&self, run: &Run<'_>) -> String {
        let tiles = self.tiles.as_deref().unwrap_or_default();
        run.digests.fits_key(tiles, run.settings).name().into()
    }
}

/// Ground, clusters and regions of a plant, from the store.
fn plant(run: &Run<'_>, tiles: &[Key]) -> Option<GroundAndRegions> {
    let kept = ground_kept(run, tiles);
    let ground: Ground = kept.get(GROUND)?;
    let (clusters, regions) = kept.get(BODIES).unwrap_or_else(|| bodies(run, &ground));
    Some(GroundAndRegions { ground, clusters, regions })
}

/// What stands about in the plant, and the regions of it that are searched.
fn bodies(run: &Run<'_>, ground: &Ground) -> (Vec<Cluster>, Vec<Region>) {
    let (space, floor) = (&ground.surfaces.occupancy, &ground.surfaces.floor);
    let clusters = cluster::split(space, floor, &run.settings.cluster);
    let regions = base_search::regions(&clusters, &run.settings.region);
    (clusters, regions)
}

/// Keeps the ground of a plant, with which its shard is made, after what later shards ask of it.
pub(super) fn keep_ground(run: &Run<'_>, tiles: &[Key], ground: &Ground) -> Result<()> {
    let kept = ground_kept(run, tiles);
    kept.keep(BODIES, &bodies(run, ground))?;
    kept.keep(GROUND, ground)
}

/// Pieces of the ground of a plant.
fn ground_kept(run: &Run<'_>, tiles: &[Key]) -> Cache {
    Cache::new(run.output.fits(), run.digests.ground_key(tiles, run.settings))
}

impl Growing<'_> {
    /// Adds tiles and planes of all inputs. Returns the keys of the tiles, where all of them are
    /// made, and the ids of the planes.
    fn inputs(
        &mut self,
        opened: &Opened,
        costs: &ShardCosts<'_>,
    ) -> (Option<Vec<Key>>, Vec<String>) {
        let run = self.run;
        let (mut keys, mut planes) = (Some(Vec::new()), Vec::new());
        for (at, input) in opened.sources.inputs.iter().enumerate() {
            let scans = &opened.sources.scans;
            let key = run.digests.tiles_key(input, scans, run.settings);
            let key = key.filter(|key| run.output.has_tiles(key));
            let path = input.path.display();
            let tiles = self.add(Added {
                task: ShardTask::Tiles(at),
                kind: ShardKind::Tiles,
                id: tiles_id(run, &input.path),
                what: format!("tiles of {path}"),
                inputs: &[input],
                needs: Vec::new(),
                cost: costs.tiles(input),
                is_done: key.is_some(),
            });
            let part = run.digests.ground_part_key(input, scans, run.settings);
            let part = part.filter(|_| key.is_some());
            let part = part.map(|part| Cache::new(run.output.fits(), part));
            planes.push(self.add(Added {
                task: ShardTask::Planes(at),
                kind: ShardKind::Planes,
                id: id(run, "planes", &input.path),
                what: format!("planes of {path}"),
                inputs: &[input],
                needs: vec![tiles],
                cost: costs.ground_part(input),
                is_done: part.is_some_and(|part| part.has(PART)),
            }));
            keys = keys.zip(key).map(|(mut all, key)| {
                all.push(key);
                all
            });
        }
        (keys, planes)
    }

    /// Adds the ground and returns its id.
    fn ground(
        &mut self,
        opened: &Opened,
        costs: &ShardCosts<'_>,
        tiles: Option<&[Key]>,
        needs: Vec<String>,
    ) -> String {
        let run = self.run;
        let inputs: Vec<&Input> = opened.sources.inputs.iter().collect();
        self.add(Added {
            task: ShardTask::Ground,
            kind: ShardKind::Ground,
            id: id(run, "ground", &()),
            what: "floor and regions of the plant".into(),
            inputs: &inputs,
            needs,
            cost: costs.ground(),
            is_done: tiles.is_some_and(|tiles| ground_kept(run, tiles).has(GROUND)),
        })
    }

    /// Adds the search and, if the robots are known, spaces and labels. Returns what the result
    /// needs: one id as long as the robots are not known.
    fn search(
        &mut self,
        opened: &Opened,
        costs: &ShardCosts<'_>,
        tiles: &[Key],
        plant: &GroundAndRegions,
    ) -> Result<Vec<String>> {
        let run = self.run;
        let fits = Cache::new(run.output.fits(), run.digests.fits_key(tiles, run.settings));
        let inputs: Vec<&Input> = opened.sources.inputs.iter().collect();
        let mut needs = Vec::new();
        for (at, region) in plant.regions.iter().enumerate() {
            let [x, y, z] = region.world_bounds().center().coords.into();
            let name = format!("{region:?}");
            let is_left_out = run.shards.is_some_and(|known| known.contains_key(&name));
            needs.push(self.add(Added {
                task: ShardTask::Region(at),
                kind: ShardKind::Region,
                id: id(run, "region", &(tiles, region)),
                what: format!("robots near ({x:.1}, {y:.1}, {z:.1}) m"),
                inputs: &inputs,
                needs: Vec::new(),
                cost: costs.region(region, &plant.clusters),
                is_done: is_left_out || fits.has(&name),
            }));
        }
        let chosen = run.chosen(tiles);
        let robots = self.add(Added {
            task: ShardTask::Robots,
            kind: ShardKind::Robots,
            id: id(run, "robots", &(tiles, run.shards)),
            what: "choice of robots, tools, registration".into(),
            inputs: &inputs,
            needs,
            cost: costs.robots(plant.regions.len()),
            is_done: chosen.has(ROBOTS) && NearRobots::is_kept(&chosen),
        });
        let kept: Option<KeptRobots> =
            if self.is_done(&robots) { chosen.get(ROBOTS) } else { None };
        let Some(kept) = kept else { return Ok(vec![robots]) };
        let (robots_list, _) = kept.with(&opened.library.models);
        Ok(self.labels(opened, costs, &chosen, &robots_list, &robots))
    }

    /// Adds the spaces of robots, the labels of inputs, and the files that are joined from these.
    fn labels(
        &mut self,
        opened: &Opened,
        costs: &ShardCosts<'_>,
        chosen: &Cache,
        list: &RobotList,
        robots: &str,
    ) -> Vec<String> {
        let run = self.run;
        let all: Vec<&Input> = opened.sources.inputs.iter().collect();
        let mut last = vec![robots.to_owned()];
        let n_spaces = if run.settings.freespace.enabled { list.fits.len() } else { 0 };
        for robot in 0..n_spaces {
            last.push(self.add(Added {
                task: ShardTask::Space(robot),
                kind: ShardKind::Space,
                id: id(run, "space", &(chosen.key(), robot)),
                what: format!("known space around {}", crate::detect::robot_id::robot_id(robot)),
                inputs: &all,
                needs: vec![robots.to_owned()],
                cost: costs.space(),
                is_done: chosen.has(&KnownSpaces::piece(robot)),
            }));
        }
        let folders = run.label_folders(chosen, &opened.sources.inputs);
        let mut pieces = Vec::new();
        for (at, (input, folder)) in opened.sources.inputs.iter().zip(&folders).enumerate() {
            pieces.push(self.add(Added {
                task: ShardTask::Labels(at),
                kind: ShardKind::Labels,
                id: id(run, "labels", &(chosen.key(), &input.path)),
                what: format!("labels of {}", input.path.display()),
                inputs: &[input],
                needs: vec![robots.to_owned()],
                cost: costs.labels(input),
                is_done: input_labels::is_whole(folder),
            }));
        }
        for (group, folder) in run.file_groups(chosen, &opened.sources) {
            last.push(self.add(Added {
                task: ShardTask::Files(group),
                kind: ShardKind::Files,
                id: id(run, "files", &(chosen.key(), group)),
                what: group.words(),
                inputs: &all,
                needs: pieces.clone(),
                cost: costs.files(group),
                is_done: joined_files::is_whole(&folder),
            }));
        }
        last.extend(pieces);
        last
    }
}

/// The tiles of inputs of a run.
pub(super) fn input_tiles<'a>(run: &'a Run<'_>, opened: &'a Opened) -> InputTiles<'a> {
    InputTiles::new(&opened.sources, &run.job.means, run.output.tiles(), run.engine)
}
