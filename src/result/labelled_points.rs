//! The points of a published result with their labels, tile by tile, for programs that want some of
//! them as arrays.

use super::plant_state::PlantState;
use crate::cache::{VerifiedFiles, tiles_of};
use contract::{Error, PointKind, Result};
use export::{LasSettings, read_tile};
use geometry::Aabb;
use std::path::Path;

/// The tiles of a result, none of which is read yet.
pub struct LabelledPoints {
    files: VerifiedFiles,
    las: LasSettings,
    names: Vec<String>,
}

/// Columns of points; all have the same length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LabelledColumns {
    /// World coordinates, metres: three values a point.
    pub xyz: Vec<f64>,
    /// Kinds, by the numbers of `labels/N.kind.npy`.
    pub kind: Vec<u8>,
    /// Indices of robots, -1 for none.
    pub robot: Vec<i16>,
    /// Indices of links, -1 for none.
    pub link: Vec<i16>,
}

/// Which points are wanted.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct WantedPoints {
    /// Numbers of kinds; all kinds without it.
    pub kinds: Option<Vec<u8>>,
    /// Index of the robot to which points belong; all points without it.
    pub robot: Option<i16>,
}

impl LabelledPoints {
    /// Opens a result; its list of files is compared with its digest.
    ///
    /// # Errors
    /// A folder that holds no result, or one without tiles; a file that was changed.
    pub fn open(out: &Path) -> Result<Self> {
        let files = VerifiedFiles::open(out)?;
        let records = PlantState::read(&files)?.records;
        let Some(edge) = records.tile_edge() else {
            return Err(Error::bad_input("the result has no tiles to read its points from")
                .at(out.join("tiles").display())
                .hint("run with --set export.tiles=true"));
        };
        let everywhere = Aabb { min: [f64::NEG_INFINITY; 3], max: [f64::INFINITY; 3] };
        let names = tiles_of(&files.manifest().files, edge, &[&everywhere]);
        Ok(Self { las: records.las(), files, names })
    }

    /// Number of tiles.
    #[must_use]
    pub fn n_tiles(&self) -> usize {
        self.names.len()
    }

    /// The wanted points of a tile, in the order of the tile. The tile is compared with the list of
    /// files while it is read.
    ///
    /// # Errors
    /// A tile that is missing or was changed; a number that is none of a tile or of a kind.
    pub fn tile(&self, at: usize, wanted: &WantedPoints) -> Result<LabelledColumns> {
        let usage = |what: String| Error::new(contract::Kind::Usage, what);
        let name = self.names.get(at);
        let name = name.ok_or_else(|| usage(format!("there is no tile \"{at}\"")))?;
        let kinds = wanted.kinds.as_deref();
        if let Some(odd) = kinds.and_then(|k| k.iter().find(|k| PointKind::of(**k).is_none())) {
            return Err(usage(format!("there is no kind \"{odd}\"")).hint("0, 1, 2, 3 or 255"));
        }
        let is_kind: [bool; 256] =
            std::array::from_fn(|k| kinds.is_none_or(|kinds| kinds.contains(&(k as u8))));
        let (path, stated) = self.files.stated(name)?;
        let mut out = LabelledColumns::default();
        read_tile(&path, &self.las, stated, |points| {
            for point in points {
                let label = point.label;
                let kind = label.kind as u8;
                let is_robot = wanted.robot.is_none_or(|robot| label.robot == robot);
                if is_robot && is_kind[usize::from(kind)] {
                    out.xyz.extend(point.world);
                    out.kind.push(kind);
                    out.robot.push(label.robot);
                    out.link.push(label.link);
                }
            }
            Ok(())
        })?;
        Ok(out)
    }
}
