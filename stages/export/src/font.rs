//! Glyph outlines and widths of text in the typeface of the program's pictures.
//!
//! The typeface is DejaVu Sans 2.37, which is part of the program, so that pictures are the same on
//! every machine (`stages/export/fonts`, with its licence). It has Latin, Greek, Cyrillic and
//! Arabic letters; characters that it lacks and invisible characters are drawn as question marks.

use ab_glyph::{Font, FontRef, GlyphId, OutlinedGlyph, PxScale, PxScaleFont, ScaleFont, point};
use contract::quote;
use std::sync::LazyLock;

static SANS: LazyLock<FontRef<'static>> = LazyLock::new(|| {
    FontRef::try_from_slice(include_bytes!("../fonts/DejaVuSans.ttf"))
        .expect("the file is part of the program, and a font")
});

/// The typeface at one size.
type Scaled = PxScaleFont<&'static FontRef<'static>>;

/// The sizes of text in pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TextSize {
    /// Names, numbers and legends.
    Body,
    /// The title of a picture, and names of robots in a plan.
    Title,
}

impl TextSize {
    /// Size of the typeface (its em), pixels.
    fn em(self) -> f32 {
        match self {
            Self::Body => 12.0,
            Self::Title => 18.0,
        }
    }

    /// Height of a capital letter, pixels.
    pub(crate) fn capitals(self) -> f32 {
        CAPITALS * self.em()
    }

    fn scaled(self) -> Scaled {
        let sans = &*SANS;
        let scale = sans.units_per_em().map_or(1.0, |em| sans.height_unscaled() / em);
        sans.as_scaled(PxScale::from(scale * self.em()))
    }
}

/// Height of a capital letter of the typeface, as a share of its em.
const CAPITALS: f32 = 0.729;

/// Width of text, pixels.
#[must_use]
pub(crate) fn width(size: TextSize, words: &str) -> f32 {
    let font = size.scaled();
    glyphs(words).fold((0.0, None), |(x, before), id| (x + step(&font, before, id), Some(id))).0
}

/// The outlines of text that begins at `x` with its baseline at `y`, pixels to the right and down.
pub(crate) fn outlines(
    size: TextSize,
    words: &str,
    x: f32,
    y: f32,
) -> impl Iterator<Item = OutlinedGlyph> {
    let font = size.scaled();
    let (mut end, mut before) = (x, None);
    glyphs(words).filter_map(move |id| {
        let kern = before.map_or(0.0, |before| font.kern(before, id));
        let at = point(end + kern, y);
        end += step(&font, before.replace(id), id);
        font.outline_glyph(id.with_scale_and_position(font.scale(), at))
    })
}

/// The text shortened to at most `most` pixels, with an ellipsis in place of what is left out.
#[must_use]
pub(crate) fn shortened(size: TextSize, words: &str, most: f32) -> String {
    if width(size, words) <= most {
        return words.to_owned();
    }
    let mut short = String::new();
    for letter in words.chars() {
        short.push(letter);
        if width(size, &format!("{short}…")) > most {
            short.pop();
            break;
        }
    }
    short + "…"
}

/// Distance from the origin of one glyph to that of the next, pixels.
fn step(font: &Scaled, before: Option<GlyphId>, id: GlyphId) -> f32 {
    before.map_or(0.0, |before| font.kern(before, id)) + font.h_advance(id)
}

fn glyphs(words: &str) -> impl Iterator<Item = GlyphId> {
    words.chars().map(|letter| {
        let id = SANS.glyph_id(letter);
        if id.0 == 0 || quote::is_odd(letter) { SANS.glyph_id('?') } else { id }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_as_wide_as_their_letters_and_what_the_font_lacks_is_a_question_mark() {
        for size in [TextSize::Body, TextSize::Title] {
            assert_eq!(width(size, ""), 0.0);
            assert!(width(size, "WWW") > 2.0 * width(size, "iii"));
            assert_eq!(width(size, "机\u{1b}\u{202e}"), width(size, "???"));
            assert_ne!(width(size, "Größe 57° ± 3 µm"), width(size, "Gr??e 57? ? 3 ?m"));
            let top = outlines(size, "H", 0.0, 0.0).map(|g| g.px_bounds().min.y).sum::<f32>();
            assert!((top + size.capitals()).abs() < 1.0, "{top} for {}", size.capitals());
        }
    }

    #[test]
    fn names_are_shortened_to_the_room_that_there_is() {
        let name = "shoulder_pan_joint_of_the_second_robot";
        assert_eq!(shortened(TextSize::Body, name, 1000.0), name);
        let short = shortened(TextSize::Body, name, 100.0);
        assert!(short.starts_with("shoulder") && short.ends_with('…'), "{short}");
        assert!(width(TextSize::Body, &short) <= 100.0);
        assert_eq!(shortened(TextSize::Body, name, 0.0), "…");
    }
}
