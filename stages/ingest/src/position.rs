//! Tests from a scan's points whether the scanner can have stood at its stated position.
//!
//! Each beam of a scanner returns once: in every direction from the scanner there is one surface,
//! as dense as the beams. Seen from any other place, one surface lies in front of another, and both
//! are visible at full density. At edges two surfaces lie side by side instead, and at fences the
//! wires and what is behind them share the beams, so that neither is dense; those are not counted.

use std::f64::consts::{FRAC_PI_2, PI};

/// Number of points that are examined, evenly spread over a scan.
pub(crate) const N_POINTS: usize = 300_000;
/// Largest number of points that are read for it: a second of decoding.
pub(crate) const N_READ: u64 = 4_000_000;
/// Number of filled cells below which nothing is concluded.
const MIN_CELLS: usize = 200;
/// Smallest number of points in the cells that most points lie in.
const IN_CELL: usize = 16;
/// Number of points of a cell below which two surfaces cannot be told apart.
const FEWEST: usize = 8;
/// Largest number of points of a cell that are compared with one another.
const MOST: usize = 64;
/// Numbers of cells along the edge of a cube face, finest first: cells of 0.2° to 11°.
const EDGES: [usize; 7] = [512, 256, 128, 64, 32, 16, 8];
/// Number of bands of elevation, 10° each, in which cells should hold equally many points.
const N_BANDS: usize = 18;
/// Distance above which two surfaces are different, metres, and as share of the nearer range;
/// nearer points may lie on one surface at a grazing angle.
const APART: (f64, f64) = (0.15, 0.08);
/// Smallest share of a cell's points on each of the two surfaces.
const EITHER: f64 = 0.25;
/// Share of points whose nearest neighbour in direction lies on the other surface, from which on
/// both surfaces fill the cell. Where they lie side by side, only points at the border do.
const MIXED: f64 = 0.25;
/// Factor by which a cell with two surfaces at full density holds more points than most cells of
/// its band.
const FULLER: f64 = 1.35;
/// Share of cells with two full surfaces from which on the position is wrong, and the smallest
/// number of such cells. Of 66 simulated scans at their true position one had 0.0007 and all others
/// less; of 49 at positions wrong by 0.5 to 3 m, 41 have more than this (benches/LEARNT.md,
/// stated scanner positions). Real clouds of depth cameras have none.
const WRONG: (f64, usize) = (0.002, 4);

/// Beginning of the message for a scan whose stated position is not used.
pub const MISPLACED: &str = "the stated scanner position cannot be right";

/// The cells of directions from the stated position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SeenDirections {
    /// Number of cells with enough points.
    pub(crate) n_cells: usize,
    /// Number of those in which two surfaces lie one behind the other, both at full density.
    pub(crate) n_double: usize,
}

impl SeenDirections {
    /// Whether no scanner can have stood there.
    pub(crate) fn is_wrong(&self) -> bool {
        self.n_cells >= MIN_CELLS
            && self.n_double >= WRONG.1
            && self.n_double as f64 >= WRONG.0 * self.n_cells as f64
    }

    /// The message for a scan whose scanner cannot have stood there.
    pub(crate) fn note(&self) -> String {
        format!(
            "{MISPLACED}, and is not used: from there one surface lies before another in {:.1} % of all directions, and both \
             were measured; give the true position with --scanners",
            100.0 * self.n_double as f64 / self.n_cells as f64
        )
    }
}

/// A point as direction and range.
#[derive(Debug, Clone, Copy)]
struct RangedDirection {
    cell: u32,
    to: [f64; 3],
    range: f64,
}

/// Examines points (scan frame, metres) as seen from the origin.
pub(crate) fn look(points: &[[f32; 3]]) -> SeenDirections {
    let mut beams: Vec<RangedDirection> = points.iter().filter_map(|p| beam(*p)).collect();
    for edge in EDGES {
        beams.iter_mut().for_each(|beam| beam.cell = cell(beam.to, edge));
        beams.sort_by_key(|beam| beam.cell);
        if typical(beams.chunk_by(same).map(<[RangedDirection]>::len).collect()) >= IN_CELL {
            break;
        }
    }
    let usual = usual(&beams);
    let mut seen = SeenDirections { n_cells: 0, n_double: 0 };
    for cell in beams.chunk_by(same).filter(|cell| cell.len() >= FEWEST) {
        seen.n_cells += 1;
        let is_full = cell.len() as f64 > FULLER * usual[band(cell)] as f64;
        seen.n_double += usize::from(is_full && is_double(cell));
    }
    seen
}

fn beam(p: [f32; 3]) -> Option<RangedDirection> {
    let p = p.map(f64::from);
    let range = p.iter().map(|v| v * v).sum::<f64>().sqrt();
    (range > 0.0).then(|| RangedDirection { cell: 0, to: p.map(|v| v / range), range })
}

fn same(a: &RangedDirection, b: &RangedDirection) -> bool {
    a.cell == b.cell
}

/// Index of the cell of a direction on a cube with `edge` cells along each edge of a face, all of
/// about the same solid angle.
fn cell(to: [f64; 3], edge: usize) -> u32 {
    let sizes = to.map(f64::abs);
    let axis = (0..3).fold(0, |most, i| if sizes[i] > sizes[most] { i } else { most });
    let along = |i: usize| {
        let angle = (to[(axis + i) % 3] / sizes[axis]).atan() / FRAC_PI_2 + 0.5;
        ((angle * edge as f64) as usize).min(edge - 1)
    };
    let face = 2 * axis + usize::from(to[axis] < 0.0);
    ((face * edge + along(1)) * edge + along(2)) as u32
}

/// Number of points in the cell of the median point.
fn typical(mut lengths: Vec<usize>) -> usize {
    lengths.sort_unstable();
    let half = lengths.iter().sum::<usize>() / 2;
    let mut below = 0;
    let middle = lengths.iter().find(|n| {
        below += **n;
        below > half
    });
    middle.copied().unwrap_or(0)
}

/// The typical number of points of a cell for each band of elevation.
fn usual(beams: &[RangedDirection]) -> [usize; N_BANDS] {
    let mut lengths: [Vec<usize>; N_BANDS] = Default::default();
    beams.chunk_by(same).for_each(|cell| lengths[band(cell)].push(cell.len()));
    lengths.map(typical)
}

/// Index of the elevation band of a cell.
fn band(cell: &[RangedDirection]) -> usize {
    let elevation = cell[0].to[2].clamp(-1.0, 1.0).asin();
    (((elevation / PI + 0.5) * N_BANDS as f64) as usize).min(N_BANDS - 1)
}

/// Whether two surfaces share the whole cell.
fn is_double(cell: &[RangedDirection]) -> bool {
    let some: Vec<RangedDirection> =
        cell.iter().step_by(cell.len().div_ceil(MOST)).copied().collect();
    let mut ranges: Vec<f64> = some.iter().map(|beam| beam.range).collect();
    ranges.sort_by(f64::total_cmp);
    let ratio = |at: &usize| ranges[at + 1] / ranges[*at];
    let widest = (0..ranges.len() - 1).max_by(|a, b| ratio(a).total_cmp(&ratio(b)));
    let Some(at) = widest else { return false };
    let (near, gap) = (ranges[at], ranges[at + 1] - ranges[at]);
    let share = (at + 1) as f64 / ranges.len() as f64;
    if gap < APART.0.max(APART.1 * near) || !(EITHER..=1.0 - EITHER).contains(&share) {
        return false;
    }
    let is_far = |beam: &RangedDirection| beam.range > near + gap / 2.0;
    let n_mixed =
        (0..some.len()).filter(|&i| is_far(&some[i]) != is_far(nearest(&some, i))).count();
    n_mixed as f64 >= MIXED * some.len() as f64
}

/// The beam whose direction is nearest to that of beam `i`.
fn nearest(beams: &[RangedDirection], i: usize) -> &RangedDirection {
    let dot = |k: usize| (0..3).map(|a| beams[i].to[a] * beams[k].to[a]).sum::<f64>();
    let others = (0..beams.len()).filter(|k| *k != i);
    let best = others.max_by(|a, b| dot(*a).total_cmp(&dot(*b)));
    &beams[best.unwrap_or(i)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a scanner at the origin sees of a room with a pillar and a wire fence, 0.3° apart, as
    /// seen from elsewhere.
    fn room(from: [f64; 3]) -> Vec<[f32; 3]> {
        let beams = (-200..200).flat_map(|row| (0..1200).map(move |column| (row, column)));
        let seen = beams.map(|(row, column)| {
            // A fence at 2 m: every fifth beam meets a wire.
            let is_fence = (100..300).contains(&column) && (row * 7 + column) % 5 == 0;
            let to = [row, column].map(|n| f64::from(n) * 0.3);
            met(to, is_fence, from)
        });
        seen.collect()
    }

    /// Where a beam of this elevation and azimuth, degrees, ends in the room, as seen from a place.
    fn met([elevation, azimuth]: [f64; 2], is_fence: bool, from: [f64; 3]) -> [f32; 3] {
        let (elevation, azimuth) = (elevation.to_radians(), azimuth.to_radians());
        let flat = elevation.cos();
        let to = [flat * azimuth.cos(), flat * azimuth.sin(), elevation.sin()];
        // Walls, floor and ceiling.
        let wall = |axis: usize, at: [f64; 2]| {
            let at = if to[axis] < 0.0 { at[0] } else { at[1] };
            if to[axis] == 0.0 { f64::INFINITY } else { at / to[axis] }
        };
        let far = wall(0, [-4.0, 6.0]).min(wall(1, [-5.0, 4.0])).min(wall(2, [-1.6, 3.0]));
        // Boxes of 0.8 m at 2.5 m in four directions, up to 2 m.
        let is_box = (azimuth.to_degrees() % 90.0 - 40.0).abs() < 9.0;
        let near = 2.5 / flat;
        let is_low = near * to[2] < 0.4;
        let range = match (is_fence, is_box && is_low) {
            (true, _) => far.min(2.0 / flat),
            (_, true) => far.min(near),
            _ => far,
        };
        [0, 1, 2].map(|a| (range * to[a] - from[a]) as f32)
    }

    /// A scan of more points than are read, column by column, with a fence all around that half of
    /// the beams meet.
    #[test]
    fn a_large_scan_behind_a_fence_is_not_refused_at_its_true_position() {
        let (n_rows, n_columns) = (1_600_u64, 4_500_u64);
        let n = n_rows * n_columns;
        let run = |first: u64, length: usize| {
            let point = |at: u64| {
                let (row, column) = (at % n_rows, at / n_rows);
                let to = [row as f64 * 0.08 - 64.0, column as f64 * 0.08];
                // Wires as wide as their gaps, 5 cm.
                let is_fence = (to[1] / 1.4).fract() < 0.5;
                (at, met(to, is_fence, [0.0; 3]))
            };
            Ok((first..(first + length as u64).min(n)).map(point).collect())
        };
        let points = crate::sampling::spread((0, n - 1), N_POINTS, N_READ, run).expect("points");
        let seen = look(&points);
        assert!(points.len() > N_POINTS / 2 && !seen.is_wrong(), "{seen:?}");
    }

    #[test]
    fn a_scanner_that_sees_through_surfaces_did_not_stand_there() {
        let right = look(&room([0.0; 3]));
        assert!(!right.is_wrong() && right.n_cells > 5000, "{right:?}");
        for from in [[0.5, 0.0, 0.0], [0.0, -1.0, 0.3], [-2.0, 1.0, 0.0], [0.0, 0.0, -2.5]] {
            let wrong = look(&room(from));
            assert!(wrong.is_wrong(), "{from:?}: {wrong:?}");
        }
        assert!(look(&room([0.0, -1.0, 0.3])).note().contains("cannot be right"));
    }

    #[test]
    fn few_points_tell_nothing() {
        let few: Vec<[f32; 3]> = room([0.0, -1.0, 0.3]).into_iter().step_by(997).collect();
        assert!(!look(&few).is_wrong());
        assert!(!look(&[]).is_wrong() && !look(&[[0.0; 3]; 500]).is_wrong());
    }
}
