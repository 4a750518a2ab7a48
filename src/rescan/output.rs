//! Writes the result of a rescan: masks of the new scans, new tiles of the cell, shared files of
//! the earlier result, and the result that joins them.

use super::earlier_points::EarlierPoints;
use super::found::RescanFindings;
use super::report;
use super::report::RescanReport;
use crate::cache::{Digests, OutputDir, OutputFile, PAGE};
use crate::detect::robot_id::robot_id;
use crate::detect::robots::FittedRobots;
use crate::engine::Engine;
use crate::job::Outcome;
use crate::label::known_space::{SpaceGrids, VoxelMark};
use crate::label::label_strips::blocks;
use crate::label::labelling::{LabelFolders, Labelling, Scope, Streamed};
use crate::result::copc;
use change::{SessionOccupancy, ThingChange};
use contract::{MaskId, Result};
use export::{COPC, FileSum, MaskFiles, NpyWriter, OldPoint, Spool};
use freespace::{Visibility, VisibilityQuery};
use geometry::Aabb;
use register::Registration;
use std::cell::RefCell;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Counts and checksums of the written result.
pub(crate) struct WrittenResult {
    pub(crate) outcome: Outcome,
    /// Entries of files whose checksums are known.
    pub(crate) known: Vec<OutputFile>,
    /// Number of files shared with the earlier result, and of all files.
    pub(crate) n_shared: [usize; 2],
}

impl RescanFindings<'_, '_> {
    pub(crate) fn write(
        &self,
        registered: &[Option<Registration>],
        output: &OutputDir,
        digests: &Digests,
        engine: &Engine,
    ) -> Result<WrittenResult> {
        let next = output.next();
        let scratch = output.scratch();
        let gone = self.gone();
        // Superseded places are listed while new points are labelled and tiles are written.
        let lists = || self.lists(&gone, next);
        let own = self.session.own_fits(self.fits, self.robots);
        let labelling = self.session.labelling(FittedRobots { fits: &own, models: self.models });
        let rest = || {
            let mut streamed = self.label(&labelling, registered, next, &scratch, engine)?;
            let (open, spaces) = (streamed.take_open(), streamed.take_spaces());
            let grids = SpaceGrids::of(&spaces);
            let tiles = || self.tiles(open, &grids, &gone, next, &scratch, engine);
            let (mut done, mut touched) =
                engine.join("files of robots", || streamed.finish(engine), tiles)?;
            let left = std::mem::take(&mut touched.spots);
            done.spaces = self.write_spaces(spaces, left, next, engine)?;
            Ok((done, touched))
        };
        let (lists, (mut done, touched)) = engine.join("lists", lists, rest)?;
        let mut written: BTreeSet<String> = touched.names;
        written.extend(lists.grown);
        done.digests.extend(touched.digests.into_iter().chain(lists.digests));
        let _ = std::fs::remove_dir_all(&scratch);
        let said = RescanReport {
            found: self,
            done: &done,
            registered,
            lists: &lists.names,
            n_superseded: lists.n_superseded - self.session.past.n_before(),
        };
        let outcome = said.finish(digests, next)?;
        written.extend(report::NAMES.map(String::from));
        // The page of the earlier result does not show what is new.
        written.insert(PAGE.into());
        let spaces = done.spaces.iter().flatten();
        written.extend(spaces.flat_map(|s| [&s.grid, &s.octomap, &s.unknown]).cloned());
        let rewritten = self.robots.changed.iter().chain(&self.robots.gone);
        let folders: Vec<String> = rewritten.map(|&i| robot_id(i)).collect();
        let has_copc = self.base.has(COPC);
        written.extend(has_copc.then(|| COPC.to_string()));
        let is_new = |path: &str| written.contains(path) || is_of(path, &folders);
        let shared = self.base.share_files(next, is_new)?;
        if has_copc {
            self.write_copc(&shared, output, engine)?;
        }
        let fresh = done.digests.iter().filter(|sum| sum.path.starts_with(next));
        let mut known: Vec<OutputFile> = fresh.map(|sum| OutputFile::of(next, sum)).collect();
        let n_shared = [shared.len(), shared.len() + known.len()];
        known.extend(shared);
        Ok(WrittenResult { outcome, known, n_shared })
    }

    /// Writes the COPC file from all tiles, including unchanged ones.
    fn write_copc(&self, shared: &[OutputFile], output: &OutputDir, engine: &Engine) -> Result<()> {
        let (next, scratch) = (output.next(), output.scratch());
        let tiles = shared.iter().filter(|file| file.path.starts_with("tiles/")).collect();
        engine.fan_out("compare", tiles, |file: &OutputFile| {
            self.base.files.compared(&file.path).map(drop)
        })?;
        copc::write(&export::tiles(next)?, &next.join(COPC), &scratch, engine).map(drop)
    }

    /// Writes masks of the new scans and clouds of their points in the cell; the files of changed
    /// robots are written later.
    fn label<'l>(
        &'l self,
        labelling: &'l Labelling<'l>,
        registered: &[Option<Registration>],
        next: &'l Path,
        scratch: &'l Path,
        engine: &Engine,
    ) -> Result<Streamed<'l>> {
        let session = self.session;
        let spaces = self.spaces(engine)?;
        let scope = Scope {
            input: None,
            robots: Some(self.robots.changed.clone()),
            cell: Some(session.past.cell),
            moved: session.moved(registered, self.carried.plant_from_new),
            las: Some(self.base.state.records.las()),
            leaves_open: true,
        };
        let to = LabelFolders { out: next, clouds: scratch };
        labelling.write(&self.labels.near, spaces, &scope, to, engine)
    }

    /// Voxels of bodies that are gone and of robots that the earlier result missed, and their
    /// neighbours.
    fn gone(&self) -> BTreeSet<[i32; 3]> {
        let things = self.labels.things.iter().filter(|t| t.change != ThingChange::Appeared);
        let near = |c: &[i32; 3]| {
            let [x, y, z] = *c;
            let steps = (0..27).map(|k| [k / 9 - 1, k / 3 % 3 - 1, k % 3 - 1]);
            steps.map(|[i, j, k]| [x + i, y + j, z + k]).collect::<Vec<_>>()
        };
        let missed = EarlierPoints::missed(&self.labels.compared);
        things.flat_map(|t| &t.gone).chain(missed).flat_map(near).collect()
    }

    fn stands_otherwise(&self, robot: i16) -> bool {
        let robot = usize::try_from(robot).unwrap_or(usize::MAX);
        self.robots.changed.contains(&robot) || self.robots.gone.contains(&robot)
    }

    /// Which points of the earlier result remain valid for the new scans.
    fn stay(
        &self,
        points: &[OldPoint],
        watch: &VisibilityQuery<'_>,
        gone: &BTreeSet<[i32; 3]>,
    ) -> Vec<bool> {
        let left = |p: &OldPoint| p.label.moves() && self.stands_otherwise(p.label.robot);
        let mut stays: Vec<bool> = points.iter().map(|p| !left(p)).collect();
        let (mut here, mut worlds, mut sights) = (Vec::new(), Vec::new(), Vec::new());
        // Consecutive points mostly share a voxel.
        let mut last = None;
        for (i, point) in points.iter().enumerate() {
            if !stays[i] || !self.session.past.cell.contains(point.world) {
                continue;
            }
            let voxel = SessionOccupancy::cell(point.world);
            let fate = match last {
                Some((at, fate)) if at == voxel => fate,
                _ => self.labels.compared.fates.stays(voxel, || gone.contains(&voxel)),
            };
            last = Some((voxel, fate));
            match fate {
                Some(all) => stays[i] = all,
                None => {
                    here.push(i);
                    worlds.push(point.world);
                }
            }
        }
        watch.look_all(&worlds, &mut sights);
        for ((i, world), sight) in here.into_iter().zip(worlds).zip(sights) {
            stays[i] = match sight {
                Visibility::Onto => false,
                Visibility::Through => !gone.contains(&SessionOccupancy::cell(world)),
                Visibility::Close | Visibility::Hidden | Visibility::Unseen => true,
            };
        }
        stays
    }

    /// Writes the tiles that the cell touches, and the cloud of moving points: new points first
    /// (tiles in `open` contain them), then the remaining old ones.
    fn tiles(
        &self,
        open: Vec<Spool>,
        grids: &SpaceGrids,
        gone: &BTreeSet<[i32; 3]>,
        next: &Path,
        scratch: &Path,
        engine: &Engine,
    ) -> Result<Touched> {
        let las = self.base.state.records.las();
        let robots = format!("clouds/robots.{}", las.ending());
        let touched = self.robots.left.iter().chain([&self.session.past.cell]);
        let touched: Vec<&Aabb> = touched.collect();
        let mut tiles: BTreeMap<PathBuf, Spool> =
            open.into_iter().map(|tile| (tile.path().to_path_buf(), tile)).collect();
        for name in self.base.tiles(&touched).into_iter().chain([robots]) {
            let path = next.join(&name);
            if !tiles.contains_key(&path) {
                tiles.insert(path.clone(), Spool::create(path, &las)?);
            }
        }
        let name = |path: &Path| path.strip_prefix(next).unwrap_or(path).display().to_string();
        let mut all: Vec<(String, Spool)> =
            tiles.into_iter().map(|(path, tile)| (name(&path), tile)).collect();
        let names: BTreeSet<String> = all.iter().map(|(name, _)| name.clone()).collect();
        // The largest tiles are written first, so that no thread works alone at the end.
        let n_bytes = |name: &str| self.base.out.join(name).metadata().map_or(0, |m| m.len());
        all.sort_by_cached_key(|(name, _)| (Reverse(n_bytes(name)), name.clone()));
        let watch = self.session.watch();
        let written = engine.for_disks().fan_out("tiles", all, |(name, mut tile)| {
            let spots = RefCell::new(Vec::new());
            let new = scratch.join(&name);
            if new.is_file() {
                tile.take_from(&new, None, |points| vec![true; points.len()])?;
            }
            if self.base.has(&name) {
                let stays = |points: &[OldPoint]| {
                    let stays = self.stay(points, &watch, gone);
                    spots.borrow_mut().extend(spots_of(points, &stays, grids));
                    stays
                };
                let (path, stated) = self.base.files.stated(&name)?;
                tile.take_from(&path, stated, stays)?;
            }
            let is_left = tile.n_points() > 0;
            Ok((is_left.then(|| tile.finish()).transpose()?, spots.into_inner()))
        })?;
        let (digests, spots): (Vec<_>, Vec<_>) = written.into_iter().unzip();
        let fixed = ["las", "laz"].map(|end| format!("clouds/fixed.{end}"));
        let names = names.into_iter().chain(fixed).collect();
        let digests = digests.into_iter().flatten().filter_map(|summary| summary.sum).collect();
        Ok(Touched { names, digests, spots: spots.concat() })
    }

    /// Writes the lists of superseded places of masks whose list has grown.
    fn lists(&self, gone: &BTreeSet<[i32; 3]>, next: &Path) -> Result<Lists> {
        let past = self.session.past;
        let superseded =
            past.superseded(&self.labels.compared, gone, |robot| self.stands_otherwise(robot));
        let mut out = Lists::default();
        for (i, places) in superseded.iter().enumerate() {
            let before = &self.base.result.labels.scans[i].superseded;
            let name = MaskFiles::superseded(MaskId(i as u32));
            let n = places.len();
            if n == 0 {
                out.names.push(None);
                continue;
            }
            out.n_superseded += n;
            if before.is_none() || past.n_of(i) as u64 != n {
                let mut list = NpyWriter::<u64>::create(next.join(&name))?;
                places.each(|some| list.push(some))?;
                out.digests.push(list.finish()?);
                out.grown.push(name.clone());
            }
            out.names.push(Some(name));
        }
        Ok(out)
    }
}

/// Lists of superseded places: the name for each mask, names of those that have grown, and the
/// number of all places.
#[derive(Default)]
struct Lists {
    names: Vec<Option<String>>,
    grown: Vec<String>,
    digests: Vec<FileSum>,
    n_superseded: u64,
}

struct Touched {
    names: BTreeSet<String>,
    digests: Vec<FileSum>,
    /// Voxels of the remaining old points.
    spots: Vec<VoxelMark>,
}

/// Voxels of the points that remain valid.
fn spots_of(points: &[OldPoint], stays: &[bool], grids: &SpaceGrids) -> Vec<VoxelMark> {
    let (worlds, labels): (Vec<_>, Vec<_>) = points.iter().map(|p| (p.world, p.label)).unzip();
    grids.spots(&worlds, &labels, &blocks(&worlds), |i| stays[i])
}

/// Whether a file belongs to one of these robots.
fn is_of(path: &str, robots: &[String]) -> bool {
    robots.iter().any(|id| {
        path.starts_with(&format!("robots/{id}/"))
            || path == format!("pictures/{id}.png")
            || path == format!("pictures/{id}_evidence.png")
    })
}
