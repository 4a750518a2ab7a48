//! Groups the points of each strip by lattice tile: the parallel half of filling a store.

use super::record::Record;
use contract::{Lattice, Map, Pixel, Result, Scan, ScanId, Strip, TILE_SIDE, Tile, Weigh};
use geometry::direction::spherical;

/// Finds tile and pixel of each point. It keeps no state; run it as a map before a
/// [`super::TileSink`].
pub struct Scatter {
    lattices: Vec<Option<Lattice>>,
}

/// The points of one strip, grouped by tile.
pub struct Scattered {
    pub(super) scan: ScanId,
    pub(super) runs: Vec<ScatteredRun>,
    pub(super) records: Vec<Record>,
}

/// Consecutive records of one tile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ScatteredRun {
    /// Row and column of the tile.
    pub(super) tile: [u32; 2],
    /// Number of records.
    pub(super) n: usize,
}

/// Mean length of runs below which a strip is sorted by tile: one look-up of a tile costs as much
/// as copying about sixteen records.
const SHORT_RUN: usize = 16;

impl Scatter {
    /// A scatter for strips of these scans (all scans of a run, in their order).
    #[must_use]
    pub fn new(scans: &[Scan]) -> Self {
        Self { lattices: scans.iter().map(|s| s.lattice).collect() }
    }
}

impl Map for Scatter {
    type In = Strip;
    type Out = Scattered;
    type Scratch = ();

    fn apply(&self, strip: Strip, (): &mut ()) -> Result<Scattered> {
        let lattice = self.lattices.get(strip.scan.0 as usize).copied().flatten();
        let (runs, records) = match lattice {
            Some(lattice) => {
                records(&strip, |points, pixels| lattice_pixels(&lattice, points, pixels))
            }
            None => records(&strip, ground_pixels),
        };
        if runs.len() * SHORT_RUN > records.len() {
            let (runs, records) = grouped(&runs, &records);
            return Ok(Scattered { scan: strip.scan, runs, records });
        }
        Ok(Scattered { scan: strip.scan, runs, records })
    }
}

impl Weigh for Scattered {
    fn weight_bytes(&self) -> usize {
        size_of::<Self>()
            + self.runs.len() * size_of::<ScatteredRun>()
            + self.records.len() * Record::BYTES
    }

    fn n_points(&self) -> u64 {
        self.records.len() as u64
    }
}

/// Number of points whose pixels are computed together: few enough for the first-level cache,
/// enough for vector loops.
const BLOCK: usize = 64;

/// Pixels of a block of points, equal to those that [`Lattice::pixel`] returns for each point.
#[inline]
fn lattice_pixels(lattice: &Lattice, points: &[[f32; 3]], pixels: &mut [Pixel; BLOCK]) {
    if lattice.lattice_from_scan != nalgebra::UnitQuaternion::identity() || points.len() < BLOCK {
        for (p, pixel) in points.iter().zip(pixels) {
            *pixel = lattice.pixel(*p).0;
        }
        return;
    }
    // Each step has its own loop, so that the compiler makes vector instructions of it.
    let (mut azimuth, mut elevation) = ([0.0_f32; BLOCK], [0.0_f32; BLOCK]);
    for (i, p) in points.iter().enumerate().take(BLOCK) {
        (azimuth[i], elevation[i], _) = spherical(*p);
    }
    let (mut row, mut col) = ([0.0_f64; BLOCK], [0.0_f64; BLOCK]);
    for i in 0..BLOCK {
        row[i] = (f64::from(elevation[i]) - lattice.first_elevation) / lattice.row_step;
        col[i] = (f64::from(azimuth[i]) - lattice.first_azimuth) / lattice.col_step;
    }
    for i in 0..BLOCK {
        pixels[i] = lattice.nearest(row[i], col[i]);
    }
}

/// Ground cells of the points of a scan without lattice: the row is computed from y, the column
/// from x.
fn ground_pixels(points: &[[f32; 3]], pixels: &mut [Pixel; BLOCK]) {
    let offset = Tile::GROUND_OFFSET * i64::from(TILE_SIDE);
    // The conversion saturates, so that no coordinate panics; `ingest` has dropped coordinates
    // beyond any site.
    let cell =
        |v: f32| ((v / Tile::GROUND_CELL).floor() as i64).saturating_add(offset).max(0) as u32;
    for (p, pixel) in points.iter().zip(pixels) {
        *pixel = Pixel { row: cell(p[1]), col: cell(p[0]) };
    }
}

#[inline]
fn records(
    strip: &Strip,
    find: impl Fn(&[[f32; 3]], &mut [Pixel; BLOCK]),
) -> (Vec<ScatteredRun>, Vec<Record>) {
    let mut runs: Vec<ScatteredRun> = Vec::new();
    let mut last = [u32::MAX; 2];
    let mut start = 0;
    let mut records: Vec<Record> = Vec::with_capacity(strip.len());
    let mut pixels = [Pixel { row: 0, col: 0 }; BLOCK];
    for (points, places) in strip.xyz.chunks(BLOCK).zip(strip.place.chunks(BLOCK)) {
        find(points, &mut pixels);
        for (at, pixel) in pixels.iter().take(points.len()).enumerate() {
            let tile = [pixel.row / TILE_SIDE, pixel.col / TILE_SIDE];
            if tile != last {
                let n = records.len() + at - start;
                if n > 0 {
                    runs.push(ScatteredRun { tile: last, n });
                }
                (last, start) = (tile, records.len() + at);
            }
        }
        records.extend(points.iter().zip(places).zip(&pixels).map(|((p, place), pixel)| {
            let within = (pixel.row % TILE_SIDE) * TILE_SIDE + pixel.col % TILE_SIDE;
            Record::new(*p, strip.first_place + u64::from(*place), within as u16)
        }));
    }
    if records.len() > start {
        runs.push(ScatteredRun { tile: last, n: records.len() - start });
    }
    (runs, records)
}

/// Merges runs of the same tile and keeps the order of their records.
fn grouped(runs: &[ScatteredRun], records: &[Record]) -> (Vec<ScatteredRun>, Vec<Record>) {
    let mut order: Vec<([u32; 2], usize, usize)> = Vec::with_capacity(runs.len());
    let mut start = 0;
    for run in runs {
        order.push((run.tile, start, run.n));
        start += run.n;
    }
    order.sort_unstable();
    let mut joined: Vec<ScatteredRun> = Vec::new();
    let mut out = Vec::with_capacity(records.len());
    for (tile, start, n) in order {
        out.extend_from_slice(&records[start..start + n]);
        match joined.last_mut() {
            Some(run) if run.tile == tile => run.n += n,
            _ => joined.push(ScatteredRun { tile, n }),
        }
    }
    (joined, out)
}
