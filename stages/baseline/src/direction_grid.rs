//! Angular grids of the points of views, on which the measured point nearest to any place is found
//! by looking at a few pixels (the source, §4).

use contract::View;
use geometry::{Point, Vector, direction};

/// Angular grids of all views with a known scanner.
pub(crate) struct DirectionGrids(Vec<DirectionGrid>);

/// The points of one view by elevation (row) and azimuth (column).
struct DirectionGrid {
    /// Local frame.
    scanner: Point,
    /// Edge of a pixel, radians.
    step: f64,
    /// First row and column.
    low: [i32; 2],
    size: [usize; 2],
    /// Nearest point of each pixel; its range is infinite where there is none.
    cells: Vec<[f32; 3]>,
}

/// Pixels of a grid at most: finer ones are coarsened.
const MAX_CELLS: usize = 1 << 24;
/// Cosine below which a surface is not expected in the scan.
const MIN_FACING: f64 = 0.15;

impl DirectionGrids {
    pub(crate) fn new(views: &[&View]) -> Self {
        Self(views.iter().filter_map(|view| DirectionGrid::new(view)).collect())
    }

    /// Distance from a surface sample (local frame) to the nearest measured point in the windows of
    /// the scans that it faces, at most `cap`; `None` where it faces none.
    pub(crate) fn nearest(&self, p: &Point, n: &Vector, window: i32, cap: f64) -> Option<f64> {
        let mut best: Option<f64> = None;
        for grid in &self.0 {
            let ray = grid.scanner - p;
            if n.dot(&ray) < MIN_FACING * ray.norm() {
                continue;
            }
            let found = grid.nearest(p, window).unwrap_or(cap).min(cap);
            best = Some(best.map_or(found, |b| b.min(found)));
        }
        best
    }
}

impl DirectionGrid {
    fn new(view: &View) -> Option<Self> {
        let scanner = view.scanner?;
        if view.points.is_empty() || view.beam_step <= 0.0 {
            return None;
        }
        let mut step = view.beam_step;
        let angles: Vec<[f64; 2]> =
            view.points.iter().map(|p| angles(&scanner, &Point::from(p.map(f64::from)))).collect();
        loop {
            let pixel = |a: &[f64; 2]| a.map(|v| (v / step).floor() as i32);
            let (mut low, mut high) = ([i32::MAX; 2], [i32::MIN; 2]);
            for at in angles.iter().map(pixel) {
                for i in 0..2 {
                    low[i] = low[i].min(at[i]);
                    high[i] = high[i].max(at[i]);
                }
            }
            let size = [0, 1].map(|i| (high[i] - low[i] + 1) as usize);
            if size[0].saturating_mul(size[1]) > MAX_CELLS {
                step *= 2.0;
                continue;
            }
            let mut cells = vec![[f32::INFINITY; 3]; size[0] * size[1]];
            for (p, a) in view.points.iter().zip(&angles) {
                let at = pixel(a);
                let cell = (at[0] - low[0]) as usize * size[1] + (at[1] - low[1]) as usize;
                let near = |q: &[f32; 3]| (Point::from(q.map(f64::from)) - scanner).norm_squared();
                if !cells[cell][0].is_finite() || near(p) < near(&cells[cell]) {
                    cells[cell] = *p;
                }
            }
            return Some(Self { scanner, step, low, size, cells });
        }
    }

    fn nearest(&self, p: &Point, window: i32) -> Option<f64> {
        let at = angles(&self.scanner, p).map(|v| (v / self.step).floor() as i32);
        let mut best: Option<f64> = None;
        for i in -window..=window {
            for j in -window..=window {
                let (row, col) = (at[0] + i - self.low[0], at[1] + j - self.low[1]);
                if row < 0
                    || col < 0
                    || row as usize >= self.size[0]
                    || col as usize >= self.size[1]
                {
                    continue;
                }
                let cell = self.cells[row as usize * self.size[1] + col as usize];
                if cell[0].is_finite() {
                    let d = (Point::from(cell.map(f64::from)) - p).norm();
                    best = Some(best.map_or(d, |b| b.min(d)));
                }
            }
        }
        best
    }
}

/// Elevation and azimuth from the scanner, radians. A region that straddles ±180° makes a wide
/// grid, no wrong one.
fn angles(scanner: &Point, p: &Point) -> [f64; 2] {
    let d = p - scanner;
    let (azimuth, elevation, _) = direction::spherical([d.x as f32, d.y as f32, d.z as f32]);
    [f64::from(elevation), f64::from(azimuth)]
}
