//! Tells to which scan of a LAS file a point belongs by the rasters of the scanners, where the
//! points are in no order and have no ids.

use crate::las_header::LasHeader;
use crate::las_runs::LasRecords;
use contract::{PointRaster, Result};
use geometry::Pose;

/// Number of windows in which the points of each raster are counted, and of their records.
const WINDOWS: u64 = 256;
const IN_WINDOW: usize = 256;
/// Standard deviation of a coordinate that is rounded to whole steps, steps.
const ROUNDED: f64 = 0.289;

/// The rasters of the scanners of a file. Points that are surely on none, or may be on several,
/// belong to the scan after those of the rasters.
#[derive(Debug)]
pub(crate) struct RastersOfScans {
    rasters: Vec<(PointRaster, WorldTurn)>,
    scale: [f64; 3],
    offset: [f64; 3],
    blur: f64,
}

/// Rotation and translation into the frame of a scanner.
type WorldTurn = ([[f64; 3]; 3], [f64; 3]);

impl RastersOfScans {
    pub(crate) fn new(header: &LasHeader) -> Self {
        let step = header.scale.iter().fold(0.0_f64, |most, s| most.max(s.abs()));
        let (scale, offset) = (header.scale, header.offset);
        Self { rasters: Vec::new(), scale, offset, blur: ROUNDED * step }
    }

    /// Adds the raster of the next scan.
    pub(crate) fn add(&mut self, world_from_scan: &Pose, raster: &PointRaster) {
        let turn = world_from_scan.rotation.inverse().to_rotation_matrix();
        let at = world_from_scan.translation.vector;
        let turn = [0, 1, 2].map(|i| [0, 1, 2].map(|j| turn[(i, j)]));
        self.rasters.push((raster.clone(), (turn, at.into())));
    }

    /// The scan of a record.
    pub(crate) fn of(&self, record: &[u8]) -> u16 {
        let count = |at: usize| {
            f64::from(i32::from_le_bytes([
                record[at],
                record[at + 1],
                record[at + 2],
                record[at + 3],
            ]))
        };
        let world = [0, 1, 2].map(|a| count(4 * a) * self.scale[a] + self.offset[a]);
        let seen = self.rasters.iter().map(|(raster, (turn, at))| {
            let p = [0, 1, 2].map(|a| world[a] - at[a]);
            (raster, [0, 1, 2].map(|i| turn[i][0] * p[0] + turn[i][1] * p[1] + turn[i][2] * p[2]))
        });
        PointRaster::owner(seen, self.blur).unwrap_or(self.rasters.len()) as u16
    }
}

/// The share of a file's points that each scan has, and that of the others, from windows all over
/// it.
pub(crate) fn shares(rasters: &RastersOfScans, records: &LasRecords) -> Result<Vec<f64>> {
    let header = &records.header;
    let mut counts = vec![0_u64; rasters.rasters.len() + 1];
    let mut starts = Vec::new();
    for window in 0..WINDOWS {
        let first = (header.n_points as f64 * window as f64 / WINDOWS as f64) as u64;
        // Compressed pieces begin at few places.
        if starts.contains(&records.start(first)) {
            continue;
        }
        starts.push(records.start(first));
        let (_, run) = records.run(first, IN_WINDOW)?;
        for record in run.chunks_exact(header.record_len) {
            counts[usize::from(rasters.of(record))] += 1;
        }
    }
    let n = counts.iter().sum::<u64>().max(1) as f64;
    Ok(counts.into_iter().map(|count| count as f64 / n).collect())
}
