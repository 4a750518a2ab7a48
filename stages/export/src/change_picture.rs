//! Draws a cell that was scanned again, from above and from the south: what stands there unchanged,
//! what is missing or new, and robots as they stood and as they stand.

use crate::canvas::{Canvas, INK, Rgb, WHITE, blend};
use crate::change_view::{ChangeView, Labels, Outline};
use crate::font::TextSize::{Body, Title};
use geometry::Aabb;

/// Longer side of the view from above, pixels.
const SIDE: f64 = 900.0;
/// Least scale: of a cell as large as a hall, a pixel is 5 cm.
const MIN_SCALE: f64 = 20.0;
/// Longest side of a view, pixels.
const MAX_SIDE: i64 = 6000;
/// Margin around the views, pixels: coordinates stand in it.
const MARGIN: i64 = 48;
/// Height of a view's title with the space above it, pixels.
const HEAD: i64 = 40;
/// Height above the bottom of the cell up to which things are drawn, metres; a ceiling would hide
/// everything.
const SHOWN: f64 = 3.0;
/// Edge of the voxels whose centres are drawn, metres.
const VOXEL: f64 = 0.05;
/// Width of the legend, pixels.
const LEGEND: i64 = 640;
/// Colours of unchanged places, of places that were not seen again, of missing objects and of new
/// objects, and of a robot as it stood and as it stands.
const STANDS: Rgb = [196, 200, 205];
const UNSEEN: Rgb = [240, 228, 66];
const GONE: Rgb = [230, 140, 60];
const FILLED: Rgb = [70, 190, 150];
const THEN: Rgb = [190, 70, 0];
const NOW: Rgb = [0, 114, 178];

/// A thing that changed between two sessions.
#[derive(Debug, Clone, PartialEq)]
pub struct ChangedThing {
    /// Its name and how it changed.
    pub name: String,
    /// Places that are empty now, world, metres.
    pub gone: Vec<[f64; 3]>,
    /// Places that are filled now, world, metres.
    pub filled: Vec<[f64; 3]>,
    /// Position of its name in the picture, world, metres.
    pub at: [f64; 3],
}

/// A robot of the cell; places are in the world frame, metres.
#[derive(Debug, Clone, PartialEq)]
pub struct ComparedRobot {
    /// Its name and how it changed.
    pub name: String,
    /// Its base.
    pub at: [f64; 3],
    /// Points of its surface as it stood; none where that is how it stands, or it was not there.
    pub then: Vec<[f64; 3]>,
    /// Points of its surface as it stands; none where it is gone.
    pub now: Vec<[f64; 3]>,
}

/// What is known of a cell after a rescan; places are in the world frame, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ComparedCell<'a> {
    /// Bounds of the cell.
    pub bounds: &'a Aabb,
    /// Places where something stands as before.
    pub stands: &'a [[f64; 3]],
    /// Places where something stood and that were not seen again.
    pub unseen: &'a [[f64; 3]],
    /// Things that changed.
    pub things: &'a [ChangedThing],
    /// Robots that were looked at.
    pub robots: &'a [ComparedRobot],
}

/// Draws a cell.
#[must_use]
pub fn draw_changes(cell: &ComparedCell<'_>) -> Canvas {
    let size = cell.bounds.size().map(|s| if s.is_finite() { s.max(0.1) } else { 0.1 });
    let scale = (SIDE / size[0].max(size[1])).max(MIN_SCALE);
    let [width, depth, height] =
        [size[0], size[1], size[2].min(SHOWN)].map(|s| ((s * scale) as i64 + 1).min(MAX_SIDE));
    let top = MARGIN + HEAD;
    let side = top + depth + MARGIN + HEAD;
    let legend = side + height + MARGIN;
    let mut canvas = Canvas::new(
        (width.max(LEGEND) + 2 * MARGIN) as usize,
        (legend + MARGIN + HEAD + 24) as usize,
    );
    canvas.text(MARGIN, MARGIN / 2, Title, INK, "What changed");
    // North is up; below the view from above is the view from the south.
    let views = [
        (
            "from above, metres",
            ChangeView { axes: [0, 1], corner: [MARGIN, top], size: [width, depth], scale },
        ),
        (
            "from the south (along y), metres",
            ChangeView { axes: [0, 2], corner: [MARGIN, side], size: [width, height], scale },
        ),
    ];
    for (title, view) in &views {
        let [x, y] = view.corner;
        canvas.text(x, y - 22, Body, INK, title);
        draw_view(&mut canvas, cell, view);
    }
    views[0].1.scale_bar(&mut canvas, [MARGIN, legend]);
    draw_legend(&mut canvas, [MARGIN, legend + 30]);
    canvas
}

/// Draws the places, the robots and their names in one view.
fn draw_view(canvas: &mut Canvas, cell: &ComparedCell<'_>, view: &ChangeView) {
    let is_low = |p: &&[f64; 3]| p[2] < cell.bounds.min[2] + SHOWN;
    let dot = (VOXEL * view.scale).ceil().max(1.0) as i64;
    let min = cell.bounds.min;
    let mut voxels = |places: &[[f64; 3]], colour: Rgb| {
        for place in places.iter().filter(is_low) {
            let [x, y] = view.place(&min, place);
            view.fill(canvas, [x - dot / 2, y - dot / 2], [dot; 2], colour);
        }
    };
    voxels(cell.stands, blend(STANDS, WHITE, 0.2));
    voxels(cell.unseen, UNSEEN);
    for thing in cell.things {
        voxels(&thing.gone, GONE);
        voxels(&thing.filled, FILLED);
    }
    view.grid(canvas, &min);
    for robot in cell.robots {
        Outline::of(view, &min, &robot.now).draw(canvas, view, NOW, true);
        Outline::of(view, &min, &robot.then).draw(canvas, view, THEN, false);
    }
    let mut labels = Labels::new(view);
    for robot in cell.robots {
        let [x, y] = view.place(&min, &robot.at);
        canvas.disc(x, y, 5, WHITE);
        canvas.disc(x, y, 4, NOW);
        labels.write(canvas, [x, y], NOW, &robot.name);
    }
    for thing in cell.things {
        labels.write(canvas, view.place(&min, &thing.at), INK, &thing.name);
    }
}

/// Says what the colours mean.
fn draw_legend(canvas: &mut Canvas, [left, y]: [i64; 2]) {
    let places =
        [("unchanged", STANDS), ("not seen again", UNSEEN), ("missing now", GONE), ("new", FILLED)];
    let mut x = left;
    for (name, colour) in places {
        canvas.fill(x, y, 10, 10, colour);
        canvas.text(x + 14, y + 1, Body, INK, name);
        x += 14 + Canvas::text_width(Body, name) + 18;
    }
    let mut x = left;
    let robots =
        [("robot as it stands (filled)", NOW, true), ("as it stood (dashed)", THEN, false)];
    for (name, colour, is_filled) in robots {
        if is_filled {
            canvas.shade([x, y + 20], [16, 10], colour, 0.3);
        }
        for dash in 0..4 {
            let length = if is_filled { 4 } else { 2 };
            canvas.fill(x + 4 * dash, y + 20, length, 2, colour);
            canvas.fill(x + 4 * dash, y + 28, length, 2, colour);
        }
        canvas.text(x + 22, y + 21, Body, INK, name);
        x += 22 + Canvas::text_width(Body, name) + 18;
    }
}
