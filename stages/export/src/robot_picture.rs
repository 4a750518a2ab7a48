//! Draws one robot from four sides: the labelled points by link, with the outline of the fitted
//! posture over them. An outline beside its points shows a wrong posture at a glance.

use crate::canvas::{Canvas, INK, Rgb, WHITE, blend, link_color};
use crate::font::{self, TextSize};
use contract::{Fan, Label, PointKind};
use geometry::depth::{Rows, rows, transform};
use geometry::{Aabb, Point, Pose, Vector};
use robot::Model;

/// Edge of one view, pixels.
const SIDE: usize = 560;
/// Height of a row of the legend, pixels.
const LEGEND: usize = 16;
/// Margin around the robot, metres.
const AROUND: f64 = 0.25;
/// Step in depth that is drawn as outline, metres.
const STEP: f32 = 0.04;
/// Angle of the surface that is drawn as edge: cosine of 40°.
const TURN: f32 = 0.766;

/// Collects the points of one robot; its memory is bounded by the size of the views.
pub struct RobotPicture {
    robot: i16,
    bounds: Aabb,
    links: Vec<String>,
    pub(crate) views: Vec<PictureView>,
}

pub(crate) struct PictureView {
    name: &'static str,
    /// Rows of the transform to pixels to the right, pixels down, and metres away from the viewer.
    view_from_world: Rows,
    /// Subtracted from points, so that `f32` is precise enough.
    origin: Point,
    pub(crate) points: Vec<(f32, Rgb)>,
    pub(crate) outline: Vec<bool>,
    /// For each pixel the depth of the posture's surface and the cosine of its angle to the
    /// viewer, and the distance of the nearest point from it.
    pub(crate) surface: Vec<[f32; 2]>,
    pub(crate) residuals: Vec<(f32, f32)>,
}

/// The part of the posture that is visible in a pixel.
#[derive(Clone, Copy)]
struct Shown {
    depth: f32,
    link: u16,
    normal: [f32; 3],
}

const NOTHING: Shown = Shown { depth: f32::INFINITY, link: u16::MAX, normal: [0.0; 3] };

impl RobotPicture {
    /// The views of the robot with this index in the labels and with links at `world_from_link`.
    #[must_use]
    pub fn new(robot: i16, model: &Model, world_from_link: &[Pose], fan: &dyn Fan) -> Self {
        let blank = Self::blank(robot, model, world_from_link);
        let views = fan.fan(blank.views, |mut view: PictureView| {
            view.outline(model, world_from_link);
            view
        });
        Self { views, ..blank }
    }

    /// The same without the surface of the posture.
    pub(crate) fn blank(robot: i16, model: &Model, world_from_link: &[Pose]) -> Self {
        let mut bounds = Aabb::EMPTY;
        for (link, pose) in model.links.iter().zip(world_from_link) {
            for corner in link.bounds.corners() {
                let p = pose * Point::from(corner);
                if !link.bounds.is_empty() {
                    bounds.add([p.x, p.y, p.z]);
                }
            }
        }
        let shown = if bounds.is_empty() { Aabb { min: [0.0; 3], max: [1.0; 3] } } else { bounds };
        let views = [
            ("front", 0.0, 0.0),
            ("side", 90.0, 0.0),
            ("top", -90.0, 90.0),
            ("oblique", 40.0, 30.0),
        ];
        let views = views.into_iter();
        let views = views.map(|(name, turn, tilt)| PictureView::new(name, turn, tilt, &shown));
        let links = model.links.iter().map(|link| link.name.clone()).collect();
        Self { robot, bounds: shown.grown(AROUND), links, views: views.collect() }
    }

    /// Bounds of what the views show, world, metres.
    #[must_use]
    pub fn bounds(&self) -> &Aabb {
        &self.bounds
    }

    /// Adds a labelled point (world, metres); points away from the robot are ignored.
    #[inline]
    pub fn add(&mut self, world: [f64; 3], label: Label) {
        if !self.bounds.contains(world) {
            return;
        }
        let (color, is_ours) = self.color(label);
        for view in &mut self.views {
            view.splat(world, color, is_ours);
            if is_ours {
                view.measure(world);
            }
        }
    }

    /// Draws the four views with a legend; `title` names model and verdict.
    #[must_use]
    pub fn draw(&self, title: &str) -> Canvas {
        let n_rows = self.links.len().div_ceil(4);
        let mut canvas = Canvas::new(2 * SIDE + 6, 2 * SIDE + 46 + LEGEND * n_rows);
        canvas.text(8, 10, TextSize::Title, INK, title);
        for (i, view) in self.views.iter().enumerate() {
            let (x, y) = ((i % 2 * (SIDE + 6)) as i64, (36 + i / 2 * (SIDE + 4)) as i64);
            canvas.paste(x, y, &view.draw());
        }
        for (i, name) in self.links.iter().enumerate() {
            let (x, y) =
                ((8 + i % 4 * (SIDE / 2)) as i64, (2 * SIDE + 46 + LEGEND * (i / 4)) as i64);
            canvas.fill(x, y - 1, 10, 10, link_color(i));
            let short = font::shortened(TextSize::Body, name, (SIDE / 2 - 24) as f32);
            canvas.text(x + 14, y, TextSize::Body, INK, &short);
        }
        canvas
    }

    /// Draws the views from the front and the side by distance of the links' points from the
    /// posture's surface.
    pub(crate) fn residuals(&self) -> [Canvas; 2] {
        [self.views[0].draw_residuals(), self.views[1].draw_residuals()]
    }

    fn color(&self, label: Label) -> (Rgb, bool) {
        let link = usize::try_from(label.link).unwrap_or(0);
        match label.kind {
            PointKind::Link if label.robot == self.robot => (link_color(link), true),
            PointKind::Attachment if label.robot == self.robot => {
                (blend(link_color(link), INK, 0.45), true)
            }
            PointKind::Link | PointKind::Attachment => ([214, 204, 224], false),
            PointKind::Uncertain => ([244, 214, 130], false),
            PointKind::Fixed => ([205, 208, 212], false),
            PointKind::Floor => ([232, 234, 230], false),
        }
    }
}

impl PictureView {
    /// A view from the front (+x), turned by `turn` degrees about z and tilted by `tilt` degrees
    /// from above.
    fn new(name: &'static str, turn: f64, tilt: f64, bounds: &Aabb) -> Self {
        let (st, ct) = turn.to_radians().sin_cos();
        let (sp, cp) = tilt.to_radians().sin_cos();
        let away = -Vector::new(ct * cp, st * cp, sp);
        let right = Vector::new(-st, ct, 0.0);
        let down = away.cross(&right);
        let axes =
            nalgebra::Matrix3::from_rows(&[right.transpose(), down.transpose(), away.transpose()]);
        let half = bounds.corners().into_iter().map(|c| axes * (Point::from(c) - bounds.center()));
        let half = half.map(|v| v.x.abs().max(v.y.abs())).fold(0.1, f64::max) + 0.6 * AROUND;
        let scale = SIDE as f64 / (2.0 * half);
        let rotation = nalgebra::UnitQuaternion::from_matrix(&axes);
        let mut view_from_world = rows(&Pose::from_parts(Default::default(), rotation));
        for row in view_from_world.iter_mut().take(2) {
            row.iter_mut().for_each(|v| *v *= scale as f32);
            row[3] = 0.5 * SIDE as f32;
        }
        Self {
            name,
            view_from_world,
            origin: bounds.center(),
            points: vec![(f32::INFINITY, WHITE); SIDE * SIDE],
            outline: vec![false; SIDE * SIDE],
            surface: vec![[f32::NAN, 0.0]; SIDE * SIDE],
            residuals: vec![(f32::INFINITY, 0.0); SIDE * SIDE],
        }
    }

    /// The pixel of a point (world, metres) and its depth.
    fn pixel(&self, world: [f64; 3]) -> Option<(usize, usize, f32)> {
        let local = [0, 1, 2].map(|i| (world[i] - self.origin[i]) as f32);
        let [u, v, depth] = transform(&self.view_from_world, local);
        let inside = u >= 0.0 && v >= 0.0 && u < SIDE as f32 && v < SIDE as f32;
        inside.then_some((u as usize, v as usize, depth))
    }

    /// Stores the distance of a point of the robot from the surface that is visible in its pixel,
    /// if the point is the nearest to the viewer; measured across the surface.
    fn measure(&mut self, world: [f64; 3]) {
        let Some((u, v, depth)) = self.pixel(world) else { return };
        let [surface, facing] = self.surface[v * SIDE + u];
        let off = (surface - depth) * facing;
        let pixel = &mut self.residuals[v * SIDE + u];
        // Points of surfaces behind the visible one do not count.
        if off.abs() < HIDDEN && (depth, off) < *pixel {
            *pixel = (depth, off);
        }
    }

    fn splat(&mut self, world: [f64; 3], color: Rgb, is_ours: bool) {
        let Some((u, v, mut depth)) = self.pixel(world) else { return };
        // Fixed things in front of the robot must not hide it.
        depth += if is_ours { 0.0 } else { 1e3 };
        // Points are two pixels wide, so that the gaps of a scan do not look like background.
        for (x, y) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let (x, y) = ((u + x).min(SIDE - 1), (v + y).min(SIDE - 1));
            let pixel = &mut self.points[y * SIDE + x];
            // At equal depth the smaller colour wins, so that the order of points has no effect.
            if (depth, color) < (pixel.0, pixel.1) {
                *pixel = (depth, color);
            }
        }
    }

    /// Draws the posture into a depth buffer and extracts its edges.
    fn outline(&mut self, model: &Model, world_from_link: &[Pose]) {
        let mut shown = vec![NOTHING; SIDE * SIDE];
        let local_from_world = Pose::from_parts((-self.origin.coords).into(), Default::default());
        for (index, (link, pose)) in model.links.iter().zip(world_from_link).enumerate() {
            let local_from_link = rows(&(local_from_world * pose));
            let placed = |p: &[f32; 3]| {
                let local = transform(&local_from_link, *p);
                (local, transform(&self.view_from_world, local))
            };
            let corners: Vec<_> = link.mesh.vertices.iter().map(placed).collect();
            for triangle in &link.mesh.triangles {
                let corner = |i: u32| corners.get(i as usize).copied().unwrap_or_default();
                let [(a, p), (b, q), (c, r)] = triangle.map(corner);
                // Most triangles of a vendor's mesh hold the middle of no pixel.
                fill_triangle(&mut shown, [p, q, r], || normal(a, b, c), index as u16);
            }
        }
        let away: Vector = [0, 1, 2].map(|i| f64::from(self.view_from_world[2][i])).into();
        for (own, shown) in self.surface.iter_mut().zip(&shown) {
            if shown.link != u16::MAX {
                let facing = away.dot(&Vector::from(shown.normal.map(f64::from))).abs();
                *own = [shown.depth, facing as f32];
            }
        }
        for v in 1..SIDE {
            for u in 1..SIDE {
                let here = &shown[v * SIDE + u];
                let edge = |other: &Shown| is_edge(here, other);
                self.outline[v * SIDE + u] =
                    edge(&shown[v * SIDE + u - 1]) || edge(&shown[(v - 1) * SIDE + u]);
            }
        }
    }

    fn draw(&self) -> Canvas {
        let mut canvas = Canvas::new(SIDE, SIDE);
        for (i, (depth, color)) in self.points.iter().enumerate() {
            let (x, y) = ((i % SIDE) as i64, (i / SIDE) as i64);
            let mut color = *color;
            if *depth < f32::INFINITY && self.outline[i] {
                color = blend(color, INK, 0.75);
            } else if self.outline[i] {
                color = [90, 94, 102];
            }
            canvas.set(x, y, color);
        }
        canvas.text(8, 8, TextSize::Body, INK, self.name);
        canvas
    }
}

impl PictureView {
    /// Draws points red in front of the surface, blue behind it, and white on it.
    fn draw_residuals(&self) -> Canvas {
        let mut canvas = Canvas::new(SIDE, SIDE);
        for v in 0..SIDE {
            for u in 0..SIDE {
                let (depth, off) = self.residuals[v * SIDE + u];
                let mut color = if self.surface[v * SIDE + u][0].is_nan() { WHITE } else { UNSEEN };
                if depth < f32::INFINITY {
                    color = residual_color(off);
                }
                if self.outline[v * SIDE + u] {
                    color = blend(color, INK, 0.5);
                }
                canvas.set(u as i64, v as i64, color);
            }
        }
        canvas.text(8, 8, TextSize::Body, INK, self.name);
        canvas
    }
}

/// Colour of a distance from the surface, metres; saturated at [`FULL`].
pub(crate) fn residual_color(off: f32) -> Rgb {
    let share = f64::from((off.abs() / FULL).min(1.0));
    blend([246, 244, 214], if off > 0.0 { [196, 30, 40] } else { [20, 70, 190] }, share)
}

/// Distance from the surface at which the colour is saturated, metres.
pub(crate) const FULL: f32 = 0.010;
/// Distance beyond which a point belongs to another surface, metres.
const HIDDEN: f32 = 0.04;
/// Colour of surface without points.
const UNSEEN: Rgb = [206, 208, 214];

fn is_edge(a: &Shown, b: &Shown) -> bool {
    if a.link != b.link {
        return true;
    }
    let turned = a.normal[0] * b.normal[0] + a.normal[1] * b.normal[1] + a.normal[2] * b.normal[2];
    a.link != u16::MAX && ((a.depth - b.depth).abs() > STEP || turned.abs() < TURN)
}

fn normal(a: [f32; 3], b: [f32; 3], c: [f32; 3]) -> [f32; 3] {
    let (u, v) = (
        Vector::from([0, 1, 2].map(|i| f64::from(b[i] - a[i]))),
        [0, 1, 2].map(|i| f64::from(c[i] - a[i])),
    );
    let n = u.cross(&Vector::from(v));
    let n = n.try_normalize(1e-15).unwrap_or_else(Vector::zeros);
    [n.x as f32, n.y as f32, n.z as f32]
}

/// Fills the pixels whose centre lies inside a triangle (pixels right, pixels down, depth) where it
/// is nearest.
fn fill_triangle(
    shown: &mut [Shown],
    [a, b, c]: [[f32; 3]; 3],
    normal: impl Fn() -> [f32; 3],
    link: u16,
) {
    let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if area == 0.0 || !area.is_finite() {
        return;
    }
    let range = |i: usize| {
        // From the first to the last pixel whose centre is not beside the triangle.
        let low = (a[i].min(b[i]).min(c[i]) - 0.5).ceil().clamp(0.0, SIDE as f32) as usize;
        let high = (a[i].max(b[i]).max(c[i]) + 0.5).floor().clamp(0.0, SIDE as f32) as usize;
        low..high
    };
    for v in range(1) {
        for u in range(0) {
            let p = [u as f32 + 0.5, v as f32 + 0.5];
            let side = |m: [f32; 3], n: [f32; 3]| {
                (n[0] - m[0]) * (p[1] - m[1]) - (n[1] - m[1]) * (p[0] - m[0])
            };
            let (x, y, z) = (side(b, c) / area, side(c, a) / area, side(a, b) / area);
            if x < 0.0 || y < 0.0 || z < 0.0 {
                continue;
            }
            let depth = x * a[2] + y * b[2] + z * c[2];
            let pixel = &mut shown[v * SIDE + u];
            if depth < pixel.depth {
                *pixel = Shown { depth, link, normal: normal() };
            }
        }
    }
}
