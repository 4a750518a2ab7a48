//! Labels of one input as a piece of the store, so that inputs can be labelled by different
//! processes, and how these pieces become the files of the result: the same bytes as if one process
//! had labelled all inputs.
//!
//! A piece is a folder: the masks and the plan of its input as the result has them, its records for
//! each spatial tile and cloud, and in `piece.bin` what the points gave to spaces and pictures.

use super::labelling::{LabelFolders, Labelling, Scope, Streamed, WrittenLabels};
use super::masks::MaskCount;
use super::near_robots::NearRobots;
use crate::cache;
use crate::detect::robots::standing;
use crate::engine::{Engine, Task};
use contract::{Error, Input, Kind, Result, Space, SpaceGrid, SpaceKind};
use export::{FileSum, LasSettings, LasSummary, PicturePixels, WrittenFiles, atomic, join_las};
use geometry::Aabb;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Name of the file in the folder of a piece that is written last.
const PIECE: &str = "piece.bin";
/// Distance from a robot's links within which its picture shows points, and more, metres.
const SHOWN: f64 = 1.0;

/// What the labels of an input are made of, besides the files in the folder of the piece.
#[derive(Serialize, Deserialize)]
struct InputLabels {
    masks: Vec<MaskCount>,
    sums: Vec<RecordedSum>,
    tiles: Vec<RecordFile>,
    /// Moving points, and fixed points where their cloud is requested.
    clouds: [Option<RecordFile>; 2],
    plans: Vec<String>,
    /// For each robot near the input, runs of voxels with what its points give them.
    spaces: Vec<(usize, Vec<(u32, SpaceKind)>)>,
    pictures: Vec<(usize, PicturePixels)>,
    oddities: Vec<String>,
}

/// Name in the folder, length and checksum of a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct RecordedSum {
    name: String,
    n_bytes: u64,
    crc32c: u32,
}

/// A file of records.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct RecordFile {
    name: String,
    n_points: u64,
    bounds: Aabb,
    sum: Option<RecordedSum>,
}

impl RecordedSum {
    fn of(folder: &Path, sum: &FileSum) -> Self {
        Self { name: name(folder, &sum.path), n_bytes: sum.n_bytes, crc32c: sum.crc32c }
    }

    fn at(&self, path: PathBuf) -> FileSum {
        FileSum { path, n_bytes: self.n_bytes, crc32c: self.crc32c }
    }
}

impl RecordFile {
    fn of(folder: &Path, file: &LasSummary) -> Self {
        let sum = file.sum.as_ref().map(|sum| RecordedSum::of(folder, sum));
        let (n_points, bounds) = (file.n_points, file.bounds);
        Self { name: name(folder, &file.path), n_points, bounds, sum }
    }
}

/// Path of a file below its folder, with `/`.
fn name(folder: &Path, path: &Path) -> String {
    let parts = path.strip_prefix(folder).unwrap_or(path).components();
    let parts: Vec<_> = parts.map(|part| part.as_os_str().to_string_lossy()).collect();
    parts.join("/")
}

/// Whether the folder of a piece is complete: it has got its name by a rename, when it was.
pub(crate) fn is_whole(folder: &Path) -> bool {
    folder.join(PIECE).is_file()
}

/// Labels one input and writes the piece to a new folder. `grids` are those of the robots' spaces.
///
/// # Errors
/// An input that cannot be read, or files that cannot be written.
pub(crate) fn write(
    labelling: Labelling<'_>,
    near: &NearRobots,
    grids: &[Option<SpaceGrid>],
    input: &Input,
    folder: &Path,
    engine: &Engine,
) -> Result<()> {
    let labelling = labelling.joined_later();
    let bounds = labelling.bounds_of(input.id);
    let near_grid = |grid: &SpaceGrid| grid.bounds().touches(&bounds);
    let spaces = grids.iter().map(|grid| grid.filter(near_grid).map(Space::unknown)).collect();
    let is_shown = |i: &usize| {
        let stands = standing(&labelling.fits[*i], &labelling.models[labelling.fits[*i].model]);
        stands.is_empty() || stands.grown(SHOWN).touches(&bounds)
    };
    let robots = (0..labelling.fits.len()).filter(is_shown).collect();
    let scope = Scope { robots: Some(robots), input: Some(input.id), ..Scope::default() };
    let to = LabelFolders { out: folder, clouds: folder };
    let streamed = labelling.write(near, spaces, &scope, to, engine)?;
    let piece = InputLabels::of(&streamed, folder);
    let bytes = cache::written(&piece).ok_or_else(|| {
        Error::new(Kind::Bug, "the labels of an input cannot be encoded").at(input.path.display())
    })?;
    atomic::write(&folder.join(PIECE), &bytes)
}

impl InputLabels {
    fn of(streamed: &Streamed<'_>, folder: &Path) -> Self {
        let done = &streamed.done;
        let is_label = |sum: &&FileSum| name(folder, &sum.path).starts_with("labels/");
        let sums = done.digests.iter().filter(is_label);
        let marked = streamed.spaces.iter().enumerate();
        let marked = marked.filter_map(|(i, space)| Some((i, runs(space.as_ref()?.voxels()))));
        let pictures = streamed.robots.iter().map(|(i, picture)| (*i, picture.pixels()));
        let file = |file: &LasSummary| RecordFile::of(folder, file);
        Self {
            masks: done.masks.clone(),
            sums: sums.map(|sum| RecordedSum::of(folder, sum)).collect(),
            tiles: done.clouds.tiles.iter().map(file).collect(),
            clouds: [Some(file(&done.clouds.robots)), done.clouds.fixed.as_ref().map(file)],
            plans: done.pictures.clone(),
            spaces: marked.collect(),
            pictures: pictures.collect(),
            oddities: done.oddities.clone(),
        }
    }

    fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(PIECE);
        let bytes = std::fs::read(&path);
        let bytes = bytes.map_err(|e| Error::of_read("a piece cannot be read", &path, e))?;
        cache::read(&bytes).ok_or_else(|| {
            let what = "a piece of the result is damaged: its bytes do not match their digest";
            let hint = "remove the folder of this file, and start the job again";
            Error::bad_input(what).at(path.display()).hint(hint)
        })
    }
}

/// Runs of equal voxels.
fn runs(voxels: &[SpaceKind]) -> Vec<(u32, SpaceKind)> {
    let mut out: Vec<(u32, SpaceKind)> = Vec::new();
    for voxel in voxels {
        match out.last_mut() {
            Some((n, kind)) if kind == voxel => *n += 1,
            _ => out.push((1, *voxel)),
        }
    }
    out
}

/// Marks what points have given to the voxels of a space.
fn mark_runs(space: &mut Space, runs: &[(u32, SpaceKind)]) {
    let (mut at, n_voxels) = (0, space.voxels().len());
    for &(n, kind) in runs {
        let end = (at + n as usize).min(n_voxels);
        if kind != SpaceKind::Unknown {
            (at..end).for_each(|voxel| space.mark(voxel, kind));
        }
        at = end;
    }
}

/// A file of the result that is made of parts.
struct JoinedFile {
    path: PathBuf,
    parts: Vec<(PathBuf, RecordFile)>,
}

impl JoinedFile {
    /// Writes the file, or gives it the name of its only part where that has the same bytes.
    fn write(&self, las: &LasSettings) -> Result<LasSummary> {
        if let ([(part, file)], false) = (&self.parts[..], las.compress) {
            link(part, &self.path)?;
            let sum = file.sum.as_ref().map(|sum| sum.at(self.path.clone()));
            let (n_points, bounds) = (file.n_points, file.bounds);
            return Ok(LasSummary { path: self.path.clone(), n_points, bounds, sum });
        }
        let parts: Vec<PathBuf> = self.parts.iter().map(|(path, _)| path.clone()).collect();
        join_las(&parts, &self.path, las)
    }
}

/// Gives a file of a piece its name in the result, too; a copy where the disk has no hard links.
fn link(from: &Path, to: &Path) -> Result<()> {
    let made = to.parent().map_or(Ok(()), std::fs::create_dir_all);
    let linked = made
        .and_then(|()| std::fs::hard_link(from, to).or_else(|_| std::fs::copy(from, to).map(drop)));
    linked.map_err(|e| Error::of_file("a file of the result cannot be written", to, e))
}

impl<'a> Labelling<'a> {
    /// The same labelling with records that are joined later.
    fn joined_later(mut self) -> Self {
        self.export.compress = false;
        self
    }

    /// Makes the result's masks, tiles, clouds and plans of the pieces of all inputs, in their
    /// order, in place of [`Labelling::write`].
    ///
    /// # Errors
    /// A damaged piece, or files that cannot be written.
    pub(crate) fn join<'l>(
        &'l self,
        near: &'l NearRobots,
        mut spaces: Vec<Option<Space>>,
        folders: &[PathBuf],
        out: &'l Path,
        engine: &Engine,
    ) -> Result<Streamed<'l>> {
        let all = (0..self.fits.len()).collect::<Vec<_>>();
        let mut robots = self.robot_pictures(&all, engine)?;
        let (mut masks, mut pictures, mut digests) = (Vec::new(), Vec::new(), Vec::new());
        let (mut oddities, mut records) = (Vec::new(), JoinedRecords::new(out, self));
        for folder in folders {
            let piece = InputLabels::read(folder)?;
            for sum in &piece.sums {
                link(&folder.join(&sum.name), &out.join(&sum.name))?;
                digests.push(sum.at(out.join(&sum.name)));
            }
            piece.plans.iter().try_for_each(|plan| link(&folder.join(plan), &out.join(plan)))?;
            records.add(folder, &piece);
            for (i, runs) in &piece.spaces {
                let space = spaces.get_mut(*i).and_then(Option::as_mut);
                space.into_iter().for_each(|space| mark_runs(space, runs));
            }
            for (i, pixels) in &piece.pictures {
                robots.get_mut(*i).map_or(Ok(()), |robot| robot.add_pixels(pixels))?;
            }
            masks.extend(piece.masks);
            pictures.extend(piece.plans);
            oddities.extend(piece.oddities);
        }
        let las = self.las();
        let clouds = records.write(&self.export.records(&las), engine)?;
        digests.extend(clouds.sums().cloned());
        let said = vec![None; self.fits.len()];
        let done = WrittenLabels { clouds, masks, pictures, spaces: said, digests, las, oddities };
        let robots = all.into_iter().zip(robots).collect();
        Ok(Streamed { labelling: self, near, spaces, robots, open: Vec::new(), out, done })
    }
}

/// The files of records of a result, with the parts of each in the order of the inputs.
struct JoinedRecords {
    out: PathBuf,
    ending: &'static str,
    /// Tiles by row and column.
    tiles: BTreeMap<[i32; 2], JoinedFile>,
    clouds: [Option<JoinedFile>; 2],
}

impl JoinedRecords {
    fn new(out: &Path, labelling: &Labelling<'_>) -> Self {
        let ending = labelling.export.records(&labelling.las()).ending();
        Self { out: out.to_path_buf(), ending, tiles: BTreeMap::new(), clouds: [None, None] }
    }

    fn add(&mut self, folder: &Path, piece: &InputLabels) {
        let (out, ending) = (&self.out, self.ending);
        let file = |name: &str| JoinedFile {
            path: out.join(name).with_extension(ending),
            parts: Vec::new(),
        };
        let part = |file: &RecordFile| (folder.join(&file.name), file.clone());
        for tile in &piece.tiles {
            let at = place(&tile.name).unwrap_or_default();
            let all = self.tiles.entry(at).or_insert_with(|| file(&tile.name));
            all.parts.push(part(tile));
        }
        for (cloud, own) in self.clouds.iter_mut().zip(&piece.clouds) {
            let Some(own) = own else { continue };
            cloud.get_or_insert_with(|| file(&own.name)).parts.push(part(own));
        }
    }

    /// Writes all files, the largest first.
    fn write(self, las: &LasSettings, engine: &Engine) -> Result<WrittenFiles> {
        let [robots, fixed] = self.clouds;
        let robots = robots.ok_or_else(|| {
            Error::new(Kind::Bug, "the labels of no input are there to be joined")
        })?;
        let n_clouds = 1 + usize::from(fixed.is_some());
        let all = fixed.into_iter().chain([robots]).chain(self.tiles.into_values()).collect();
        let mut written =
            engine.fan_out(Task::new("join"), all, |file: JoinedFile| file.write(las))?;
        let tiles = written.split_off(n_clouds);
        let robots = written.pop();
        let robots = robots.ok_or_else(|| Error::new(Kind::Bug, "a cloud was not written"))?;
        Ok(WrittenFiles { tiles, robots, fixed: written.pop() })
    }
}

/// Row and column of a tile, from its name `tiles/COLUMN_ROW.las`.
fn place(name: &str) -> Option<[i32; 2]> {
    let stem = name.strip_prefix("tiles/")?.split_once('.')?.0;
    let (column, row) = stem.split_once('_')?;
    Some([row.parse().ok()?, column.parse().ok()?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_mark_what_single_points_have_marked() {
        let grid = SpaceGrid { edge: 0.1, first: [0; 3], size: [4, 5, 6] };
        let (mut own, mut whole) = (Space::unknown(grid), Space::unknown(grid));
        for (at, kind) in [(3, SpaceKind::Fixed), (4, SpaceKind::Robot), (119, SpaceKind::Other)] {
            own.mark(at, kind);
        }
        whole.mark(4, SpaceKind::Fixed);
        mark_runs(&mut whole, &runs(own.voxels()));
        let kind = |at: usize| whole.voxels()[at];
        assert_eq!(
            [kind(3), kind(4), kind(119)],
            [SpaceKind::Fixed, SpaceKind::Fixed, SpaceKind::Other]
        );
        assert_eq!(kind(0), SpaceKind::Unknown);
    }

    #[test]
    fn a_tile_is_placed_by_its_name() {
        assert_eq!(place("tiles/-3_12.las"), Some([12, -3]));
        assert_eq!(place("tiles/x.las"), None);
    }
}
