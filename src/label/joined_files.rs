//! Spatial tiles and clouds of a result, joined from the pieces of all inputs in their order: the
//! same bytes as if one process had labelled all inputs. They are joined in groups, so that many
//! processes can do it. What a group makes is a piece of the store: a folder with the files, and
//! with the points of its tiles for the page.

use super::labelling::Labelling;
use super::page_parts;
use super::piece_records::{PieceRecords, RecordFile, link, read_piece};
use crate::cache;
use crate::engine::{Engine, Task};
use contract::{Error, Kind, Result};
use export::{LasSettings, LasSummary, WrittenFiles, atomic, join_las};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Name of the file in the folder of a group that is written last.
const PIECE: &str = "piece.bin";
/// Name of the file with the points for the page.
const PAGE_PART: &str = "page.bin";
/// Number of points whose tiles one group joins: a few seconds of work.
const GROUP_POINTS: u64 = 20_000_000;
/// Largest number of groups of tiles. Each shard opens all inputs, which takes as long as its own
/// work where there are thousands of them.
const MAX_GROUPS: u64 = 1024;

/// One of the groups of files of a result.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FileGroup {
    /// Its number.
    pub(crate) at: usize,
    /// How many groups of tiles there are.
    n: usize,
}

impl FileGroup {
    /// The groups of a result with so many points. Clouds, each as long as all tiles together, are
    /// joined beside the tiles where there are several groups of those.
    pub(crate) fn all(n_points: u64) -> Vec<Self> {
        let n = n_points.div_ceil(GROUP_POINTS).clamp(1, MAX_GROUPS) as usize;
        let n_clouds = usize::from(n > 1);
        (0..n + n_clouds).map(|at| Self { at, n }).collect()
    }

    /// Whether the tile at this position of the list is joined here.
    fn has_tile(&self, at: usize) -> bool {
        at % self.n == self.at
    }

    /// Whether clouds are joined here.
    fn has_clouds(&self) -> bool {
        self.n == 1 || self.at == self.n
    }

    /// For people.
    pub(crate) fn words(&self) -> String {
        match (self.n, self.has_clouds()) {
            (1, _) => "tiles and clouds of the result".into(),
            (_, true) => "clouds of the result".into(),
            (n, false) => format!("tiles of the result, group {} of {n}", self.at + 1),
        }
    }

    /// Share of all points that are joined here, once for each file that they come to.
    pub(crate) fn share(&self) -> f64 {
        self.page_share() + if self.has_clouds() { 1.0 } else { 0.0 }
    }

    /// Share of all points that are read for the page.
    pub(crate) fn page_share(&self) -> f64 {
        if self.at < self.n { 1.0 / self.n as f64 } else { 0.0 }
    }
}

/// What the folder of a group holds.
#[derive(Default, Serialize, Deserialize)]
struct JoinedPiece {
    tiles: Vec<RecordFile>,
    /// Moving points, and fixed points where their cloud is requested.
    clouds: [Option<RecordFile>; 2],
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
            return Ok(file.at(self.path.clone()));
        }
        let parts: Vec<PathBuf> = self.parts.iter().map(|(path, _)| path.clone()).collect();
        join_las(&parts, &self.path, las)
    }
}

/// The parts of all files of a result, each in the order of the inputs.
struct FileParts {
    out: PathBuf,
    ending: &'static str,
    /// Tiles by row and column.
    tiles: BTreeMap<[i32; 2], JoinedFile>,
    clouds: [Option<JoinedFile>; 2],
}

impl FileParts {
    /// The parts in the pieces of all inputs, and the files in the folder `out` that they become.
    fn of(folders: &[PathBuf], out: &Path, ending: &'static str) -> Result<Self> {
        let (out, tiles) = (out.to_path_buf(), BTreeMap::new());
        let mut all = Self { out, ending, tiles, clouds: [None, None] };
        for folder in folders {
            all.add(folder, &PieceRecords::read(folder)?);
        }
        Ok(all)
    }

    fn add(&mut self, folder: &Path, piece: &PieceRecords) {
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
}

/// Row and column of a tile, from its name `tiles/COLUMN_ROW.las`.
fn place(name: &str) -> Option<[i32; 2]> {
    let stem = name.strip_prefix("tiles/")?.split_once('.')?.0;
    let (column, row) = stem.split_once('_')?;
    Some([row.parse().ok()?, column.parse().ok()?])
}

/// Whether the folder of a group is complete: it has got its name by a rename, when it was.
pub(crate) fn is_whole(folder: &Path) -> bool {
    folder.join(PIECE).is_file()
}

/// Bytes of the files of all groups that are joined, in the folder of labels of a store: the result
/// gets these files without a copy.
pub(crate) fn bytes_there(labels: &Path) -> u64 {
    let folders = |at: &Path| std::fs::read_dir(at).into_iter().flatten().flatten();
    let bytes = |entry: std::fs::DirEntry| entry.metadata().map_or(0, |file| file.len());
    let groups = folders(labels).map(|entry| entry.path());
    let groups = groups.filter(|at| is_whole(at) && !PieceRecords::are_in(at));
    let of_group = |at: PathBuf| {
        let tiles = folders(&at.join("tiles")).map(bytes).sum::<u64>();
        folders(&at).map(bytes).sum::<u64>() + tiles
    };
    groups.map(of_group).sum()
}

/// Joins the files of a group from the pieces of all inputs (`folders`), in a new folder.
///
/// # Errors
/// A damaged piece, or files that cannot be written.
pub(crate) fn write(
    labelling: &Labelling<'_>,
    folders: &[PathBuf],
    group: FileGroup,
    folder: &Path,
    engine: &Engine,
) -> Result<()> {
    let las = labelling.export.records(&labelling.las());
    let FileParts { tiles, clouds: [robots, fixed], .. } =
        FileParts::of(folders, folder, las.ending())?;
    let own = tiles.into_values().enumerate().filter(|(at, _)| group.has_tile(*at));
    let tiles: Vec<JoinedFile> = own.map(|(_, file)| file).collect();
    let clouds = [robots, fixed].map(|cloud| cloud.filter(|_| group.has_clouds()));
    let is_there = clouds.each_ref().map(Option::is_some);
    // Clouds are the largest, and come first.
    let all: Vec<JoinedFile> = clouds.into_iter().flatten().chain(tiles).collect();
    let written = engine.fan_out(Task::new("join"), all, |file: JoinedFile| file.write(&las))?;
    let mut records = written.iter().map(|file| RecordFile::of(folder, file));
    let clouds = is_there.map(|is_there| if is_there { records.next() } else { None });
    let tiles = records.collect();
    let piece = JoinedPiece { tiles, clouds };
    if labelling.export.page {
        let paths: Vec<PathBuf> = piece.tiles.iter().map(|tile| folder.join(&tile.name)).collect();
        let to = folder.join(PAGE_PART);
        page_parts::write(&paths, &las, labelling.robots(), &to, engine)?;
    }
    let bytes = cache::written(&piece).ok_or_else(|| {
        Error::new(Kind::Bug, "a group of files cannot be encoded").at(folder.display())
    })?;
    atomic::write(&folder.join(PIECE), &bytes)
}

/// The files with the points of the page, of the groups that have tiles.
pub(crate) fn kept_page_parts(groups: &[PathBuf]) -> Vec<PathBuf> {
    let parts = groups.iter().map(|folder| folder.join(PAGE_PART));
    parts.filter(|path| path.is_file()).collect()
}

/// Gives the files of all groups, whose folders these are, their names in the folder `out`.
pub(super) fn gather(groups: &[PathBuf], out: &Path) -> Result<WrittenFiles> {
    let (mut tiles, mut clouds) = (BTreeMap::new(), [None, None]);
    for folder in groups {
        let piece: JoinedPiece = read_piece(&folder.join(PIECE))?;
        let named = |file: &RecordFile| -> Result<LasSummary> {
            link(&folder.join(&file.name), &out.join(&file.name))?;
            Ok(file.at(out.join(&file.name)))
        };
        for tile in &piece.tiles {
            tiles.insert(place(&tile.name).unwrap_or_default(), named(tile)?);
        }
        for (cloud, own) in clouds.iter_mut().zip(&piece.clouds) {
            if let Some(own) = own {
                *cloud = Some(named(own)?);
            }
        }
    }
    let [robots, fixed] = clouds;
    let none = || Error::new(Kind::Bug, "the labels of no input are there to be joined");
    let robots = robots.ok_or_else(none)?;
    Ok(WrittenFiles { tiles: tiles.into_values().collect(), robots, fixed })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tile_is_placed_by_its_name() {
        assert_eq!(place("tiles/-3_12.las"), Some([12, -3]));
        assert_eq!(place("tiles/x.las"), None);
    }

    #[test]
    fn each_tile_and_the_clouds_are_joined_in_one_group() {
        for n_points in [0, 1, 20_000_000, 20_000_001, 100_000_000, 80_000_000_000] {
            let groups = FileGroup::all(n_points);
            for tile in 0..3_000 {
                assert_eq!(groups.iter().filter(|group| group.has_tile(tile)).count(), 1);
            }
            assert_eq!(groups.iter().filter(|group| group.has_clouds()).count(), 1);
            let share: f64 = groups.iter().map(FileGroup::share).sum();
            assert!((share - 2.0).abs() < 1e-9, "{share}");
        }
    }
}
