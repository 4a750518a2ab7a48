//! The points of a page: read from the tiles of a result by all threads, or, where many processes
//! make a result, in parts that each of them stores as a file.

use crate::cache;
use crate::detect::robots::{FittedRobots, standing};
use crate::engine::Engine;
use crate::engine::progress::Stage;
use contract::{Error, Fit, Kind, Result};
use export::{LasSettings, StatedTile, atomic, read_tile};
use geometry::Aabb;
use report_page::{PagePart, PagePoint, PagePoints};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Margin around the robots of a part, metres: the page takes their bounds from the files of the
/// result, in which they are rounded.
const MARGIN: f64 = 0.5;

/// A place of the plant, world frame, metres: the same for the page and for all of its parts.
pub(crate) fn middle(fits: &[Fit]) -> [f64; 3] {
    fits.first().map_or([0.0; 3], |fit| fit.world_from_base.translation.vector.into())
}

/// Reads tiles of a result for a page.
pub(crate) struct TileReader<'a> {
    pub(crate) las: &'a LasSettings,
    pub(crate) engine: &'a Engine,
    pub(crate) stage: Option<&'a Stage>,
}

impl TileReader<'_> {
    /// Adds the points of tiles, each with its length and checksum as far as they are stated. Which
    /// tile comes first makes no difference to the page.
    pub(crate) fn read(
        &self,
        tiles: Vec<(PathBuf, Option<StatedTile>)>,
        points: &mut PagePoints,
    ) -> Result<()> {
        let empty = points.clone();
        let all = Mutex::new(points);
        self.engine.each(tiles, |(path, stated)| {
            let mut own = empty.clone();
            let mut piece: Vec<PagePoint> = Vec::new();
            read_tile(&path, self.las, stated, |old| {
                self.engine.cancel.check()?;
                piece.clear();
                piece.extend(old.iter().map(|p| PagePoint { world: p.world, label: p.label }));
                own.add(&piece);
                self.stage.inspect(|stage| stage.add(0, old.len() as u64, 0));
                Ok(())
            })?;
            self.stage.inspect(|stage| stage.add(1, 0, 0));
            all.lock().unwrap_or_else(std::sync::PoisonError::into_inner).join(own.into_part())
        })?;
        Ok(())
    }
}

/// Writes the points of some tiles as a part of the page of a result with these robots.
///
/// # Errors
/// A tile that cannot be read, or a file that cannot be written.
pub(crate) fn write(
    tiles: &[PathBuf],
    las: &LasSettings,
    robots: FittedRobots<'_>,
    to: &Path,
    engine: &Engine,
) -> Result<()> {
    let stand = |fit: &Fit| standing(fit, &robots.models[fit.model]).grown(MARGIN);
    let near: Vec<Aabb> = robots.fits.iter().map(stand).collect();
    let mut points = PagePoints::of_part(&near, middle(robots.fits));
    let reader = TileReader { las, engine, stage: None };
    reader.read(tiles.iter().map(|tile| (tile.clone(), None)).collect(), &mut points)?;
    let bytes = cache::written(&points.into_part());
    let bytes = bytes.ok_or_else(|| Error::new(Kind::Bug, "a part of the page is not encoded"))?;
    atomic::write(to, &bytes)
}

/// Adds the points of the parts that were written to these files.
///
/// # Errors
/// A part that is missing, damaged or of another page.
pub(crate) fn join(parts: &[PathBuf], points: &mut PagePoints) -> Result<()> {
    for path in parts {
        let bytes = std::fs::read(path);
        let bytes = bytes.map_err(|e| Error::of_read("a part of the page", path, e))?;
        let part: Option<PagePart> = cache::read(&bytes);
        let part = part.ok_or_else(|| {
            let what = "a part of the page is damaged: its bytes do not match their digest";
            let hint = "remove the folder of this file, and start the job again";
            Error::bad_input(what).at(path.display()).hint(hint)
        })?;
        points.join(part)?;
    }
    Ok(())
}
