//! One view of the picture of what changed: where places are in it, its grid and scale, outlines of
//! bodies, and names that do not cover each other.

use crate::canvas::{Canvas, INK, Rgb};
use crate::font::TextSize::Body;

/// Distances of grid lines and lengths of scale bars, metres.
const STEPS: [f64; 9] = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0];
/// Pixels that two grid lines are apart at least.
const GRID_PIXELS: f64 = 90.0;
/// Colour of coordinates, and how dark grid lines make what they lie on.
const GREY: Rgb = [90, 96, 104];
const LINE_SHARE: f64 = 0.25;
/// Edge of the cells in which outlines are found, metres: points of a model's surface are nearer
/// to each other than two of them.
const CELL: f64 = 0.02;
/// Length of a dash and of the gap behind it, pixels.
const DASH: i64 = 5;
/// Distances of a name from its place, pixels, in the order in which they are tried.
const SHIFTS: [i64; 9] = [-4, -24, 16, -44, 36, -64, 56, -84, 76];

/// A view along one of the world's axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ChangeView {
    /// World axes to the right and up.
    pub(crate) axes: [usize; 2],
    /// Upper left corner in the picture, pixels.
    pub(crate) corner: [i64; 2],
    /// Width and height, pixels.
    pub(crate) size: [i64; 2],
    /// Pixels per metre.
    pub(crate) scale: f64,
}

impl ChangeView {
    /// The pixel of a place; `min` is the corner of the cell, world, metres.
    pub(crate) fn place(&self, min: &[f64; 3], p: &[f64; 3]) -> [i64; 2] {
        let [u, v] = self.axes.map(|axis| ((p[axis] - min[axis]) * self.scale) as i64);
        [self.corner[0] + u, self.corner[1] + self.size[1] - 1 - v]
    }

    /// Fills the part of a rectangle that lies in the view.
    pub(crate) fn fill(&self, canvas: &mut Canvas, at: [i64; 2], size: [i64; 2], colour: Rgb) {
        let [from, to] = self.within(at, size);
        canvas.fill(from[0], from[1], to[0] - from[0], to[1] - from[1], colour);
    }

    /// Mixes a colour into the part of a rectangle that lies in the view.
    fn shade(&self, canvas: &mut Canvas, at: [i64; 2], size: [i64; 2], colour: Rgb, share: f64) {
        let [from, to] = self.within(at, size);
        canvas.shade(from, [0, 1].map(|i| to[i] - from[i]), colour, share);
    }

    fn within(&self, at: [i64; 2], size: [i64; 2]) -> [[i64; 2]; 2] {
        let end = [0, 1].map(|i| self.corner[i] + self.size[i]);
        let from = [0, 1].map(|i| at[i].clamp(self.corner[i], end[i]));
        [from, [0, 1].map(|i| (at[i] + size[i]).clamp(from[i], end[i]))]
    }

    /// Draws a frame, lines at round coordinates, and the coordinates beside them.
    pub(crate) fn grid(&self, canvas: &mut Canvas, min: &[f64; 3]) {
        let ([left, top], [width, height]) = (self.corner, self.size);
        for at in [[left, top], [left, top + height - 1]] {
            canvas.shade(at, [width, 1], INK, 2.0 * LINE_SHARE);
        }
        for at in [[left, top], [left + width - 1, top]] {
            canvas.shade(at, [1, height], INK, 2.0 * LINE_SHARE);
        }
        let is_far = |step: &f64| step * self.scale >= GRID_PIXELS;
        let step = STEPS.into_iter().find(is_far).unwrap_or(STEPS[STEPS.len() - 1]);
        for (i, axis) in self.axes.into_iter().enumerate() {
            let first = (min[axis] / step).ceil();
            let n = ((min[axis] + self.size[i] as f64 / self.scale) / step - first).floor() as i64;
            for value in (0..=n).map(|k| (first + k as f64) * step) {
                let at = ((value - min[axis]) * self.scale) as i64;
                // A step of 0.1 leaves 0.30000000000000004, and nought may have a sign.
                let words = format!("{}", (value * 10.0).round() / 10.0 + 0.0);
                if i == 0 {
                    canvas.shade([left + at, top], [1, height], INK, LINE_SHARE);
                    let x = left + at - Canvas::text_width(Body, &words) / 2;
                    canvas.text(x, top + height + 5, Body, GREY, &words);
                } else {
                    let y = top + height - 1 - at;
                    canvas.shade([left, y], [width, 1], INK, LINE_SHARE);
                    canvas.text_to(left - 5, y - 4, Body, GREY, &words);
                }
            }
        }
    }

    /// Draws a scale bar of a round length, at most a quarter of the view.
    pub(crate) fn scale_bar(&self, canvas: &mut Canvas, [x, y]: [i64; 2]) {
        let quarter = self.size[0] as f64 / self.scale / 4.0;
        let metres = STEPS.into_iter().rfind(|m| *m <= quarter).unwrap_or(STEPS[0]);
        let pixels = (metres * self.scale) as i64;
        canvas.fill(x, y, pixels, 3, INK);
        canvas.text(x, y + 8, Body, INK, &format!("{metres} m"));
    }
}

/// Cells that a body fills in a view.
#[derive(Debug)]
pub(crate) struct Outline {
    n: [usize; 2],
    /// Edge of a cell, pixels.
    edge: f64,
    is_full: Vec<bool>,
}

impl Outline {
    /// The cells with points, and gaps of one cell between them.
    pub(crate) fn of(view: &ChangeView, min: &[f64; 3], body: &[[f64; 3]]) -> Self {
        let edge = (CELL * view.scale).max(1.0);
        let n = view.size.map(|side| (side as f64 / edge).ceil() as usize + 1);
        let empty = Self { n, edge, is_full: vec![false; n[0] * n[1]] };
        let (mut points, metres) = (empty, edge / view.scale);
        for p in body {
            let at = view.axes.map(|axis| ((p[axis] - min[axis]) / metres).floor());
            if (0..2).all(|i| at[i] >= 0.0 && at[i] < n[i] as f64) {
                points.is_full[at[1] as usize * n[0] + at[0] as usize] = true;
            }
        }
        // Grown by a cell and shrunk again: holes between points close, and the size stays.
        points.where_near(|is_full| is_full.contains(&true)).where_near(|is| !is.contains(&false))
    }

    /// The cells for which a condition holds of the cell and those beside it.
    fn where_near(&self, holds: impl Fn(&[bool]) -> bool) -> Self {
        let ([w, h], mut near) = (self.n, Vec::with_capacity(9));
        let full = |u: usize, v: usize| self.is_full[v * w + u];
        let mut is_full = vec![false; w * h];
        for (at, cell) in is_full.iter_mut().enumerate() {
            let (u, v) = (at % w, at / w);
            near.clear();
            for v in v.saturating_sub(1)..(v + 2).min(h) {
                near.extend((u.saturating_sub(1)..(u + 2).min(w)).map(|u| full(u, v)));
            }
            *cell = holds(&near);
        }
        Self { is_full, ..*self }
    }

    /// Draws the edge of the cells: solid around a filled body, else dashed.
    pub(crate) fn draw(&self, canvas: &mut Canvas, view: &ChangeView, colour: Rgb, filled: bool) {
        let ([w, h], bottom) = (self.n, view.corner[1] + view.size[1]);
        let across = |u: usize| view.corner[0] + (u as f64 * self.edge) as i64;
        let up = |v: usize| bottom - (v as f64 * self.edge) as i64;
        let full = |u: Option<usize>, v: Option<usize>| match (u, v) {
            (Some(u), Some(v)) if u < w && v < h => self.is_full[v * w + u],
            _ => false,
        };
        for at in (0..w * h).filter(|at| self.is_full[*at]) {
            let (u, v) = (at % w, at / w);
            let ([x, y], [right, low]) = ([across(u), up(v + 1)], [across(u + 1), up(v)]);
            if filled {
                view.shade(canvas, [x, y], [right - x, low - y], colour, 0.3);
            }
            let mut edge = |from: [i64; 2], size: [i64; 2]| {
                for step in 0..size[0].max(size[1]) {
                    let at = if size[0] > size[1] {
                        [from[0] + step, from[1]]
                    } else {
                        [from[0], from[1] + step]
                    };
                    if filled || (at[0] + at[1]).rem_euclid(2 * DASH) < DASH {
                        view.fill(canvas, at, [2, 2], colour);
                    }
                }
            };
            let (own_u, own_v) = (Some(u), Some(v));
            if !full(own_u, Some(v + 1)) {
                edge([x, y], [right - x, 1]);
            }
            if !full(own_u, v.checked_sub(1)) {
                edge([x, low], [right - x, 1]);
            }
            if !full(u.checked_sub(1), own_v) {
                edge([x, y], [1, low - y]);
            }
            if !full(Some(u + 1), own_v) {
                edge([right, y], [1, low - y]);
            }
        }
    }
}

/// Names in a view, none of which covers another one.
pub(crate) struct Labels {
    view: ChangeView,
    /// Left, top, right and bottom of the names so far, pixels.
    taken: Vec<[i64; 4]>,
}

impl Labels {
    pub(crate) fn new(view: &ChangeView) -> Self {
        Self { view: *view, taken: Vec::new() }
    }

    /// Writes a name beside a place, as near as there is room; a line leads to a name that is far.
    /// A place outside of the view has no name in it.
    pub(crate) fn write(&mut self, canvas: &mut Canvas, at: [i64; 2], colour: Rgb, name: &str) {
        let ([left, top], [width, height]) = (self.view.corner, self.view.size);
        let is_in = (left..left + width).contains(&at[0]) && (top..top + height).contains(&at[1]);
        if !is_in {
            return;
        }
        let wide = Canvas::text_width(Body, name);
        // On the left where the right edge of the view is near.
        let x = if at[0] + 9 + wide < left + width { at[0] + 9 } else { at[0] - 9 - wide };
        let box_at = |shift: i64| [x - 2, at[1] + shift - 2, x + wide + 2, at[1] + shift + 14];
        let is_free = |own: &[i64; 4]| {
            let apart = |other: &[i64; 4]| {
                own[2] <= other[0] || other[2] <= own[0] || own[3] <= other[1] || other[3] <= own[1]
            };
            own[1] >= top && own[3] <= top + height && self.taken.iter().all(apart)
        };
        let shift = SHIFTS.into_iter().find(|shift| is_free(&box_at(*shift))).unwrap_or(SHIFTS[0]);
        let middle = at[1] + shift + 5;
        let (from, to) = (middle.min(at[1]), middle.max(at[1]));
        if to - from > 12 {
            self.view.fill(canvas, [at[0], from], [1, to - from], colour);
        }
        canvas.text(x, at[1] + shift, Body, colour, name);
        self.taken.push(box_at(shift));
    }
}
