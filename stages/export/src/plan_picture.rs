//! Draws the plan of an input: the plant from above, by its labelled points.

use crate::body_cells::BodyCells;
use crate::canvas::{Canvas, INK, Rgb, WHITE, blend, robot_color};
use crate::font::TextSize::{Body, Title};
use crate::picture_names::PictureNames;
use contract::{Label, PointKind};
use geometry::Aabb;
use std::sync::atomic::{AtomicU16, AtomicU32, Ordering::Relaxed};

/// Smallest cell, metres.
const MIN_CELL: f64 = 0.02;
/// Largest number of cells along a side; a larger plant gets larger cells.
const MAX_SIDE: f64 = 2400.0;
/// Smallest length of the longer side, pixels; cells are drawn larger to reach it.
const MIN_PIXELS: usize = 900;
/// Height above the floor up to which what stands still is drawn, metres.
const SHOWN: f64 = 3.0;
/// Margin around the plan, pixels.
const MARGIN: i64 = 48;
/// Distances of grid lines, metres, and pixels that two of them are apart at least.
const GRID: [f64; 8] = [0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0];
const GRID_PIXELS: f64 = 90.0;

/// Counts of points by ground cell. Workers count concurrently, since sums do not depend on order.
#[derive(Debug)]
pub struct PlanPicture {
    min: [f64; 2],
    cell: f64,
    /// Number of cells per metre.
    per_metre: f64,
    /// Height above which what stands still is left out, metres: a ceiling would hide everything.
    top: f64,
    width: usize,
    height: usize,
    cells: Vec<PlanCell>,
}

/// A robot in a plan; places are in the world frame, metres.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanRobot {
    /// Its name.
    pub name: String,
    /// Its base.
    pub at: [f64; 2],
    /// How far from its base any part of it can be; 0 draws no circle.
    pub reach: f64,
    /// Points of its surface in the posture that was found, around which its outline runs.
    pub body: Vec<[f64; 2]>,
}

#[derive(Debug, Default)]
struct PlanCell {
    n_floor: AtomicU32,
    n_fixed: AtomicU32,
    n_uncertain: AtomicU32,
    n_moving: AtomicU32,
    /// Largest `u16::MAX - robot` in the cell, which gives the lowest robot; 0 for none.
    robot: AtomicU16,
}

impl PlanPicture {
    /// A plan of these bounds (world, metres); points outside are ignored.
    #[must_use]
    pub fn new(bounds: &Aabb) -> Self {
        let known = !bounds.is_empty()
            && (0..2).all(|i| bounds.min[i].is_finite() && bounds.max[i].is_finite());
        let bounds = if known { *bounds } else { Aabb { min: [0.0; 3], max: [1.0; 3] } };
        let size = bounds.size();
        let cell = MIN_CELL.max(size[0].max(size[1]) / MAX_SIDE);
        let [width, height] = [0, 1].map(|i| ((size[i] / cell).floor() as usize).max(1) + 1);
        Self {
            min: [bounds.min[0], bounds.min[1]],
            cell,
            per_metre: 1.0 / cell,
            top: f64::INFINITY,
            width,
            height,
            cells: (0..width * height).map(|_| PlanCell::default()).collect(),
        }
    }

    /// Leaves out what stands still and is higher than this above the floor, whose height is known.
    #[must_use]
    pub fn over_floor(self, floor: Option<f64>) -> Self {
        Self { top: floor.map_or(f64::INFINITY, |floor| floor + SHOWN), ..self }
    }

    /// Adds labelled points, world, metres.
    pub fn add(&self, world: &[[f64; 3]], labels: &[Label]) {
        // Neighbouring points mostly fall into the same cell and are counted together.
        let mut last = (None, Label::FIXED);
        let mut n = 0;
        for (p, label) in world.iter().zip(labels) {
            let is_hidden =
                p[2] > self.top && matches!(label.kind, PointKind::Fixed | PointKind::Uncertain);
            let now = (self.at([p[0], p[1]]).filter(|_| !is_hidden), *label);
            if now != last {
                self.count(last.0, last.1, n);
                (last, n) = (now, 0);
            }
            n += 1;
        }
        self.count(last.0, last.1, n);
    }

    fn count(&self, at: Option<usize>, label: Label, n: u32) {
        let Some(at) = at else { return };
        let cell = &self.cells[at];
        let count = match label.kind {
            PointKind::Floor => &cell.n_floor,
            PointKind::Fixed => &cell.n_fixed,
            PointKind::Uncertain => &cell.n_uncertain,
            PointKind::Link | PointKind::Attachment => {
                let robot = u16::try_from(label.robot).map_or(0, |r| u16::MAX - r);
                cell.robot.fetch_max(robot, Relaxed);
                &cell.n_moving
            }
        };
        count.fetch_add(n, Relaxed);
    }

    /// Draws the plan with robots, their outlines and reach, and scanners (names and positions,
    /// world, metres).
    #[must_use]
    pub fn draw(
        &self,
        title: &str,
        robots: &[PlanRobot],
        scanners: &[(String, [f64; 2])],
    ) -> Canvas {
        let zoom = (MIN_PIXELS / self.width.max(self.height)).clamp(1, 8) as i64;
        let (w, h) = (self.width as i64 * zoom, self.height as i64 * zoom);
        let mut canvas =
            Canvas::new((w.max(420) + 2 * MARGIN) as usize, (h + 3 * MARGIN + 58) as usize);
        let full = self.full();
        for v in 0..self.height {
            for u in 0..self.width {
                let color = self.cells[v * self.width + u].color(full);
                // North is up.
                let y = 2 * MARGIN + (self.height - 1 - v) as i64 * zoom;
                canvas.fill(MARGIN + u as i64 * zoom, y, zoom, zoom, color);
            }
        }
        let place = |p: &[f64; 2]| {
            let x = MARGIN + ((p[0] - self.min[0]) / self.cell * zoom as f64) as i64;
            (x, 2 * MARGIN + h - 1 - ((p[1] - self.min[1]) / self.cell * zoom as f64) as i64)
        };
        self.grid(&mut canvas, zoom, h);
        for (i, robot) in robots.iter().enumerate() {
            let radius = robot.reach / self.cell * zoom as f64;
            let (x, y) = place(&robot.at);
            let colour = robot_color(i);
            canvas.ring([x, y], radius, colour, [MARGIN, 2 * MARGIN, MARGIN + w, 2 * MARGIN + h]);
            self.outline(&mut canvas, zoom, &robot.body, blend(colour, INK, 0.6));
        }
        let dots: Vec<_> = scanners.iter().map(|(_, at)| (place(at), SCANNER)).collect();
        let own = robots.iter().enumerate().map(|(i, robot)| (place(&robot.at), robot_color(i)));
        let dots: Vec<_> = dots.into_iter().chain(own).collect();
        let bounds = [MARGIN, 2 * MARGIN, MARGIN + w, 2 * MARGIN + h];
        let mut names = PictureNames::new(bounds);
        for &((x, y), colour) in &dots {
            canvas.disc(x, y, 5, WHITE);
            canvas.disc(x, y, 4, colour);
            names.keep_free([x - 5, y - 5, x + 6, y + 6]);
        }
        let (scanner_dots, robot_dots) = dots.split_at(scanners.len());
        for (robot, &((x, y), colour)) in robots.iter().zip(robot_dots) {
            names.write(&mut canvas, [x, y], Title, colour, &robot.name);
        }
        for ((name, _), &((x, y), _)) in scanners.iter().zip(scanner_dots) {
            names.write(&mut canvas, [x, y], Body, [160, 0, 50], name);
        }
        canvas.text(MARGIN, MARGIN / 2, Title, INK, title);
        self.scale_bar(&mut canvas, zoom, 2 * MARGIN + h + 32);
        canvas
    }

    /// Draws lines at round coordinates, with the coordinates beside them.
    fn grid(&self, canvas: &mut Canvas, zoom: i64, h: i64) {
        let pixels = zoom as f64 / self.cell;
        let far = |step: &f64| step * pixels >= GRID_PIXELS;
        let step = GRID.into_iter().find(far).unwrap_or(GRID[GRID.len() - 1]);
        let side = [self.width, self.height].map(|n| n as f64 * self.cell);
        for axis in 0..2 {
            let first = (self.min[axis] / step).ceil();
            let n = ((self.min[axis] + side[axis]) / step - first).floor() as i64;
            for k in 0..=n {
                let value = (first + k as f64) * step;
                let at = ((value - self.min[axis]) * pixels) as i64;
                let words = format!("{value}");
                if axis == 0 {
                    canvas.shade([MARGIN + at, 2 * MARGIN], [1, h], INK, LINE_SHARE);
                    let left = MARGIN + at - Canvas::text_width(Body, &words) / 2;
                    canvas.text(left, 2 * MARGIN + h + 5, Body, GREY, &words);
                } else {
                    let (y, w) = (2 * MARGIN + h - 1 - at, self.width as i64 * zoom);
                    canvas.shade([MARGIN, y], [w, 1], INK, LINE_SHARE);
                    canvas.text_to(MARGIN - 5, y - 4, Body, GREY, &words);
                }
            }
        }
    }

    /// Draws the outline of points as cells that they fill, and the cells beside these.
    fn outline(&self, canvas: &mut Canvas, zoom: i64, body: &[[f64; 2]], colour: Rgb) {
        let cell =
            |p: &[f64; 2]| [0, 1].map(|i| ((p[i] - self.min[i]) * self.per_metre).floor() as i64);
        let (w, h) = (self.width as i64, self.height as i64);
        let body = BodyCells::new(body.iter().map(cell), [w, h]);
        for [u, v] in body.cells().filter(|[u, v]| (0..w).contains(u) && (0..h).contains(v)) {
            let edges = [[u - 1, v], [u + 1, v], [u, v - 1], [u, v + 1]];
            if !edges.into_iter().all(|side| body.has(side)) {
                let y = 2 * MARGIN + (h - 1 - v) * zoom;
                canvas.fill(MARGIN + u * zoom, y, zoom, zoom, colour);
            }
        }
    }

    /// Draws a scale bar of a round length, about a quarter of the plan.
    fn scale_bar(&self, canvas: &mut Canvas, zoom: i64, y: i64) {
        let quarter = self.width as f64 * self.cell / 4.0;
        let metres = GRID.into_iter().rfind(|m| *m <= quarter).unwrap_or(0.5);
        let pixels = (metres / self.cell * zoom as f64) as i64;
        canvas.fill(MARGIN, y, pixels, 3, INK);
        canvas.text(MARGIN, y + 8, Body, INK, &format!("{metres} m"));
        let legend =
            [("floor", FLOOR), ("fixed", FIXED), ("uncertain", UNCERTAIN), ("scanner", SCANNER)];
        let reach = "circles: reach, lines: outlines of robots; grid in metres";
        canvas.text(MARGIN, y + 26, Body, INK, reach);
        if self.top.is_finite() {
            let cut = format!("without what stands still higher than {SHOWN} m above the floor");
            canvas.text(MARGIN, y + 44, Body, INK, &cut);
        }
        let mut x = MARGIN + pixels.max(48) + 24;
        for (name, color) in legend {
            canvas.fill(x, y + 7, 10, 10, color);
            canvas.text(x + 14, y + 8, Body, INK, name);
            x += 14 + Canvas::text_width(Body, name) + 16;
        }
    }

    /// Number of points in a well filled cell: the 98th percentile of the cells with standing
    /// points.
    fn full(&self) -> f64 {
        let mut counts: Vec<u32> =
            self.cells.iter().map(PlanCell::n_standing).filter(|n| *n > 0).collect();
        if counts.is_empty() {
            return 1.0;
        }
        let at = (counts.len() - 1) * 98 / 100;
        f64::from(*counts.select_nth_unstable(at).1).max(1.0)
    }

    #[inline]
    fn at(&self, p: [f64; 2]) -> Option<usize> {
        let [u, v] = [0, 1].map(|i| (p[i] - self.min[i]) * self.per_metre);
        let inside = u >= 0.0 && v >= 0.0 && u < self.width as f64 && v < self.height as f64;
        inside.then(|| v as usize * self.width + u as usize)
    }
}

/// Colour of coordinates, and how dark grid lines make what they lie on.
const GREY: Rgb = [90, 96, 104];
const LINE_SHARE: f64 = 0.25;
const FLOOR: Rgb = [232, 234, 230];
const FIXED: Rgb = [120, 126, 134];
const UNCERTAIN: Rgb = [236, 190, 60];
const SCANNER: Rgb = [200, 0, 60];

impl PlanCell {
    fn n_standing(&self) -> u32 {
        self.n_fixed.load(Relaxed).saturating_add(self.n_uncertain.load(Relaxed))
    }

    fn color(&self, full: f64) -> Rgb {
        let robot = self.robot.load(Relaxed);
        if self.n_moving.load(Relaxed) > 0 && robot > 0 {
            return robot_color(usize::from(u16::MAX - robot));
        }
        if self.n_uncertain.load(Relaxed) > self.n_fixed.load(Relaxed) {
            return UNCERTAIN;
        }
        let standing = f64::from(self.n_standing());
        if standing > 0.0 {
            // A logarithmic scale makes a cable beside a wall visible.
            let share = (1.0 + standing).ln() / (1.0 + full).ln();
            return blend(FLOOR, [60, 64, 70], 0.25 + 0.75 * share);
        }
        if self.n_floor.load(Relaxed) > 0 { FLOOR } else { WHITE }
    }
}
