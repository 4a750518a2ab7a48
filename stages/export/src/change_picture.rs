//! Draws a cell that was scanned again, from above and from the side: unchanged, missing and new
//! objects.

use crate::canvas::{Canvas, INK, Rgb, blend};
use crate::font::TextSize::Body;
use geometry::Aabb;

/// Longer side of the view from above, pixels.
const SIDE: f64 = 900.0;
/// Margin around the views, pixels.
const MARGIN: i64 = 30;
/// Height above the bottom of the cell up to which things are drawn, metres; a ceiling would hide
/// everything.
const SHOWN: f64 = 3.0;
/// Colours of unchanged places, of places that were not seen again, of missing objects and of new
/// objects.
const STANDS: Rgb = [150, 156, 164];
const UNSEEN: Rgb = [240, 228, 66];
const GONE: Rgb = [213, 94, 0];
const FILLED: Rgb = [0, 158, 115];

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

/// Draws a cell: occupied places, places that were occupied and not seen again, things that
/// changed, and robots with the positions of their bases. All coordinates are in the world frame,
/// metres.
#[must_use]
pub fn draw_changes(
    cell: &Aabb,
    [stands, unseen]: [&[[f64; 3]]; 2],
    things: &[ChangedThing],
    robots: &[(String, [f64; 2])],
) -> Canvas {
    let size = cell.size().map(|s| if s.is_finite() { s.max(0.1) } else { 0.1 });
    let scale = SIDE / size[0].max(size[1]);
    let pixels = size.map(|s| (s * scale) as i64 + 1);
    let (width, top) = (pixels[0].max(520) + 2 * MARGIN, pixels[1] + 2 * MARGIN);
    let mut canvas = Canvas::new(width as usize, (top + pixels[2] + MARGIN) as usize);
    // North is up; below the view from above is the view from the south.
    let place = |p: &[f64; 3]| {
        let [x, y, z] = [0, 1, 2].map(|i| ((p[i] - cell.min[i]) * scale) as i64);
        [(MARGIN + x, MARGIN + pixels[1] - y), (MARGIN + x, top + pixels[2] - z)]
    };
    let dot = (0.05 * scale).ceil().max(1.0) as i64;
    let mut draw = |points: &[[f64; 3]], color: Rgb| {
        for (x, y) in points.iter().flat_map(place) {
            canvas.fill(x - dot / 2, y - dot / 2, dot, dot, color);
        }
    };
    for (places, color) in [(stands, blend(STANDS, [255; 3], 0.4)), (unseen, UNSEEN)] {
        let low: Vec<_> = places.iter().filter(|p| p[2] < cell.min[2] + SHOWN).copied().collect();
        draw(&low, color);
    }
    for thing in things {
        draw(&thing.gone, GONE);
        draw(&thing.filled, FILLED);
    }
    for thing in things {
        let [(x, y), _] = place(&thing.at);
        canvas.text(x + 6, y - 4, Body, INK, &thing.name);
    }
    for (name, at) in robots {
        let [(x, y), _] = place(&[at[0], at[1], cell.min[2]]);
        canvas.disc(x, y, 5, [0, 114, 178]);
        canvas.text(x + 8, y - 4, Body, [0, 60, 110], name);
    }
    canvas.text(
        MARGIN,
        8,
        Body,
        INK,
        "grey: unchanged   yellow: not seen again   orange: missing now   green: new",
    );
    canvas
}
