//! The CAD cloud of a link as a grid that gives the distance and the normal of the nearest surface
//! for a place in the link's frame.

use geometry::NearestField;
use robot::CadCloud;
use std::ops::Range;

/// Smallest edge of a cell, metres; with samples every 5 mm a cell holds about sixteen.
const MIN_EDGE: f32 = 0.02;
/// Distance around the link up to which the grid reaches, metres; farther points are simply far.
pub(crate) const FIELD_REACH: f32 = 0.16;
/// Largest number of cells of a grid; a larger link gets larger cells.
const MAX_CELLS: f32 = 2.0e6;

/// Offsets of rows of cells about a place, the nearest first, so that most samples of the others
/// need not be examined.
const ROWS: [(isize, isize); 9] =
    [(0, 0), (-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)];
/// Rounding error of distances to cells, metres: single precision, for a few metres.
const ROUNDED: f32 = 1e-5;

/// Samples sorted into cells, with an approximate nearest sample for each cell.
pub(crate) struct DistanceField {
    min: [f32; 3],
    size: [usize; 3],
    edge: f32,
    /// Samples of cell `i` are `starts[i]..starts[i + 1]`.
    starts: Vec<u32>,
    points: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    /// Approximate nearest sample of each cell.
    nearest: NearestField,
    /// Distance along the surface to the nearest sample that is ignored, metres.
    tangent: f32,
}

/// The nearest place on a surface.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NearestPlace {
    /// Distance, metres; measured across the surface where the point lies above it.
    pub(crate) distance: f32,
    /// Outward unit normal there, link frame.
    pub(crate) normal: [f32; 3],
}

impl DistanceField {
    /// The field of a CAD cloud; `None` for a link without a body.
    pub(crate) fn new(cad: &CadCloud) -> Option<Self> {
        let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for p in &cad.points {
            for i in 0..3 {
                min[i] = min[i].min(p[i]);
                max[i] = max[i].max(p[i]);
            }
        }
        if cad.points.is_empty() || !(0..3).all(|i| min[i].is_finite() && max[i].is_finite()) {
            return None;
        }
        let span = [0, 1, 2].map(|i| max[i] - min[i] + 2.0 * FIELD_REACH);
        let edge =
            MIN_EDGE.max(1.5 * cad.spacing).max((span[0] * span[1] * span[2] / MAX_CELLS).cbrt());
        let size = span.map(|s| (s / edge).ceil().max(1.0) as usize);
        let mut field = Self {
            min: min.map(|v| v - FIELD_REACH),
            size,
            edge,
            starts: vec![0; size[0] * size[1] * size[2] + 1],
            points: Vec::new(),
            normals: Vec::new(),
            nearest: NearestField::default(),
            tangent: 0.75 * cad.spacing + 0.001,
        };
        field.fill(cad);
        field.nearest = NearestField::new(&field.points, edge, FIELD_REACH);
        Some(field)
    }

    /// Sorts the samples into their cells.
    fn fill(&mut self, cad: &CadCloud) {
        let cells: Vec<usize> = cad.points.iter().map(|p| self.index(self.cell(*p))).collect();
        for &cell in &cells {
            self.starts[cell + 1] += 1;
        }
        for i in 1..self.starts.len() {
            self.starts[i] += self.starts[i - 1];
        }
        let mut next = self.starts.clone();
        self.points = vec![[0.0; 3]; cells.len()];
        self.normals = vec![[0.0; 3]; cells.len()];
        for (i, &cell) in cells.iter().enumerate() {
            let at = next[cell] as usize;
            next[cell] += 1;
            self.points[at] = cad.points[i];
            self.normals[at] = cad.normals[i];
        }
    }

    /// The nearest place on the surface, if it is within a cell's edge; else an approximate
    /// distance as `Err`, metres, infinite beyond reach.
    pub(crate) fn near(&self, p: [f32; 3]) -> Result<NearestPlace, f32> {
        let Some(sample) = self.nearest.nearest(p) else { return Err(f32::INFINITY) };
        let rough = square(minus(p, self.points[sample])).sqrt();
        // The centre of a cell is at most 0.87 edges from `p`. If a sample is within one edge of
        // `p`, it is within 1.87 of the centre, so that the centre's nearest sample is within 1.87
        // of the centre and 2.74 of `p`.
        if rough > 2.75 * self.edge {
            return Err(rough);
        }
        let (cell, mut best) = (self.cell(p), NearestSample::NONE);
        let gaps = self.gaps(p, cell);
        // A sample this far off cannot be nearer across the surface, even if the part along the
        // surface is ignored.
        let is_beyond = |square: f32, best: f32| {
            let reach = square.sqrt() - self.tangent - ROUNDED;
            reach > 0.0 && reach * reach > best
        };
        for (dy, dz) in ROWS {
            let (y, z) = (cell[1].wrapping_add_signed(dy), cell[2].wrapping_add_signed(dz));
            let aside = gap(gaps[1], dy) + gap(gaps[2], dz);
            if y >= self.size[1] || z >= self.size[2] || is_beyond(aside, best.square) {
                continue;
            }
            // Cells along x are adjacent in memory, so that up to three of them are one run of
            // samples.
            let row = (z * self.size[1] + y) * self.size[0];
            let is_left = cell[0] > 0 && !is_beyond(aside + gaps[0][0], best.square);
            let is_right =
                cell[0] + 1 < self.size[0] && !is_beyond(aside + gaps[0][1], best.square);
            let first = row + cell[0] - usize::from(is_left);
            let last = row + cell[0] + usize::from(is_right);
            let run = self.starts[first] as usize..self.starts[last + 1] as usize;
            best = self.nearest_of(p, run, best);
        }
        if best.square.is_finite() {
            Ok(NearestPlace { distance: best.square.sqrt(), normal: self.normals[best.index] })
        } else {
            Err(rough)
        }
    }

    /// The nearest of a run of samples, if one is nearer than `best`; otherwise `best`.
    fn nearest_of(&self, p: [f32; 3], run: Range<usize>, mut best: NearestSample) -> NearestSample {
        let samples = self.points[run.clone()].iter().zip(&self.normals[run.clone()]);
        for (i, (point, n)) in run.zip(samples) {
            let d = minus(p, *point);
            let across = d[0] * n[0] + d[1] * n[1] + d[2] * n[2];
            if across * across >= best.square {
                continue;
            }
            let along = (square(d) - across * across).max(0.0).sqrt();
            let over = (along - self.tangent).max(0.0);
            let metric = across * across + over * over;
            if metric < best.square {
                best = NearestSample { square: metric, index: i };
            }
        }
        best
    }

    /// Along each axis, squared distances (m²) to the lower and upper neighbour of the cell that
    /// holds a place.
    fn gaps(&self, p: [f32; 3], cell: [usize; 3]) -> [[f32; 2]; 3] {
        std::array::from_fn(|i| {
            let low = self.min[i] + cell[i] as f32 * self.edge;
            [p[i] - low, low + self.edge - p[i]].map(|gap| gap.max(0.0).powi(2))
        })
    }

    /// Every `step`-th sample and its normal.
    pub(crate) fn samples(&self, step: usize) -> impl Iterator<Item = ([f32; 3], [f32; 3])> + '_ {
        self.points.iter().copied().zip(self.normals.iter().copied()).step_by(step.max(1))
    }

    /// Number of samples.
    pub(crate) fn len(&self) -> usize {
        self.points.len()
    }

    fn cell(&self, p: [f32; 3]) -> [usize; 3] {
        [0, 1, 2].map(|i| (((p[i] - self.min[i]) / self.edge) as usize).min(self.size[i] - 1))
    }

    fn index(&self, cell: [usize; 3]) -> usize {
        (cell[2] * self.size[1] + cell[1]) * self.size[0] + cell[0]
    }
}

/// The squared distance to the neighbour on this side; 0 for the cell itself.
fn gap(gaps: [f32; 2], side: isize) -> f32 {
    match side {
        0 => 0.0,
        1.. => gaps[1],
        _ => gaps[0],
    }
}

fn minus(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// The nearest sample so far.
#[derive(Debug, Clone, Copy)]
struct NearestSample {
    /// Squared distance, m².
    square: f32,
    index: usize,
}

impl NearestSample {
    const NONE: Self = Self { square: f32::INFINITY, index: 0 };
}

fn square(v: [f32; 3]) -> f32 {
    v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples every 5 mm on a square of 0.4 m at z = 0, normal up.
    fn plate() -> CadCloud {
        let at = |i: i32| i as f32 * 0.005 - 0.2;
        let points: Vec<_> = (0..81 * 81).map(|n| [at(n % 81), at(n / 81), 0.0]).collect();
        CadCloud {
            normals: vec![[0.0, 0.0, 1.0]; points.len()],
            points,
            spacing: 0.005,
            area: 0.16,
        }
    }

    #[test]
    fn distance_is_across_the_surface_and_grows_past_its_edge() {
        let field = DistanceField::new(&plate()).expect("has samples");
        let near = field.near([0.0512, 0.0833, 0.007]).expect("near");
        assert!((near.distance - 0.007).abs() < 1e-5);
        let beside = field.near([0.22, 0.0, 0.0]).expect("near");
        assert!((beside.distance - 0.0155).abs() < 0.002, "{}", beside.distance);
        let rough = field.near([0.0, 0.0, 0.1]).expect_err("far");
        assert!((rough - 0.1).abs() < 0.03, "{rough}");
        assert_eq!(field.near([0.0, 0.0, 1.0]).expect_err("outside"), f32::INFINITY);
        assert!(DistanceField::new(&CadCloud::default()).is_none());
    }

    #[test]
    fn no_sample_that_is_passed_over_is_nearer() {
        // A ball has normals in all directions, with samples so sparse that tangents matter.
        let points: Vec<[f32; 3]> = (0..4000)
            .map(|i| {
                let (z, turn) = (1.0 - (i as f32 + 0.5) / 2000.0, i as f32 * 2.399_963);
                let r = (1.0 - z * z).sqrt();
                [r * turn.cos(), r * turn.sin(), z].map(|v| 0.1 * v)
            })
            .collect();
        let normals = points.iter().map(|p| p.map(|v| v / 0.1)).collect();
        let cad = CadCloud { points, normals, spacing: 0.006, area: 0.126 };
        let field = DistanceField::new(&cad).expect("has samples");
        let mut n_near = 0;
        for i in 0..4000 {
            let (a, b, c) = (i % 16, i / 16 % 16, i / 256);
            let p = [a, b, c].map(|v| 0.017 * v as f32 - 0.13);
            let Ok(near) = field.near(p) else { continue };
            n_near += 1;
            let best = field.nearest_of(p, 0..field.len(), NearestSample::NONE);
            assert!(
                near.distance <= best.square.sqrt() || best.square.sqrt() > field.edge,
                "{p:?}"
            );
        }
        assert!(n_near > 500, "{n_near}");
    }
}
