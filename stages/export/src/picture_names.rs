//! Names beside places of a picture: within its frame, beside one another, and off the places.

use crate::canvas::{Canvas, Rgb};
use crate::font::{TextSize, shortened};

/// Distance of a name from the place that it names, pixels.
const APART: i64 = 8;
/// How far a name may be shifted up or down, in heights of a name, nearest first; the place stays
/// beside it or just over or under it.
const SHIFTS: [f64; 7] = [0.0, -0.5, 0.5, -1.0, 1.0, -1.5, 1.5];

/// Left, top, right and bottom, pixels.
type PixelBox = [i64; 4];

/// Where names may stand, and what is taken already.
#[derive(Debug)]
pub(crate) struct PictureNames {
    bounds: PixelBox,
    taken: Vec<PixelBox>,
}

impl PictureNames {
    /// Names within these bounds.
    pub(crate) fn new(bounds: PixelBox) -> Self {
        Self { bounds, taken: Vec::new() }
    }

    /// Lets no name cover these pixels where there is room elsewhere.
    pub(crate) fn keep_free(&mut self, pixels: PixelBox) {
        self.taken.push(pixels);
    }

    /// Writes a name beside a place: to its right, else to its left, else a little higher or lower;
    /// a name that is wider than the frame is shortened. A place outside of the frame has no name.
    pub(crate) fn write(
        &mut self,
        canvas: &mut Canvas,
        [x, y]: [i64; 2],
        size: TextSize,
        colour: Rgb,
        name: &str,
    ) {
        let [left, top, right, bottom] = self.bounds;
        if !(left..right).contains(&x) || !(top..bottom).contains(&y) {
            return;
        }
        let name = shortened(size, name, (right - left - 4).max(0) as f32);
        let capitals = size.capitals().ceil() as i64;
        // What `Canvas::text` makes white around a name.
        let [wide, high] = [Canvas::text_width(size, &name) + 2, capitals + capitals / 3 + 2];
        let at = |shift: f64, is_left: bool| {
            let u = if is_left { x - APART - wide } else { x + APART };
            // Letters stand in the middle of the place's height.
            let v = y - capitals / 2 - 1 + (shift * (high + 1) as f64).round() as i64;
            let u = u.clamp(left + 1, (right - wide - 1).max(left + 1));
            let v = v.clamp(top + 1, (bottom - high - 1).max(top + 1));
            [u, v, u + wide, v + high]
        };
        let places = SHIFTS.into_iter().flat_map(|shift| [at(shift, false), at(shift, true)]);
        let is_free = |own: &PixelBox| !self.taken.iter().any(|other| meet(own, other));
        let own = places.clone().find(is_free);
        let own = own.unwrap_or_else(|| at(0.0, x + APART + wide >= right));
        canvas.text(own[0] + 1, own[1] + 1, size, colour, &name);
        self.taken.push(own);
    }
}

fn meet(a: &PixelBox, b: &PixelBox) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FRAME: PixelBox = [40, 40, 340, 240];
    const BLUE: Rgb = [0, 0, 200];
    const GROUND: Rgb = [200, 210, 190];

    /// Writes names, and hands back where they stand.
    fn written(names: &[(i64, i64, String)]) -> (Canvas, Vec<PixelBox>) {
        let mut canvas = Canvas::new(380, 280);
        canvas.fill(0, 0, 380, 280, GROUND);
        let mut placed = PictureNames::new(FRAME);
        for (x, y, _) in names {
            placed.keep_free([x - 5, y - 5, x + 6, y + 6]);
        }
        for (x, y, name) in names {
            placed.write(&mut canvas, [*x, *y], TextSize::Body, BLUE, name);
        }
        (canvas, placed.taken.split_off(names.len()))
    }

    #[test]
    fn a_name_at_an_edge_stands_on_the_other_side_of_its_place() {
        let names = [(330, 100), (50, 100), (330, 42), (330, 238)];
        let names = names.map(|(x, y)| (x, y, "scan_4".to_owned()));
        let (_, boxes) = written(&names);
        assert!(boxes[0][2] <= 330 - APART && boxes[1][0] >= 50 + APART, "{boxes:?}");
        for own in boxes {
            assert!(own[0] > FRAME[0] && own[2] < FRAME[2], "{own:?}");
            assert!(own[1] > FRAME[1] && own[3] < FRAME[3], "{own:?}");
        }
    }

    #[test]
    fn names_of_places_that_are_close_stand_beside_one_another() {
        let names: Vec<_> = (0..6).map(|k| (150 + 3 * k, 120 + 2 * k, format!("R{k}"))).collect();
        let (_, boxes) = written(&names);
        for (k, own) in boxes.iter().enumerate() {
            assert!(boxes[..k].iter().all(|other| !meet(own, other)), "{boxes:?}");
        }
    }

    proptest! {
        #[test]
        fn no_name_leaves_the_frame(
            x in 0_i64..380, y in 0_i64..280, letters in 0_usize..120, others in 0_usize..40,
        ) {
            let mut names = vec![(x, y, "W".repeat(letters))];
            names.extend((0..others).map(|k| (x, y, format!("other {k}"))));
            let (canvas, _) = written(&names);
            let (across, down) = (FRAME[0]..FRAME[2], FRAME[1]..FRAME[3]);
            for (u, v) in (0..380).flat_map(|u| (0..280).map(move |v| (u, v))) {
                let is_in = across.contains(&u) && down.contains(&v);
                prop_assert!(is_in || canvas.at(u as usize, v as usize) == GROUND, "{u} {v}");
            }
        }
    }
}
