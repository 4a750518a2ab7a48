//! Depth images: the points of one scan inside a region, as its scanner saw them. Points in; out
//! comes, for any direction, how far the nearest and the farthest beam went.
//!
//! A depth image is a pinhole raster towards the region (no trigonometry per look-up), with a
//! pyramid above it. Each cell keeps the nearest and the farthest hit, so that a silhouette does
//! not average robot and background.

use crate::Pose;
pub use crate::lanes::{LANES, Lanes, lanes};
use crate::level::DepthLevel;

/// What a cell without a hit means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Empty {
    /// Beams went there and none came back: free space, or dark or shiny matter.
    NoReturn,
    /// No beam went there, or nobody knows.
    Unknown,
}

/// A pinhole raster with nearest and farthest range per cell, and coarser levels above it.
#[derive(Debug, Clone)]
pub struct DepthImage {
    camera_from_local: Pose,
    /// The same for inner loops.
    pub(crate) rows: Rows,
    pub(crate) scanner: crate::Point,
    /// Cells of level 0 per unit tangent.
    focal: f32,
    levels: Vec<DepthLevel>,
}

/// `a_from_b` as three rows of four f32, for inner loops.
pub type Rows = [[f32; 4]; 3];

/// A pose as three rows of four f32.
#[must_use]
pub fn rows(pose: &Pose) -> Rows {
    let m = pose.to_homogeneous();
    std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)] as f32))
}

/// Applies [`Rows`] to a point.
#[inline]
#[must_use]
pub fn transform(m: &Rows, p: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|r| m[r][0] * p[0] + m[r][1] * p[1] + m[r][2] * p[2] + m[r][3])
}

/// Applies [`Rows`] to places, each as [`transform`] does.
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

/// Applies the rotation of [`Rows`] to a direction.
#[inline]
#[must_use]
pub fn rotate(m: &Rows, p: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|r| m[r][0] * p[0] + m[r][1] * p[1] + m[r][2] * p[2])
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
        // To a micrometre, so that images of one scanner agree.
        let scanner = camera_from_local.inverse() * crate::Point::origin();
        let scanner = scanner.map(|v| (v * 1e6).round() * 1e-6);
        Self { camera_from_local, rows, scanner, focal: focal as f32, levels: vec![level] }
    }

    /// Where the scanner stands, in the local frame.
    #[must_use]
    pub fn scanner(&self) -> crate::Point {
        self.scanner
    }

    /// Camera frame from local frame; the camera looks along its +z.
    #[must_use]
    pub fn camera_from_local(&self) -> &Pose {
        &self.camera_from_local
    }

    /// Cells of level 0 per unit tangent.
    #[must_use]
    pub fn focal(&self) -> f32 {
        self.focal
    }

    /// Adds a hit given in the camera frame. Outside the raster it is passed over.
    #[inline]
    pub fn splat(&mut self, camera: [f32; 3]) {
        let focal = self.focal;
        let level = &mut self.levels[0];
        if let Some((at, range)) = level.find(focal, camera) {
            let cell = &mut level.cells[at];
            // `min`/`max` of f32 pass NaN over, which is what an empty cell needs.
            *cell = [cell[0].min(range), cell[1].max(range), f32::NAN];
        }
    }

    /// The same for the first `n` of some lanes.
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

    /// Says for each cell that is empty with all its neighbours within `window` cells what that
    /// means (given the direction in the camera frame, z = 1), and builds the coarser levels.
    /// Call once, after the last splat.
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

    /// The coarser levels, from level 0.
    fn build_levels(&mut self) {
        self.levels.truncate(1);
        while self.levels[self.levels.len() - 1].width > 8 && self.levels.len() < 8 {
            let next = self.levels[self.levels.len() - 1].halved();
            self.levels.push(next);
        }
        self.levels.iter_mut().for_each(DepthLevel::look_around);
    }

    /// Takes back "no return" where others measured matter in that direction (local frame): beams
    /// that ought to have ended and did not come back (too near, too dark, too shiny) prove no
    /// free space, nor do those within `window` cells of them; nor does any, where a share of
    /// `blind` of that matter went unseen.
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

    /// What the beams found at a camera-frame point, in a cell about `footprint` metres wide;
    /// `None` outside the raster or where nothing is known.
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

    /// What is known at a place of the raster, in a cell of the level above that is about `cells`
    /// wide.
    #[inline]
    fn cell(&self, [u, v]: [f32; 2], cells: f32) -> Option<[f32; 3]> {
        // floor(log2) by the exponent bits; below one cell is level 0.
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

    /// The same as [`DepthImage::look`] for lanes of the camera frame.
    #[inline]
    #[must_use]
    pub fn look_lanes(&self, camera: &Lanes, footprint: f32) -> Looks {
        let base = &self.levels[0];
        let (width, height) = (base.width as f32, base.height as f32);
        let most = self.levels.len() as u32 - 1;
        let mut out = Looks::NOTHING;
        let mut at = [[0_u32; LANES]; 3];
        let [x, y, z] = camera;
        // One loop without branches, so that it becomes vector instructions; then one of look-ups.
        for i in 0..LANES {
            let inverse = self.focal / z[i];
            let (u, v) = (x[i] * inverse + 0.5 * width, y[i] * inverse + 0.5 * height);
            // As in `cell`.
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

    /// The same for a point of the local frame.
    #[inline]
    #[must_use]
    pub fn look_at(&self, local: [f32; 3], footprint: f32) -> Option<Look> {
        self.look(transform(&self.rows, local), footprint)
    }
}

/// What the beams found in the direction of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// Nearest hit in the cell, metres; infinite where beams went and none came back.
    pub near: f32,
    /// Farthest hit in the cell, metres.
    pub far: f32,
    /// Nearest hit in the cell and its eight neighbours, metres.
    pub around: f32,
    /// Range of the point itself, metres.
    pub range: f32,
}

/// What the beams found in the directions of lanes; as in [`Look`].
#[derive(Debug, Clone, Copy)]
pub struct Looks {
    /// NaN where nothing is known.
    pub near: [f32; LANES],
    /// Without meaning there, as the next.
    pub far: [f32; LANES],
    /// As in [`Look`].
    pub around: [f32; LANES],
    /// As in [`Look`].
    pub range: [f32; LANES],
}

impl Looks {
    /// Nothing is known anywhere.
    pub(crate) const NOTHING: Self = Self {
        near: [f32::NAN; LANES],
        far: [f32::NAN; LANES],
        around: [f32::NAN; LANES],
        range: [0.0; LANES],
    };

    /// Of one lane; `None` where nothing is known.
    #[inline]
    #[must_use]
    pub fn get(&self, i: usize) -> Option<Look> {
        let [near, far, around] = [self.near[i], self.far[i], self.around[i]];
        (!near.is_nan()).then_some(Look { near, far, around, range: self.range[i] })
    }

    /// Sets one lane.
    #[inline]
    pub(crate) fn set(&mut self, i: usize, look: &Look) {
        let Look { near, far, around, range } = *look;
        (self.near[i], self.far[i], self.around[i], self.range[i]) = (near, far, around, range);
    }
}
