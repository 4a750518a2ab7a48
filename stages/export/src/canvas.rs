//! A picture in memory, drawn with pixels, discs and text, and written as PNG.

use crate::atomic;
use crate::font::{self, TextSize};
use contract::{Error, Kind, Result};
use std::path::Path;
use tiny_skia::{FillRule, Paint, PathBuilder, Pixmap, PremultipliedColorU8, Transform};

/// A colour: red, green and blue, 0..255.
pub type Rgb = [u8; 3];

/// Colour of the background.
pub(crate) const WHITE: Rgb = [255, 255, 255];
/// Colour of text and lines.
pub(crate) const INK: Rgb = [30, 34, 40];
/// Eight colours that can be told apart with any colour vision (after Okabe and Ito), without
/// black.
const COLORS: [Rgb; 8] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [86, 180, 233],
    [230, 159, 0],
    [148, 82, 178],
    [150, 140, 20],
];

/// Colour of a robot in a plan.
#[must_use]
pub fn robot_color(robot: usize) -> Rgb {
    COLORS[robot % COLORS.len()]
}

/// Colour of a link in a view of its robot: darker from the ninth link on, and lighter from the
/// seventeenth, so that no two of a robot's links have the same.
#[must_use]
pub fn link_color(link: usize) -> Rgb {
    let colour = COLORS[link % COLORS.len()];
    match link / COLORS.len() % 3 {
        0 => colour,
        1 => blend(colour, INK, 0.5),
        _ => blend(colour, WHITE, 0.5),
    }
}

/// Limit of the pixels along a side: ten times the size of the pictures of this program.
const MAX_SIDE: usize = 30_000;

/// A picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Canvas {
    /// The pixels, all of them opaque.
    pixels: Pixmap,
}

impl Canvas {
    /// A white picture, size in pixels.
    #[must_use]
    pub fn new(width: usize, height: usize) -> Self {
        let [width, height] = [width, height].map(|n| n.clamp(1, MAX_SIDE) as u32);
        let mut pixels = Pixmap::new(width, height).expect("both sides are in bounds");
        pixels.fill(tiny_skia::Color::WHITE);
        Self { pixels }
    }

    /// Width, pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        self.pixels.width() as usize
    }

    /// Height, pixels.
    #[must_use]
    pub fn height(&self) -> usize {
        self.pixels.height() as usize
    }

    /// Colours a pixel; pixels outside the picture are ignored.
    pub fn set(&mut self, x: i64, y: i64, color: Rgb) {
        if let Some(pixel) = self.pixel(x, y) {
            *pixel = opaque(color);
        }
    }

    /// A pixel; `None` outside the paper.
    fn pixel(&mut self, x: i64, y: i64) -> Option<&mut PremultipliedColorU8> {
        let (width, height) = (self.width(), self.height());
        let inside = x >= 0 && y >= 0 && (x as usize) < width && (y as usize) < height;
        inside.then(|| &mut self.pixels.pixels_mut()[y as usize * width + x as usize])
    }

    /// Fills a rectangle.
    pub fn fill(&mut self, x: i64, y: i64, width: i64, height: i64, color: Rgb) {
        let across = x.max(0)..(x + width).min(self.width() as i64);
        if across.is_empty() {
            return;
        }
        let (n, color) = (self.width(), opaque(color));
        for v in y.max(0)..(y + height).min(self.height() as i64) {
            let row = v as usize * n;
            let row = row + across.start as usize..row + across.end as usize;
            self.pixels.pixels_mut()[row].fill(color);
        }
    }

    /// Fills a disc around the centre of a pixel; `radius` in pixels.
    pub fn disc(&mut self, x: i64, y: i64, radius: i64, color: Rgb) {
        let middle = [x, y].map(|v| v as f32 + 0.5);
        let Some(circle) = PathBuilder::from_circle(middle[0], middle[1], radius as f32 + 0.5)
        else {
            return;
        };
        let mut paint = Paint::default();
        paint.set_color_rgba8(color[0], color[1], color[2], 255);
        self.pixels.fill_path(&circle, &paint, FillRule::Winding, Transform::identity(), None);
    }

    /// Mixes a colour into a rectangle; corner and size in pixels.
    pub(crate) fn shade(&mut self, [x, y]: [i64; 2], size: [i64; 2], color: Rgb, share: f64) {
        for (u, v) in (0..size[0] * size[1]).map(|i| (x + i % size[0], y + i / size[0])) {
            if let Some(pixel) = self.pixel(u, v) {
                *pixel = opaque(blend([pixel.red(), pixel.green(), pixel.blue()], color, share));
            }
        }
    }

    /// Draws a circle, as far as it is within bounds (left, top, right, bottom); pixels.
    pub(crate) fn ring(&mut self, [x, y]: [i64; 2], radius: f64, color: Rgb, bounds: [i64; 4]) {
        // Steps of half a pixel leave no gap.
        let n = (4.0 * std::f64::consts::PI * radius.clamp(0.0, 1e5)) as i64;
        for i in 0..n {
            let turn = i as f64 / n as f64 * std::f64::consts::TAU;
            let [u, v] = [turn.cos(), turn.sin()].map(|part| (part * radius).round() as i64);
            let (u, v) = (x + u, y + v);
            // Dashes of eight pixels, so that no circle is taken for a wall.
            let is_dash = (i / 16) % 3 != 2;
            let is_in = u >= bounds[0] && v >= bounds[1] && u < bounds[2] && v < bounds[3];
            if is_dash && is_in {
                self.set(u, v, color);
            }
        }
    }

    /// Writes text on a white background. The upper left corner of the first capital letter is at
    /// (`x`, `y`).
    pub fn text(&mut self, x: i64, y: i64, size: TextSize, color: Rgb, words: &str) {
        let (width, capitals) = (Self::text_width(size, words), size.capitals().ceil() as i64);
        let below = capitals / 3;
        self.fill(x - 1, y - 1, width + 2, capitals + below + 2, WHITE);
        for outline in font::outlines(size, words, x as f32, (y + capitals) as f32) {
            let corner = outline.px_bounds().min;
            outline.draw(|u, v, share| {
                let at = [corner.x as i64 + i64::from(u), corner.y as i64 + i64::from(v)];
                if let Some(pixel) = self.pixel(at[0], at[1]) {
                    let ground = [pixel.red(), pixel.green(), pixel.blue()];
                    *pixel = opaque(blend(ground, color, share.into()));
                }
            });
        }
    }

    /// Writes text that ends at `x`, otherwise like [`Self::text`].
    pub(crate) fn text_to(&mut self, x: i64, y: i64, size: TextSize, color: Rgb, words: &str) {
        self.text(x - Self::text_width(size, words), y, size, color, words);
    }

    /// Width of text, pixels.
    #[must_use]
    pub fn text_width(size: TextSize, words: &str) -> i64 {
        font::width(size, words).ceil() as i64
    }

    /// Copies another picture onto this one.
    pub fn paste(&mut self, x: i64, y: i64, other: &Self) {
        let paint = tiny_skia::PixmapPaint::default();
        let at = [x, y].map(|v| v.clamp(-(MAX_SIDE as i64), MAX_SIDE as i64) as i32);
        let from = other.pixels.as_ref();
        self.pixels.draw_pixmap(at[0], at[1], from, &paint, Transform::identity(), None);
    }

    /// The colour of a pixel.
    #[cfg(test)]
    pub(crate) fn at(&self, x: usize, y: usize) -> Rgb {
        let p = self.pixels.pixels()[y * self.width() + x];
        [p.red(), p.green(), p.blue()]
    }

    /// Writes a PNG file.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let failed = |e: png::EncodingError| {
            Error::new(Kind::Bug, "picture cannot be encoded as PNG").because(e).at(path.display())
        };
        let [width, height] = [self.pixels.width(), self.pixels.height()];
        let colors = |p: &PremultipliedColorU8| [p.red(), p.green(), p.blue()];
        let rgb: Vec<Rgb> = self.pixels.pixels().iter().map(colors).collect();
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        // A rescan draws a dozen pictures while tiles need the same threads.
        encoder.set_compression(png::Compression::Fast);
        let mut writer = encoder.write_header().map_err(failed)?;
        writer.write_image_data(rgb.as_flattened()).map_err(failed)?;
        writer.finish().map_err(failed)?;
        atomic::write(path, &bytes)
    }
}

fn opaque([red, green, blue]: Rgb) -> PremultipliedColorU8 {
    PremultipliedColorU8::from_rgba(red, green, blue, 255).expect("an opaque colour is one")
}

/// A mixture of two colours; at a `share` of 0 it is the first.
pub(crate) fn blend(a: Rgb, b: Rgb, share: f64) -> Rgb {
    [0, 1, 2].map(|i| {
        (f64::from(a[i]) + (f64::from(b[i]) - f64::from(a[i])) * share.clamp(0.0, 1.0)).round()
            as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(canvas: &Canvas, x: usize, y: usize) -> Rgb {
        canvas.at(x, y)
    }

    #[test]
    fn shapes_beyond_the_paper_are_cut_off() {
        let mut canvas = Canvas::new(20, 10);
        canvas.fill(-5, -5, 8, 7, INK);
        canvas.fill(30, 2, 8, 7, INK);
        canvas.set(-1, 3, INK);
        canvas.text(-10, 8, TextSize::Body, INK, "beyond the paper");
        canvas.disc(19, 9, 3, [200, 0, 60]);
        assert_eq!([at(&canvas, 2, 1), at(&canvas, 3, 1)], [INK, WHITE]);
        assert_eq!(at(&canvas, 19, 9), [200, 0, 60]);
        let mut other = Canvas::new(0, 0);
        assert_eq!((other.width(), other.height()), (1, 1));
        other.paste(0, 0, &canvas);
        assert_eq!(at(&other, 0, 0), INK);
    }

    #[test]
    fn words_have_smooth_edges_on_white() {
        let mut canvas = Canvas::new(80, 20);
        canvas.fill(0, 0, 80, 20, [0, 0, 255]);
        canvas.text(4, 4, TextSize::Body, [0, 0, 0], "Aa 8");
        let end = 4 + Canvas::text_width(TextSize::Body, "Aa 8") as usize;
        let letters: Vec<Rgb> = (4..14)
            .flat_map(|y| (4..end).map(move |x| (x, y)))
            .map(|(x, y)| at(&canvas, x, y))
            .collect();
        assert!(letters.iter().all(|c| c[0] == c[2]), "black on white, no blue left");
        assert!(
            letters.iter().any(|c| c[0] < 30) && letters.iter().any(|c| (60..200).contains(&c[0]))
        );
    }
}
