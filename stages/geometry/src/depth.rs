//! Depth images: for any direction from a scanner into a region, how far the nearest and the
//! farthest beam went.
//!
//! A depth image is a pinhole raster towards the region, so that a look-up needs no trigonometry,
//! with a pyramid of coarser levels above it. Each cell keeps its nearest and its farthest hit, so
//! that robot and background are not averaged at a silhouette.

use crate::Pose;
pub use crate::lanes::{LANES, Lanes, lanes};
use crate::level::DepthLevel;

/// The meaning of a cell without a hit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Empty {
    /// Beams were sent there and none returned: free space, or a dark or shiny surface.
    NoReturn,
    /// No beam was sent there, or it is not known whether one was.
    Unknown,
}

/// A pinhole raster with nearest and farthest range per cell, and coarser levels above it.
#[derive(Debug, Clone)]
pub struct DepthImage {
    camera_from_local: Pose,
    /// `camera_from_local` as rows of `f32`, for inner loops.
    pub(crate) rows: Rows,
    pub(crate) scanner: crate::Point,
    /// Cells of level 0 per unit of tangent.
    focal: f32,
    levels: Vec<DepthLevel>,
}

/// A pose `a_from_b` as three rows of four `f32` (rotation and translation), for inner loops.
pub type Rows = [[f32; 4]; 3];

/// Converts a pose to [`Rows`].
#[must_use]
pub fn rows(pose: &Pose) -> Rows {
    let m = pose.to_homogeneous();
    std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)] as f32))
}

/// Applies a pose to a point, metres.
#[inline]
#[must_use]
pub fn transform(m: &Rows, p: [f32; 3]) -> [f32; 3] {
    let row = |m: &[f32; 4]| m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3];
    [row(&m[0]), row(&m[1]), row(&m[2])]
}

/// Applies a pose to places; the result is the same as that of [`transform`] for each of them.
#[inline]
#[must_use]
pub fn transform_lanes(m: &Rows, p: &Lanes) -> Lanes {
    let mut out = [[0.0; LANES]; 3];
    for (to, m) in out.iter_mut().zip(m) {
        for i in 0..LANES {
            to[i] = m[0] * p[0][i] + m[1] * p[1][i] + m[2] * p[2][i] + m[3];
        }
    }
    out
}

/// Applies the rotation of a pose to a direction.
#[inline]
#[must_use]
pub fn rotate(m: &Rows, p: [f32; 3]) -> [f32; 3] {
    let row = |m: &[f32; 4]| m[0] * p[0] + m[1] * p[1] + m[2] * p[2];
    [row(&m[0]), row(&m[1]), row(&m[2])]
}

impl DepthImage {
    /// An empty raster of `2·half_tangent·focal` cells a side, looking along +z of the camera
    /// frame.
    #[must_use]
    pub fn new(camera_from_local: Pose, half_tangent: f64, focal: f64) -> Self {
        let side = ((2.0 * half_tangent * focal).ceil().clamp(1.0, 8192.0)) as usize;
        let cells = vec![[f32::NAN; 3]; side * side];
        let level = DepthLevel { width: side, height: side, cells };
        let rows = rows(&camera_from_local);
        // Rounded to a micrometre, so that all images of one scanner agree on its position.
        let scanner = camera_from_local.inverse() * crate::Point::origin();
        let scanner = scanner.map(|v| (v * 1e6).round() * 1e-6);
        Self { camera_from_local, rows, scanner, focal: focal as f32, levels: vec![level] }
    }

    /// Position of the scanner in the local frame, metres.
    #[must_use]
    pub fn scanner(&self) -> crate::Point {
        self.scanner
    }

    /// Pose `camera_from_local`; the camera looks along its +z.
    #[must_use]
    pub fn camera_from_local(&self) -> &Pose {
        &self.camera_from_local
    }

    /// Number of cells of level 0 per unit of tangent.
    #[must_use]
    pub fn focal(&self) -> f32 {
        self.focal
    }

    /// Adds a hit, camera frame, metres. Hits outside the raster are ignored.
    #[inline]
    pub fn splat(&mut self, camera: [f32; 3]) {
        let focal = self.focal;
        let level = &mut self.levels[0];
        if let Some((at, range)) = level.find(focal, camera) {
            let cell = &mut level.cells[at];
            // `f32::min` and `f32::max` ignore NaN, which is the value of an empty cell.
            *cell = [cell[0].min(range), cell[1].max(range), f32::NAN];
        }
    }

    /// Adds the first `n` of these hits, as [`DepthImage::splat`] does.
    #[inline]
    pub fn splat_lanes(&mut self, camera: &Lanes, n: usize) {
        let focal = self.focal;
        let level = &mut self.levels[0];
        let (at, range) = level.find_lanes(focal, camera);
        for (at, range) in at.into_iter().zip(range).take(n) {
            if let Some(cell) = level.cells.get_mut(at as usize) {
                *cell = [cell[0].min(range), cell[1].max(range), f32::NAN];
            }
        }
    }

    /// Decides what the empty cells mean and builds the coarser levels. A cell whose neighbours
    /// within `window` cells are all empty gets what `empty` returns for its direction (camera
    /// frame, z = 1); other empty cells are unknown. Call it once, after the last hit.
    pub fn finish(&mut self, window: i32, empty: impl Fn([f32; 3]) -> Empty) {
        let focal = self.focal;
        let base = &mut self.levels[0];
        let (cx, cy) = (0.5 * base.width as f32, 0.5 * base.height as f32);
        base.each_open(window, |u, v| {
            let (u, v) = (u as f32 + 0.5, v as f32 + 0.5);
            empty([(u - cx) / focal, (v - cy) / focal, 1.0]) == Empty::NoReturn
        });
        self.build_levels();
    }

    /// Builds the coarser levels from level 0.
    fn build_levels(&mut self) {
        self.levels.truncate(1);
        while self.levels[self.levels.len() - 1].width > 8 && self.levels.len() < 8 {
            let next = self.levels[self.levels.len() - 1].halved();
            self.levels.push(next);
        }
        self.levels.iter_mut().for_each(DepthLevel::look_around);
    }

    /// Withdraws "no return" where other scans measured a surface in that direction (`local`
    /// frame). Beams that should have ended there and did not return (too near, too dark, too
    /// shiny) prove no free space, and neither do those within `window` cells of them. Where a
    /// share of more than `blind` of those surfaces was missed, no "no return" is trusted.
    pub fn doubt<'m>(
        &mut self,
        matter: impl Iterator<Item = &'m [[f32; 3]]>,
        window: i32,
        blind: f32,
    ) {
        let base = &mut self.levels[0];
        let (mut n_seen, mut silent) = (0_usize, Vec::new());
        for some in matter.flat_map(|places| places.chunks(LANES)) {
            let camera = transform_lanes(&self.rows, &lanes(some));
            for at in base.find_lanes(self.focal, &camera).0.into_iter().take(some.len()) {
                let Some(cell) = base.cells.get(at as usize) else { continue };
                n_seen += 1;
                if cell[0] == f32::INFINITY {
                    silent.push(at as usize);
                }
            }
        }
        if silent.is_empty() {
            return;
        }
        if silent.len() as f32 > blind * n_seen as f32 {
            let all = base.cells.iter_mut().filter(|c| c[0] == f32::INFINITY);
            all.for_each(|c| *c = [f32::NAN; 3]);
        }
        let window = usize::try_from(window).unwrap_or(0);
        for at in silent {
            let (u, v) = (at % base.width, at / base.width);
            for v in v.saturating_sub(window)..(v + window + 1).min(base.height) {
                let row = v * base.width;
                let across = u.saturating_sub(window)..(u + window + 1).min(base.width);
                let cells = &mut base.cells[row + across.start..row + across.end];
                let none = cells.iter_mut().filter(|c| c[0] == f32::INFINITY);
                none.for_each(|c| *c = [f32::NAN; 3]);
            }
        }
        self.build_levels();
    }

    /// What the beams found in the direction of a point (camera frame, metres), in a cell about
    /// `footprint` metres wide; `None` outside the raster or where nothing is known.
    #[inline]
    #[must_use]
    pub fn look(&self, camera: [f32; 3], footprint: f32) -> Option<Look> {
        if camera[2] <= 0.0 {
            return None;
        }
        let (base, inverse) = (&self.levels[0], self.focal / camera[2]);
        let u = camera[0] * inverse + 0.5 * base.width as f32;
        let v = camera[1] * inverse + 0.5 * base.height as f32;
        let [near, far, around] = self.cell([u, v], footprint * inverse)?;
        let range = (camera[0] * camera[0] + camera[1] * camera[1] + camera[2] * camera[2]).sqrt();
        Some(Look { near, far, around, range })
    }

    /// Nearest, farthest and surrounding range at raster coordinates (u, v), from the pyramid level
    /// whose cells are about `cells` cells of level 0 wide.
    #[inline]
    fn cell(&self, [u, v]: [f32; 2], cells: f32) -> Option<[f32; 3]> {
        // The exponent bits give floor(log2); anything below one cell is level 0.
        let level = ((cells.max(1.0).to_bits() >> 23) as usize - 127).min(self.levels.len() - 1);
        let scale = 1.0 / (1u32 << level) as f32;
        let base = &self.levels[0];
        if !(u >= 0.0 && v >= 0.0 && u < base.width as f32 && v < base.height as f32) {
            return None;
        }
        let l = &self.levels[level];
        let cell = l.cells[(v * scale) as usize * l.width + (u * scale) as usize];
        (!cell[0].is_nan()).then_some(cell)
    }

    /// Looks up several places of the camera frame, each as [`DepthImage::look`] does.
    #[inline]
    #[must_use]
    pub fn look_lanes(&self, camera: &Lanes, footprint: f32) -> Looks {
        let base = &self.levels[0];
        let (width, height) = (base.width as f32, base.height as f32);
        let most = self.levels.len() as u32 - 1;
        let mut out = Looks::NOTHING;
        let mut at = [[0_u32; LANES]; 3];
        let [x, y, z] = camera;
        // The first loop has no branches, so that it is vectorised; the second does the look-ups.
        for i in 0..LANES {
            let inverse = self.focal / z[i];
            let (u, v) = (x[i] * inverse + 0.5 * width, y[i] * inverse + 0.5 * height);
            // The level is chosen as in `cell`.
            let cells = (footprint * inverse).max(1.0);
            let level = ((cells.to_bits() >> 23) - 127).min(most);
            let scale = f32::from_bits((127 - level) << 23);
            let is_in = z[i] > 0.0 && u >= 0.0 && v >= 0.0 && u < width && v < height;
            at[0][i] = if is_in { level } else { u32::MAX };
            at[1][i] = (u * scale) as i32 as u32;
            at[2][i] = (v * scale) as i32 as u32;
            out.range[i] = (x[i] * x[i] + y[i] * y[i] + z[i] * z[i]).sqrt();
        }
        let [level, u, v] = at;
        for i in 0..LANES {
            let Some(level) = self.levels.get(level[i] as usize) else { continue };
            let [near, far, around] = level.cells[v[i] as usize * level.width + u[i] as usize];
            (out.near[i], out.far[i], out.around[i]) = (near, far, around);
        }
        out
    }

    /// Looks up a point of the local frame, metres, as [`DepthImage::look`] does.
    #[inline]
    #[must_use]
    pub fn look_at(&self, local: [f32; 3], footprint: f32) -> Option<Look> {
        self.look(transform(&self.rows, local), footprint)
    }
}

/// What the beams found in the direction of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// Nearest hit in the cell, metres; infinite where beams were sent and none returned.
    pub near: f32,
    /// Farthest hit in the cell, metres.
    pub far: f32,
    /// Nearest hit in the cell and its eight neighbours, metres.
    pub around: f32,
    /// Range of the point itself, metres.
    pub range: f32,
}

/// What the beams found in the directions of [`LANES`] places, one entry a place as in [`Look`].
#[derive(Debug, Clone, Copy)]
pub struct Looks {
    /// Nearest hit, metres; NaN where nothing is known.
    pub near: [f32; LANES],
    /// Farthest hit, metres; without meaning where `near` is NaN.
    pub far: [f32; LANES],
    /// Nearest hit in the cell and its neighbours, metres; without meaning where `near` is NaN.
    pub around: [f32; LANES],
    /// Range of the place itself, metres.
    pub range: [f32; LANES],
}

impl Looks {
    /// Looks in directions without beams.
    pub(crate) const NOTHING: Self = Self {
        near: [f32::NAN; LANES],
        far: [f32::NAN; LANES],
        around: [f32::NAN; LANES],
        range: [0.0; LANES],
    };

    /// The look of one lane; `None` if no beam went there.
    #[inline]
    #[must_use]
    pub fn get(&self, i: usize) -> Option<Look> {
        let [near, far, around] = [self.near[i], self.far[i], self.around[i]];
        (!near.is_nan()).then_some(Look { near, far, around, range: self.range[i] })
    }

    /// Sets the look of one lane.
    #[inline]
    pub(crate) fn set(&mut self, i: usize, look: &Look) {
        let Look { near, far, around, range } = *look;
        (self.near[i], self.far[i], self.around[i], self.range[i]) = (near, far, around, range);
    }
}
