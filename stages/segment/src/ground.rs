//! The floor as dense rasters: gives the height above the floor and the default label of any place
//! in constant time.

use crate::settings::Settings;
use contract::{Floor, FloorLevel, Label};
use geometry::narrow::{floor_i32, local_f32};

/// Largest number of cells of a dense raster: 4 km² at 0.5 m. The heights of a level with stray
/// cells farther apart are looked up by search.
const MAX_CELLS: i64 = 1 << 24;
/// Half-thickness of a floor in standard deviations of its points: one point in 30,000 lies beyond.
const SCATTERS: f64 = 4.0;
/// Smallest half-thickness of a floor, metres: dust and paint.
const MIN_BAND: f64 = 0.005;

/// The floor, prepared for a look-up at every point of a plant.
#[derive(Debug, Clone)]
pub struct FloorHeights {
    levels: Vec<HeightLevel>,
    depth: f64,
}

#[derive(Debug, Clone)]
struct HeightLevel {
    heights: Heights,
    /// Half-thickness of the floor above its heights, metres.
    band: f64,
}

#[derive(Debug, Clone)]
enum Heights {
    Dense(HeightRaster),
    Sparse(FloorLevel),
}

/// Heights at the centres of cells. Cells without a height next to known ones have that of the mean
/// plane, others are NaN.
#[derive(Debug, Clone)]
struct HeightRaster {
    /// Number of cells per metre.
    per_metre: f64,
    min: [i32; 2],
    width: usize,
    heights: Vec<f32>,
    /// Subtracted from heights, metres, so that `f32` is precise far above sea level.
    base: f64,
    /// Lowest and highest height, metres.
    span: [f64; 2],
}

impl FloorHeights {
    /// The floor as found, with the thickness that `settings` give.
    #[must_use]
    pub fn new(floor: &Floor, settings: &Settings) -> Self {
        let levels = floor.levels.iter().filter(|level| !level.heights.is_empty());
        Self {
            levels: levels
                .map(|level| HeightLevel {
                    heights: HeightRaster::new(level)
                        .map_or_else(|| Heights::Sparse(level.clone()), Heights::Dense),
                    band: (SCATTERS * level.scatter).max(MIN_BAND).min(settings.floor_band),
                })
                .collect(),
            depth: settings.floor_depth,
        }
    }

    /// Height of a place (world, metres) above the nearest floor level below it, metres; a level up
    /// to `floor_depth` above counts as below. `None` where no level is near.
    #[inline]
    #[must_use]
    pub fn height_above(&self, world: [f64; 3]) -> Option<f64> {
        let mut best: Option<f64> = None;
        for level in &self.levels {
            let floor = match &level.heights {
                Heights::Dense(raster) => raster.height(world[0], world[1]),
                Heights::Sparse(level) => level.height(world[0], world[1]),
            };
            if let Some(above) = floor.map(|h| world[2] - h).filter(|h| *h >= -self.depth) {
                best = Some(best.map_or(above, |b| b.min(above)));
            }
        }
        best
    }

    /// Whether a place (world, metres) lies on the floor, on any of its levels.
    #[inline]
    #[must_use]
    pub fn is_floor(&self, world: [f64; 3]) -> bool {
        let is_on = |band: f64, floor: Option<f64>| {
            floor.is_some_and(|h| (-self.depth..=band).contains(&(world[2] - h)))
        };
        self.levels.iter().any(|level| match &level.heights {
            // Most points of a plant are far above the floor or below the ceiling.
            Heights::Dense(raster) => {
                world[2] - level.band <= raster.span[1]
                    && world[2] + self.depth >= raster.span[0]
                    && is_on(level.band, raster.height(world[0], world[1]))
            }
            Heights::Sparse(own) => is_on(level.band, own.height(world[0], world[1])),
        })
    }

    /// The label of a point by its place alone: floor or fixed.
    #[inline]
    #[must_use]
    pub fn label(&self, world: [f64; 3]) -> Label {
        if self.is_floor(world) { Label::FLOOR } else { Label::FIXED }
    }
}

impl HeightRaster {
    /// The dense form of a level; `None` where it would be too large.
    fn new(level: &FloorLevel) -> Option<Self> {
        let cells = || level.heights.iter().map(|entry| entry.0);
        // A margin of two cells, up to which `FloorLevel::height` uses the mean plane.
        let low = |axis: usize| Some(i64::from(cells().map(|c| c[axis]).min()?) - 2);
        let high = |axis: usize| Some(i64::from(cells().map(|c| c[axis]).max()?) + 2);
        let (width, depth) = (high(0)? - low(0)? + 1, high(1)? - low(1)? + 1);
        if width.saturating_mul(depth) > MAX_CELLS {
            return None;
        }
        let min = [i32::try_from(low(0)?).ok()?, i32::try_from(low(1)?).ok()?];
        let (width, depth) = (width as usize, depth as usize);
        let base = level.heights[0].1;
        let mut heights = vec![f32::NAN; width * depth];
        let at = |c: [i32; 2]| ((c[0] - min[0]) as usize, (c[1] - min[1]) as usize);
        for (cell, _) in &level.heights {
            let (u, v) = at(*cell);
            for (dv, du) in (0..25).map(|n| (n / 5, n % 5)) {
                let (u, v) = (u + du - 2, v + dv - 2);
                let (x, y) = (i64::from(min[0]) + u as i64, i64::from(min[1]) + v as i64);
                let mean =
                    level.mean_height((x as f64 + 0.5) * level.cell, (y as f64 + 0.5) * level.cell);
                heights[v * width + u] = local_f32(mean - base);
            }
        }
        for (cell, height) in &level.heights {
            let (u, v) = at(*cell);
            heights[v * width + u] = local_f32(height - base);
        }
        let known = || heights.iter().filter(|h| !h.is_nan()).map(|h| base + f64::from(*h));
        let span = [known().fold(f64::MAX, f64::min), known().fold(f64::MIN, f64::max)];
        Some(Self { per_metre: 1.0 / level.cell, min, width, heights, base, span })
    }

    /// Height by bilinear interpolation between the centres of cells, metres; where not all four
    /// are known, from those that are.
    #[inline]
    fn height(&self, x: f64, y: f64) -> Option<f64> {
        let (u, v) = (x * self.per_metre - 0.5, y * self.per_metre - 0.5);
        let (i, j) = (floor_i32(u), floor_i32(v));
        let (fu, fv) = (u - f64::from(i), v - f64::from(j));
        let (i, j) = (i64::from(i) - i64::from(self.min[0]), i64::from(j) - i64::from(self.min[1]));
        // The common case: all four cells lie within the raster.
        if i >= 0 && j >= 0 && i + 1 < self.width as i64 {
            let at = j as usize * self.width + i as usize;
            if let (Some([a, b]), Some([c, d])) =
                (self.pair(at), self.pair(at.saturating_add(self.width)))
            {
                let mean = (1.0 - fv) * (a + fu * (b - a)) + fv * (c + fu * (d - c));
                if !mean.is_nan() {
                    return Some(mean + self.base);
                }
            }
        }
        self.known_height([i, j], [fu, fv])
    }

    /// Heights of two neighbours in a row, if both are known.
    #[inline]
    fn pair(&self, at: usize) -> Option<[f64; 2]> {
        let pair = self.heights.get(at..at.checked_add(2)?)?;
        Some([f64::from(pair[0]), f64::from(pair[1])])
    }

    /// The height at the border of the known cells, from those of the four cells around a place
    /// that are known: `cell` is the lowest of them, and `fraction` the place between their
    /// centres, 0 to 1 along each axis.
    #[cold]
    fn known_height(&self, cell: [i64; 2], fraction: [f64; 2]) -> Option<f64> {
        let ([i, j], [fu, fv]) = (cell, fraction);
        let (mut sum, mut weight) = (0.0, 0.0);
        for (di, dj, w) in [
            (0, 0, (1.0 - fu) * (1.0 - fv)),
            (1, 0, fu * (1.0 - fv)),
            (0, 1, (1.0 - fu) * fv),
            (1, 1, fu * fv),
        ] {
            let (i, j) = (i + di, j + dj);
            if i < 0 || j < 0 || i >= self.width as i64 {
                continue;
            }
            let Some(&h) = self.heights.get(j as usize * self.width + i as usize) else {
                continue;
            };
            if !h.is_nan() {
                sum += (w + 1e-6) * f64::from(h);
                weight += w + 1e-6;
            }
        }
        (weight > 0.0).then(|| sum / weight + self.base)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Plane, Vector};

    #[test]
    fn wavy_floor_is_floor_and_what_stands_on_it_is_not() {
        let cell = 0.25;
        let wave = |x: f64, y: f64| 100.0 + 0.01 * (x * 0.8).sin() + 0.01 * y;
        let mut heights = Vec::new();
        for i in -20..20 {
            for j in -20..20 {
                if (i, j) != (3, 3) {
                    heights.push((
                        [i, j],
                        wave((f64::from(i) + 0.5) * cell, (f64::from(j) + 0.5) * cell),
                    ));
                }
            }
        }
        let normal = Vector::new(0.0, -0.01, 1.0).normalize();
        let plane = Plane { normal, offset: normal.z * 100.0 };
        let (waviness, scatter, area) = (0.007, 0.003, 100.0);
        let level = FloorLevel { plane, waviness, scatter, area, cell, heights };
        let floor = Floor { levels: vec![level], planes: Vec::new() };
        let ground = FloorHeights::new(&floor, &Settings::default());
        for (x, y) in [(0.1, 0.2), (-3.3, 4.1), (4.2, -4.4)] {
            let z = wave(x, y);
            assert_eq!(ground.label([x, y, z + 0.004]), Label::FLOOR);
            assert_eq!(ground.label([x, y, z - 0.01]), Label::FLOOR);
            assert_eq!(ground.label([x, y, z + 0.03]), Label::FIXED);
            assert_eq!(ground.label([x, y, z - 1.0]), Label::FIXED);
            let (dense, sparse) =
                (ground.height_above([x, y, z]), floor.height_above([x, y, z], 0.03));
            assert!((dense.expect("near") - sparse.expect("near")).abs() < 1e-3);
        }
        assert_eq!(ground.height_above([50.0, 0.0, 100.0]), None);
    }
}
