//! Labels of one input as a piece of the store, so that inputs can be labelled by different
//! processes, and how these pieces become masks, spaces and pictures of the result: the same bytes
//! as if one process had labelled all inputs.
//!
//! A piece is a folder: the masks and the plan of its input as the result has them, its records for
//! each spatial tile and cloud with their list in `records.bin`, and in `piece.bin` what the points
//! gave to spaces and pictures.

use super::joined_files;
use super::labelling::{LabelFolders, Labelling, Scope, Streamed, WrittenLabels};
use super::masks::MaskCount;
use super::near_robots::NearRobots;
use super::piece_records::{PieceRecords, RecordedSum, link, name, read_piece};
use crate::cache;
use crate::detect::robots::standing;
use crate::engine::Engine;
use contract::{Error, Input, Kind, Result, Space, SpaceGrid, SpaceKind};
use export::{FileSum, PicturePixels, atomic};
use serde::{Deserialize, Serialize};
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
    plans: Vec<String>,
    /// For each robot near the input, runs of voxels with what its points give them.
    spaces: Vec<(usize, Vec<(u32, SpaceKind)>)>,
    pictures: Vec<(usize, PicturePixels)>,
    oddities: Vec<String>,
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
    let lost = || {
        Error::new(Kind::Bug, "the labels of an input cannot be encoded").at(input.path.display())
    };
    let records = PieceRecords::of(&streamed.done.clouds, folder);
    records.write(folder)?;
    let piece = InputLabels::of(&streamed, folder);
    atomic::write(&folder.join(PIECE), &cache::written(&piece).ok_or_else(lost)?)
}

impl InputLabels {
    fn of(streamed: &Streamed<'_>, folder: &Path) -> Self {
        let done = &streamed.done;
        let is_label = |sum: &&FileSum| name(folder, &sum.path).starts_with("labels/");
        let sums = done.digests.iter().filter(is_label);
        let marked = streamed.spaces.iter().enumerate();
        let marked = marked.filter_map(|(i, space)| Some((i, runs(space.as_ref()?.voxels()))));
        let pictures = streamed.robots.iter().map(|(i, picture)| (*i, picture.pixels()));
        Self {
            masks: done.masks.clone(),
            sums: sums.map(|sum| RecordedSum::of(folder, sum)).collect(),
            plans: done.pictures.clone(),
            spaces: marked.collect(),
            pictures: pictures.collect(),
            oddities: done.oddities.clone(),
        }
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

impl<'a> Labelling<'a> {
    /// The same labelling with records that are joined later.
    fn joined_later(mut self) -> Self {
        self.export.compress = false;
        self
    }

    /// Makes the result's masks, plans, spaces and pictures of the pieces of all inputs, in their
    /// order, and its tiles and clouds of those of all groups of files, in place of
    /// [`Labelling::write`].
    ///
    /// # Errors
    /// A damaged piece, or files that cannot be written.
    pub(crate) fn join<'l>(
        &'l self,
        near: &'l NearRobots,
        mut spaces: Vec<Option<Space>>,
        [folders, groups]: [&[PathBuf]; 2],
        out: &'l Path,
        engine: &Engine,
    ) -> Result<Streamed<'l>> {
        let all = (0..self.fits.len()).collect::<Vec<_>>();
        let mut robots = self.robot_pictures(&all, engine)?;
        let (mut masks, mut pictures, mut digests) = (Vec::new(), Vec::new(), Vec::new());
        let mut oddities = Vec::new();
        for folder in folders {
            let piece: InputLabels = read_piece(&folder.join(PIECE))?;
            for sum in &piece.sums {
                link(&folder.join(&sum.name), &out.join(&sum.name))?;
                digests.push(sum.at(out.join(&sum.name)));
            }
            piece.plans.iter().try_for_each(|plan| link(&folder.join(plan), &out.join(plan)))?;
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
        let clouds = joined_files::gather(groups, out)?;
        digests.extend(clouds.sums().cloned());
        let said = vec![None; self.fits.len()];
        let done = WrittenLabels { clouds, masks, pictures, spaces: said, digests, las, oddities };
        let robots = all.into_iter().zip(robots).collect();
        Ok(Streamed { labelling: self, near, spaces, robots, open: Vec::new(), out, done })
    }
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
}
