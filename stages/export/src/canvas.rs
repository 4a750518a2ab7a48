//! A picture in memory, drawn with pixels, discs and text, and written as PNG.

use crate::atomic;
use contract::{Error, Kind, Result};
use font8x8::UnicodeFonts;
use std::path::Path;

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

/// Colour of a link in a view of its robot.
#[must_use]
pub fn link_color(link: usize) -> Rgb {
    COLORS[link % COLORS.len()]
}

/// A picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<Rgb>,
}

impl Canvas {
    /// A white picture, size in pixels.
    #[must_use]
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, pixels: vec![WHITE; width * height] }
    }

    /// Width, pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height, pixels.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Colours a pixel; pixels outside the picture are ignored.
    pub fn set(&mut self, x: i64, y: i64, color: Rgb) {
        if x >= 0 && y >= 0 && (x as usize) < self.width && (y as usize) < self.height {
            self.pixels[y as usize * self.width + x as usize] = color;
        }
    }

    /// Fills a rectangle.
    pub fn fill(&mut self, x: i64, y: i64, width: i64, height: i64, color: Rgb) {
        for v in y.max(0)..(y + height).min(self.height as i64) {
            for u in x.max(0)..(x + width).min(self.width as i64) {
                self.set(u, v, color);
            }
        }
    }

    /// Fills a disc.
    pub fn disc(&mut self, x: i64, y: i64, radius: i64, color: Rgb) {
        for v in -radius..=radius {
            for u in -radius..=radius {
                if u * u + v * v <= radius * radius {
                    self.set(x + u, y + v, color);
                }
            }
        }
    }

    /// Writes text, `size` times 8 pixels high, on a white background. Characters that the font
    /// lacks become question marks.
    pub fn text(&mut self, x: i64, y: i64, size: i64, color: Rgb, words: &str) {
        let n = words.chars().count() as i64;
        self.fill(x - size, y - size, n * 8 * size + 2 * size, 10 * size, WHITE);
        for (i, letter) in words.chars().enumerate() {
            let glyph = [&font8x8::BASIC_FONTS.get(letter), &font8x8::LATIN_FONTS.get(letter)]
                .into_iter()
                .find_map(|g| *g)
                .or_else(|| font8x8::BASIC_FONTS.get('?'))
                .unwrap_or_default();
            for (v, row) in glyph.iter().enumerate() {
                for u in (0..8).filter(|u| row >> u & 1 == 1) {
                    self.fill(
                        x + (i as i64 * 8 + u) * size,
                        y + v as i64 * size,
                        size,
                        size,
                        color,
                    );
                }
            }
        }
    }

    /// Copies another picture onto this one.
    pub fn paste(&mut self, x: i64, y: i64, other: &Self) {
        for v in 0..other.height {
            for u in 0..other.width {
                self.set(x + u as i64, y + v as i64, other.pixels[v * other.width + u]);
            }
        }
    }

    /// Writes a PNG file.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let failed = |e: png::EncodingError| {
            Error::new(Kind::Bug, "picture does not encode").because(e).at(path.display())
        };
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        // A rescan draws a dozen pictures while tiles need the same threads.
        encoder.set_compression(png::Compression::Fast);
        let mut writer = encoder.write_header().map_err(failed)?;
        writer.write_image_data(self.pixels.as_flattened()).map_err(failed)?;
        writer.finish().map_err(failed)?;
        atomic::write(path, &bytes)
    }
}

/// A mixture of two colours; at a `share` of 0 it is the first.
pub(crate) fn blend(a: Rgb, b: Rgb, share: f64) -> Rgb {
    [0, 1, 2].map(|i| {
        (f64::from(a[i]) + (f64::from(b[i]) - f64::from(a[i])) * share.clamp(0.0, 1.0)).round()
            as u8
    })
}
