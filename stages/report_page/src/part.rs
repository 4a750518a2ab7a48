//! Points of a part of a plant, so that many threads or processes can read the points of one page.

use crate::blocks::{Owner, PagePoints};
use contract::{Error, Result};
use geometry::Aabb;
use serde::{Deserialize, Serialize};

/// Points of a part of a plant, thinned. In which parts the points of a plant come to
/// [`PagePoints::join`], and in which order, makes no difference.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct PagePart {
    origin: [f64; 3],
    n_of_kind: [u64; 5],
    /// Owner, place and entries of each block.
    blocks: Vec<(i32, [i32; 3], Vec<u64>)>,
}

impl PagePoints {
    /// Room for the points of a part, all that a page could show: that depends on the rest of the
    /// plant. `robots` hold the bounds of all robots that are near (world, metres), and may be
    /// larger; `middle` is the same as for the page.
    #[must_use]
    pub fn of_part(robots: &[Aabb], middle: [f64; 3]) -> Self {
        Self::new(robots, middle, usize::MAX / 2)
    }

    /// The points so far as a part.
    #[must_use]
    pub fn into_part(mut self) -> PagePart {
        self.settle();
        let (origin, n_of_kind) = (self.origin, self.n_of_kind);
        let blocks = self.blocks.into_iter();
        let blocks = blocks.map(|((owner, at), block)| (owner.number(), at, block.entries));
        PagePart { origin, n_of_kind, blocks: blocks.collect() }
    }

    /// Adds the points of a part.
    ///
    /// # Errors
    /// A part of another plant.
    pub fn join(&mut self, part: PagePart) -> Result<()> {
        let foreign = || Error::bad_input("the points of a part are of another page");
        if part.origin != self.origin {
            return Err(foreign());
        }
        for (owner, at, entries) in part.blocks {
            let owner = Owner::of_number(owner).ok_or_else(foreign)?;
            self.extend((owner, at), entries);
        }
        for (sum, n) in self.n_of_kind.iter_mut().zip(part.n_of_kind) {
            *sum += n;
        }
        self.settle();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::PagePoint;
    use contract::{Label, PointKind};

    /// Points about a robot and away from it, without order.
    fn plant(n: usize) -> Vec<PagePoint> {
        let point = |i: usize| {
            let t = i as f64 * 0.618_034;
            let world = [1003.0 + 9.0 * t.sin(), 9.0 * (t * 0.37).cos(), (t * 0.11).sin()];
            let kind = [PointKind::Fixed, PointKind::Floor, PointKind::Link][i % 3];
            let robot = if kind == PointKind::Link { (i / 3 % 2) as i16 } else { -1 };
            PagePoint { world, label: Label { kind, robot, link: robot } }
        };
        (0..n).map(point).collect()
    }

    #[test]
    fn parts_in_any_order_make_the_page_that_all_points_make() {
        let robot = Aabb { min: [1001.0, -1.0, -1.0], max: [1004.0, 2.0, 1.0] };
        let (points, middle) = (plant(120_000), [1003.0, 0.0, 0.0]);
        // Room for few and for all of them.
        for most in [3_000, 1_000_000] {
            let empty = PagePoints::new(&[robot], middle, most);
            let mut whole = empty.clone();
            whole.add(&points);
            whole.settle();
            let expected = whole.finish(most);
            for (n, is_reversed, wider) in [(1, false, 0.0), (7, true, 0.4), (100, false, 3.0)] {
                let part = |own: &[PagePoint]| {
                    let mut part = PagePoints::of_part(&[robot.grown(wider)], middle);
                    part.add(own);
                    part.into_part()
                };
                let mut parts: Vec<PagePart> = points.chunks(120_000 / n + 1).map(part).collect();
                if is_reversed {
                    parts.reverse();
                }
                let mut joined = empty.clone();
                parts.into_iter().for_each(|part| joined.join(part).expect("the same plant"));
                assert_eq!(joined.n_of_kind, whole.n_of_kind);
                assert!(joined.finish(most) == expected, "{n} parts, room for {most}");
            }
        }
        let mut other = PagePoints::new(&[], [0.0; 3], 10);
        assert!(other.join(PagePoints::of_part(&[], middle).into_part()).is_err());
    }
}
