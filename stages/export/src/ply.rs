//! Writes the points of a result as two PLY files, one of moving and one of fixed points, for
//! viewers and libraries that do not read LAS (Open3D, MeshLab).

use crate::atomic::AtomicFile;
use crate::refill::{KINDS, decoded};
use contract::{Error, Kind, PointKind, Result};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Names of the files: moving points, fixed points.
pub const PLY: [&str; 2] = ["robots.ply", "fixed.ply"];

/// Number of points that are read at a time.
const PIECE: u64 = 1 << 16;
/// Length of the header, bytes. A comment pads it, so that the number of points can be written
/// last.
const HEADER: usize = 512;

/// Writes [`PLY`] to a folder, from tiles (see [`tiles`](fn@crate::tiles)). Before each tile
/// `may_continue` is called, and its error ends the work. Returns the numbers of moving and of
/// fixed points, or `None` if there are no tiles.
///
/// # Errors
/// If files cannot be read or written, or if `may_continue` returns an error.
pub fn write_ply(
    tiles: &[PathBuf],
    into: &Path,
    may_continue: impl Fn() -> Result<()>,
) -> Result<Option<[u64; 2]>> {
    if tiles.is_empty() {
        return Ok(None);
    }
    let bad = |e: las::Error, tile: &Path| {
        Error::bad_input("tile cannot be read")
            .because(e)
            .at(tile.display())
            .hint("`stillpoint verify` checks whether the result is complete")
    };
    let open =
        |tile: &Path| decoded(tile, || las::Reader::from_path(tile))?.map_err(|e| bad(e, tile));
    // All tiles of a result have the same record format.
    let has_color = open(&tiles[0])?.header().point_format().has_color;
    let [moving, fixed] = PLY.map(|name| Ply::create(&into.join(name), has_color));
    let (mut moving, mut fixed) = (moving?, fixed?);
    for tile in tiles {
        may_continue()?;
        let bad = |e| bad(e, tile);
        let mut reader = open(tile)?;
        let mut piece = las::PointDataBuilder::new().for_header(reader.header()).build();
        while decoded(tile, || reader.fill_points(PIECE, &mut piece))?.map_err(bad)? > 0 {
            for point in points(&piece) {
                let moves = matches!(point.kind, PointKind::Link | PointKind::Attachment);
                if moves { &mut moving } else { &mut fixed }.add(&point)?;
            }
        }
    }
    may_continue()?;
    Ok(Some([moving.finish()?, fixed.finish()?]))
}

/// The content of a point in a PLY file.
struct PlyPoint {
    /// World, metres.
    xyz: [f64; 3],
    intensity: u16,
    kind: PointKind,
    /// Numbers of robot and link from 1 on, 0 for none: fields `RobotId` and `LinkId`.
    owner: [u16; 2],
    /// Red, green, blue; 0 where the tile has none.
    color: (u16, u16, u16),
}

/// The points of a piece, from its columns.
fn points(piece: &las::PointData) -> impl Iterator<Item = PlyPoint> + '_ {
    let n_extra = usize::from(piece.format().extra_bytes);
    let extra = piece.record_len() - n_extra;
    let owners = piece.raw_bytes().chunks_exact(piece.record_len()).map(move |record| {
        let number = |at: usize| match record.get(extra + at..extra + at + 2) {
            Some(&[low, high]) => u16::from_le_bytes([low, high]),
            _ => 0,
        };
        [number(0), number(2)]
    });
    let colors = piece.rgb().into_iter().flatten().chain(std::iter::repeat((0, 0, 0)));
    let places = piece.x().zip(piece.y()).zip(piece.z()).map(|((x, y), z)| [x, y, z]);
    let kinds = piece.classification().map(|class| KINDS[usize::from(class)]);
    let measured = places.zip(piece.intensity()).zip(colors);
    measured.zip(kinds.zip(owners)).map(|(((xyz, intensity), color), (kind, owner))| PlyPoint {
        xyz,
        intensity,
        kind,
        owner,
        color,
    })
}

/// A PLY file that is being written.
struct Ply {
    file: AtomicFile,
    n: u64,
    has_color: bool,
}

impl Ply {
    fn create(path: &Path, has_color: bool) -> Result<Self> {
        let mut ply = Self { file: AtomicFile::create(path)?, n: 0, has_color };
        ply.write(&header(0, has_color)?)?;
        Ok(ply)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        let written = self.file.write_all(bytes);
        written.map_err(|e| Error::of_file("cloud cannot be written", self.file.path(), e))
    }

    fn add(&mut self, point: &PlyPoint) -> Result<()> {
        let mut record = [0; RECORD];
        record[..24].copy_from_slice(point.xyz.map(f64::to_le_bytes).as_flattened());
        record[24..28].copy_from_slice(&i32::from(point.intensity).to_le_bytes());
        record[28] = point.kind as u8;
        let index = point.owner.map(|number| (i32::from(number) - 1).to_le_bytes());
        record[29..BARE].copy_from_slice(index.as_flattened());
        let (red, green, blue) = point.color;
        record[BARE..].copy_from_slice(&[red, green, blue].map(|v| (v >> 8) as u8));
        self.n += 1;
        self.write(&record[..if self.has_color { RECORD } else { BARE }])
    }

    fn finish(mut self) -> Result<u64> {
        let sought = self.file.seek(SeekFrom::Start(0));
        sought.map_err(|e| Error::of_file("cloud cannot be finished", self.file.path(), e))?;
        let header = header(self.n, self.has_color)?;
        self.write(&header)?;
        self.file.commit()?;
        Ok(self.n)
    }
}

/// Length of a point without colour, bytes.
const BARE: usize = 37;
/// Length of a point with colour, bytes.
const RECORD: usize = BARE + 3;

/// The header. Numbers are `int`, since Open3D's tensor reader ignores `short`, `ushort` and
/// `uint`; bytes are `uint8`, since meshio takes `uchar` for signed; names begin with `scalar_`,
/// since CloudCompare ignores others when it runs without dialogs. See `scripts/cross`.
fn header(n: u64, has_color: bool) -> Result<Vec<u8>> {
    let color = if has_color {
        "property uint8 red\nproperty uint8 green\nproperty uint8 blue\n"
    } else {
        ""
    };
    let before = "ply\nformat binary_little_endian 1.0\ncomment ";
    let after = format!(
        "\nelement vertex {n}\nproperty double x\nproperty double y\nproperty double z\nproperty int intensity\n\
         property uint8 scalar_kind\n\
         property int scalar_robot\nproperty int scalar_link\n{color}end_header\n"
    );
    let room = HEADER.checked_sub(before.len() + after.len());
    let room = room.ok_or_else(|| Error::new(Kind::Bug, "a PLY header is too long"))?;
    let comment = "kind: 0 fixed, 1 link, 2 attachment, 3 floor, 255 uncertain; robot, link: as in result.json, -1 none";
    Ok(format!("{before}{comment:.<room$}{after}").into_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_of_few_and_many_points_are_as_long() {
        for (n, has_color) in [(0, true), (1, false), (u64::MAX, true)] {
            let header = header(n, has_color).expect("fits");
            assert_eq!(header.len(), HEADER, "{n}");
            let text = String::from_utf8(header).expect("text");
            assert!(
                text.contains(&format!("element vertex {n}\n")) && text.ends_with("end_header\n")
            );
        }
    }
}
