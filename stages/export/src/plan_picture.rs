//! The plan of an input: labelled points in, a picture of the plant from above out.

use crate::canvas::{Canvas, INK, Rgb, WHITE, blend, robot_color};
use contract::{Label, PointKind};
use geometry::Aabb;
use geometry::narrow::floor_i32;

/// Finest cell, metres.
const MIN_CELL: f64 = 0.05;
/// Most cells along a side; a larger plant gets larger cells.
const MAX_SIDE: f64 = 2400.0;
/// Fewest pixels along the longer side of the picture; small cells are drawn larger.
const MIN_PIXELS: usize = 900;
/// Room about the plan, pixels.
const MARGIN: i64 = 24;

/// Counts of points by cell of the ground; small, so that each worker may have its own.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanPicture {
    min: [f64; 2],
    cell: f64,
    width: usize,
    height: usize,
    cells: Vec<Cell>,
}

#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Cell {
    n_floor: u32,
    n_fixed: u32,
    n_uncertain: u32,
    n_moving: u32,
    /// Lowest robot number + 1 seen here, 0 for none.
    robot: u16,
}

impl PlanPicture {
    /// A plan of these bounds of the world; points outside are passed over.
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
            width,
            height,
            cells: vec![Cell::default(); width * height],
        }
    }

    /// Adds a labelled point of the world.
    #[inline]
    pub fn add(&mut self, world: [f64; 3], label: Label) {
        let Some(at) = self.at([world[0], world[1]]) else {
            return;
        };
        let cell = &mut self.cells[at];
        let count = match label.kind {
            PointKind::Floor => &mut cell.n_floor,
            PointKind::Fixed => &mut cell.n_fixed,
            PointKind::Uncertain => &mut cell.n_uncertain,
            PointKind::Link | PointKind::Attachment => {
                let robot = u16::try_from(i32::from(label.robot) + 1).unwrap_or(0);
                cell.robot = if cell.robot == 0 { robot } else { cell.robot.min(robot) };
                &mut cell.n_moving
            }
        };
        *count = count.saturating_add(1);
    }

    /// Adds the counts of another worker.
    pub fn join(&mut self, other: &Self) {
        for (a, b) in self.cells.iter_mut().zip(&other.cells) {
            a.n_floor = a.n_floor.saturating_add(b.n_floor);
            a.n_fixed = a.n_fixed.saturating_add(b.n_fixed);
            a.n_uncertain = a.n_uncertain.saturating_add(b.n_uncertain);
            a.n_moving = a.n_moving.saturating_add(b.n_moving);
            a.robot = if a.robot == 0 || b.robot == 0 {
                a.robot.max(b.robot)
            } else {
                a.robot.min(b.robot)
            };
        }
    }

    /// Draws the plan: robots with their names and places of their bases, scanners with theirs, world, metres.
    #[must_use]
    pub fn draw(
        &self,
        title: &str,
        robots: &[(String, [f64; 2])],
        scanners: &[(String, [f64; 2])],
    ) -> Canvas {
        let zoom = (MIN_PIXELS / self.width.max(self.height)).clamp(1, 8) as i64;
        let (w, h) = (self.width as i64 * zoom, self.height as i64 * zoom);
        let mut canvas =
            Canvas::new((w.max(420) + 2 * MARGIN) as usize, (h + 3 * MARGIN + 40) as usize);
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
        for (name, at) in scanners {
            let (x, y) = place(at);
            canvas.disc(x, y, 5, WHITE);
            canvas.disc(x, y, 4, [200, 0, 60]);
            canvas.text(x + 8, y - 4, 1, [160, 0, 50], name);
        }
        for (i, (name, at)) in robots.iter().enumerate() {
            let (x, y) = place(at);
            canvas.disc(x, y, 5, WHITE);
            canvas.disc(x, y, 4, robot_color(i));
            canvas.text(x + 8, y - 8, 2, robot_color(i), name);
        }
        canvas.text(MARGIN, MARGIN / 2, 2, INK, title);
        self.scale_bar(&mut canvas, zoom, 2 * MARGIN + h + 16);
        canvas
    }

    /// A bar of a round length, about a quarter of the plan.
    fn scale_bar(&self, canvas: &mut Canvas, zoom: i64, y: i64) {
        let quarter = self.width as f64 * self.cell / 4.0;
        let metres = [0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0]
            .into_iter()
            .rfind(|m| *m <= quarter)
            .unwrap_or(0.5);
        let pixels = (metres / self.cell * zoom as f64) as i64;
        canvas.fill(MARGIN, y, pixels, 3, INK);
        canvas.text(MARGIN, y + 8, 1, INK, &format!("{metres} m"));
        let legend = [
            ("floor", FLOOR),
            ("fixed", FIXED),
            ("uncertain", UNCERTAIN),
            ("scanner", [200, 0, 60]),
        ];
        let mut x = MARGIN + pixels.max(48) + 24;
        for (name, color) in legend {
            canvas.fill(x, y + 7, 10, 10, color);
            canvas.text(x + 14, y + 8, 1, INK, name);
            x += 14 + 8 * name.len() as i64 + 12;
        }
    }

    /// Points in a well filled cell: the 98th percentile of those that hold any standing point.
    fn full(&self) -> f64 {
        let mut counts: Vec<u32> =
            self.cells.iter().map(|c| c.n_fixed + c.n_uncertain).filter(|n| *n > 0).collect();
        if counts.is_empty() {
            return 1.0;
        }
        let at = (counts.len() - 1) * 98 / 100;
        f64::from(*counts.select_nth_unstable(at).1).max(1.0)
    }

    fn at(&self, p: [f64; 2]) -> Option<usize> {
        let u = usize::try_from(floor_i32((p[0] - self.min[0]) / self.cell)).ok()?;
        let v = usize::try_from(floor_i32((p[1] - self.min[1]) / self.cell)).ok()?;
        (u < self.width && v < self.height).then_some(v * self.width + u)
    }
}

const FLOOR: Rgb = [232, 234, 230];
const FIXED: Rgb = [120, 126, 134];
const UNCERTAIN: Rgb = [236, 190, 60];

impl Cell {
    fn color(&self, full: f64) -> Rgb {
        let standing = f64::from(self.n_fixed) + f64::from(self.n_uncertain);
        if self.n_moving > 0 && self.robot > 0 {
            return robot_color(usize::from(self.robot) - 1);
        }
        if self.n_uncertain > self.n_fixed {
            return UNCERTAIN;
        }
        if standing > 0.0 {
            // The logarithm shows a cable beside a wall.
            let share = (1.0 + standing).ln() / (1.0 + full).ln();
            return blend(FLOOR, [60, 64, 70], 0.25 + 0.75 * share);
        }
        if self.n_floor > 0 { FLOOR } else { WHITE }
    }
}
