//! Encodes labelled points as LAS records, in runs that belong to one spatial tile. Nothing is
//! shared, so that several workers encode strips while one thread writes them.

use crate::record::{LasSettings, Quantum, RecordExtent, class_of, too_far};
use crate::settings::Settings;
use contract::{Label, PointKind, Result};
use geometry::narrow::floor_i32;

/// Mean length of runs below which they are joined: looking up a tile costs as much as copying this
/// number of records.
const SHORT_RUN: usize = 8;
/// Added to a number below 2³¹ it leaves the nearest integer in the low 32 bits: 1.5 · 2⁵².
const NEAREST: f64 = 6_755_399_441_055_744.0;

/// Points to be written. A column of unknown values is empty; all others have the same length.
#[derive(Debug, Clone, Copy, Default)]
pub struct PointColumns<'a> {
    /// World coordinates, metres.
    pub world: &'a [[f64; 3]],
    /// Label of each point.
    pub labels: &'a [Label],
    /// Intensity, 0..65535.
    pub intensity: &'a [u16],
    /// Red, green and blue, 0..65535; written in format 7 only.
    pub color: &'a [[u16; 3]],
    /// GPS time, seconds.
    pub gps_time: &'a [f64],
    /// Index of the connected body + 1, 0 for the floor; written if requested.
    pub body: &'a [u32],
    /// Point source id of each point.
    pub source_id: &'a [u16],
    /// Point source id of all points, if the column is empty.
    pub scan: u16,
}

/// Consecutive records of one tile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TileRun {
    /// Row and column of the tile.
    pub(crate) tile: [i32; 2],
    /// Whether the points belong to links and attachments.
    pub(crate) moves: bool,
    pub(crate) extent: RecordExtent,
}

/// The encoded records of a strip.
#[derive(Debug, Clone, Default)]
pub struct Packed {
    pub(crate) bytes: Vec<u8>,
    pub(crate) runs: Vec<TileRun>,
}

impl Packed {
    /// Memory of the records, bytes.
    #[must_use]
    pub fn weight_bytes(&self) -> usize {
        self.bytes.len() + size_of_val(&*self.runs)
    }

    /// The runs with their records of `record_len` bytes each.
    pub(crate) fn runs(&self, record_len: usize) -> impl Iterator<Item = (&TileRun, &[u8])> {
        let mut rest = &*self.bytes;
        self.runs.iter().map(move |run| {
            let (own, later) = rest.split_at(run.extent.n as usize * record_len);
            rest = later;
            (run, own)
        })
    }
}

/// Encodes points as records.
#[derive(Debug, Clone)]
pub struct Pack {
    las: LasSettings,
    /// Edge of a tile, metres; without tiles all points belong to one.
    tile_edge: Option<f64>,
    /// Whether any file holds points that do not move.
    with_fixed: bool,
    class_of_kind: [u8; 256],
}

impl Pack {
    /// An encoder for a single file of all points.
    pub(crate) fn new(las: &LasSettings) -> Self {
        let mut class_of_kind = [1; 256];
        for kind in PointKind::ALL {
            class_of_kind[kind as usize] = class_of(kind);
        }
        Self { las: las.clone(), tile_edge: None, with_fixed: true, class_of_kind }
    }

    /// An encoder for the tiles and clouds that `settings` request.
    #[must_use]
    pub fn of_clouds(las: &LasSettings, settings: &Settings) -> Self {
        Self {
            tile_edge: settings.tiles.then_some(settings.tile_edge),
            with_fixed: settings.tiles || settings.fixed_cloud,
            ..Self::new(las)
        }
    }

    /// Whether points with this label are written to any file.
    #[must_use]
    pub fn takes(&self, label: &Label) -> bool {
        self.with_fixed || label.moves()
    }

    /// Encodes points. They keep their order, in which neighbours should share a tile, as in a
    /// scan.
    ///
    /// # Errors
    /// If a point does not fit into the integers of LAS.
    /// A point that the integers of LAS cannot hold.
    pub fn pack(&self, points: &PointColumns<'_>) -> Result<Packed> {
        let n = points.world.len();
        let record_len = self.las.record_len();
        let mut bytes = vec![0; n * record_len];
        let steps = steps(points.world, &self.las.quantum)?;
        for (i, record) in bytes.chunks_exact_mut(record_len).enumerate() {
            self.write(points, i, steps[i], record);
        }
        let runs = self.runs(points, &steps);
        let packed = Packed { bytes, runs };
        let short = packed.runs.len() * SHORT_RUN > n;
        Ok(if short { packed.joined(record_len) } else { packed })
    }

    #[inline]
    fn write(&self, points: &PointColumns<'_>, i: usize, steps: [i32; 3], record: &mut [u8]) {
        let label = points.labels[i];
        for axis in 0..3 {
            record[4 * axis..4 * axis + 4].copy_from_slice(&steps[axis].to_le_bytes());
        }
        if let Some(intensity) = points.intensity.get(i) {
            record[12..14].copy_from_slice(&intensity.to_le_bytes());
        }
        let source = points.source_id.get(i).copied().unwrap_or(points.scan).to_le_bytes();
        // Return 1 of 1 return.
        if self.las.short {
            record[14] = 0b00_001_001;
            record[18..20].copy_from_slice(&source);
            return;
        }
        record[14] = 0x11;
        record[20..22].copy_from_slice(&source);
        if let Some(time) = points.gps_time.get(i) {
            record[22..30].copy_from_slice(&time.to_le_bytes());
        }
        let mut at = 30;
        if self.las.with_color {
            for (channel, to) in points.color.get(i).into_iter().flatten().zip([30, 32, 34]) {
                record[to..to + 2].copy_from_slice(&channel.to_le_bytes());
            }
            at += 6;
        }
        if self.las.with_labels {
            record[16] = self.class_of_kind[label.kind as usize];
            for (index, to) in [(label.robot, at), (label.link, at + 2)] {
                record[to..to + 2].copy_from_slice(&index.wrapping_add(1).to_le_bytes());
            }
            at += 4;
        }
        if let (true, Some(body)) = (self.las.with_bodies, points.body.get(i)) {
            record[at..at + 4].copy_from_slice(&body.to_le_bytes());
        }
    }

    /// The tile of a place, and its lowest and highest x and y, metres.
    fn tile(&self, p: &[f64; 3]) -> ([i32; 2], [f64; 4]) {
        let Some(edge) = self.tile_edge else {
            return ([0; 2], [f64::MIN, f64::MAX, f64::MIN, f64::MAX]);
        };
        let [row, col] = [1, 0].map(|axis| floor_i32(p[axis] / edge));
        let side = |at: i32| f64::from(at) * edge;
        ([row, col], [side(col), side(col + 1), side(row), side(row + 1)])
    }

    fn runs(&self, points: &PointColumns<'_>, steps: &[[i32; 3]]) -> Vec<TileRun> {
        let mut runs: Vec<TileRun> = Vec::new();
        // Most points lie in the same tile as the point before.
        let (mut tile, mut bounds) = ([0; 2], [f64::NAN; 4]);
        for ((p, label), step) in points.world.iter().zip(points.labels).zip(steps) {
            let moves = label.moves();
            let [x0, x1, y0, y1] = bounds;
            if !(p[0] >= x0 && p[0] < x1 && p[1] >= y0 && p[1] < y1) {
                (tile, bounds) = self.tile(p);
            }
            match runs.last_mut() {
                Some(run) if run.tile == tile && run.moves == moves => run.extent.add(*step),
                _ => {
                    let mut extent = RecordExtent::default();
                    extent.add(*step);
                    runs.push(TileRun { tile, moves, extent });
                }
            }
        }
        runs
    }
}

impl Packed {
    /// Joins the runs of each tile and keeps the order of points within it.
    fn joined(self, record_len: usize) -> Self {
        let mut start = 0;
        let mut order: Vec<([i32; 2], bool, usize, RecordExtent)> =
            Vec::with_capacity(self.runs.len());
        for run in &self.runs {
            order.push((run.tile, run.moves, start, run.extent));
            start += run.extent.n as usize * record_len;
        }
        order.sort_unstable_by_key(|entry| (entry.0, entry.1, entry.2));
        let mut out = Self { bytes: Vec::with_capacity(self.bytes.len()), runs: Vec::new() };
        for (tile, moves, start, extent) in order {
            let end = start + extent.n as usize * record_len;
            out.bytes.extend_from_slice(&self.bytes[start..end]);
            match out.runs.last_mut() {
                Some(run) if run.tile == tile && run.moves == moves => run.extent.join(&extent),
                _ => out.runs.push(TileRun { tile, moves, extent }),
            }
        }
        out
    }
}

/// Coordinates in whole steps, in one loop without calls that the compiler vectorises.
fn steps(world: &[[f64; 3]], quantum: &Quantum) -> Result<Vec<[i32; 3]>> {
    let (inverse, offset) = (quantum.scale.map(|s| 1.0 / s), quantum.offset);
    let scaled =
        |p: &[f64; 3]| -> [f64; 3] { std::array::from_fn(|i| (p[i] - offset[i]) * inverse[i]) };
    // Written so that NaN counts as too far.
    let is_far = |at: &[f64; 3]| !at.iter().all(|v| v.abs() < f64::from(i32::MAX));
    let mut far = false;
    let steps = world.iter().map(|p| {
        let at = scaled(p);
        far |= is_far(&at);
        at.map(|v| (v + NEAREST).to_bits() as i32)
    });
    let steps = steps.collect();
    match world.iter().find(|p| far && is_far(&scaled(p))) {
        Some(p) => Err(too_far(*p)),
        None => Ok(steps),
    }
}
