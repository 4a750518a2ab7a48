//! Nearest sample by look-up: samples of a surface in; out comes, for any place near it, the index of the nearest
//! sample, in constant time. Keeps the index, not the distance, so that the true facet serves point-to-plane.

use crate::Aabb;

/// A voxel grid about a surface: each voxel within reach holds the index of the sample nearest to its middle.
#[derive(Debug, Clone, Default)]
pub struct NearestField {
    origin: [f32; 3],
    inverse_edge: f32,
    size: [usize; 3],
    /// Bricks on each axis, see [`BRICK`].
    bricks: [usize; 3],
    /// Index of the nearest sample + 1 (below 2³¹); 0 beyond reach. Brick after brick, x fastest.
    cells: Vec<u32>,
}

/// Voxels across a brick, as a power of two: neighbours in space are neighbours in memory, on one page of it mostly.
const BRICK: u32 = 3;
const IN_BRICK: u32 = (1 << BRICK) - 1;

/// In a cell while samples spread: it is still to tell its six neighbours.
const WAITS: u32 = 1 << 31;

impl NearestField {
    /// A field of voxels with this `edge` that reaches `reach` metres from the samples.
    #[must_use]
    pub fn new(points: &[[f32; 3]], edge: f32, reach: f32) -> Self {
        let bounds = Aabb::of(points.iter().map(|p| p.map(f64::from)));
        if bounds.is_empty() {
            return Self::default();
        }
        // One voxel more than the reach, so that what is within reach has all its neighbours.
        let margin = f64::from(reach + 2.0 * edge);
        let bounds = bounds.grown(margin);
        let size = bounds.size().map(|s| (s / f64::from(edge)).ceil() as usize + 1);
        let bricks = size.map(|n| n.div_ceil(1 << BRICK));
        let mut field = Self {
            origin: bounds.min.map(|v| v as f32),
            inverse_edge: 1.0 / edge,
            size,
            bricks,
            cells: vec![0; bricks.iter().product::<usize>() << (3 * BRICK)],
        };
        field.fill(points, edge, reach);
        field
    }

    /// The same for samples with other numbers.
    #[must_use]
    pub fn renumbered(mut self, numbers: &[u32]) -> Self {
        for cell in self.cells.iter_mut().filter(|cell| **cell > 0) {
            *cell = numbers[*cell as usize - 1] + 1;
        }
        self
    }

    /// Spreads each sample from its own voxel outwards, ring by ring, while it is nearer than what is there. The border of the
    /// grid lies beyond reach and is never told.
    fn fill(&mut self, points: &[[f32; 3]], edge: f32, reach: f32) {
        // How much nearer to its sample than `limit` each voxel's middle is, in squares: 0, as fresh memory has it, where none
        // is; so memory of bricks beyond reach is never touched.
        let mut nearer = vec![0.0; self.cells.len()];
        let limit = reach * reach + edge * edge;
        // Places, not numbers: these would have to be divided for each voxel.
        let mut ring: Vec<[u32; 3]> = Vec::new();
        for (i, p) in points.iter().enumerate() {
            let Some(index) = self.index(*p) else { continue };
            let at = self.at(index);
            let by = limit - distance2(*p, self.middle(index, edge));
            if self.cells[at] == 0 {
                ring.push(index);
            }
            if by > nearer[at] {
                (nearer[at], self.cells[at]) = (by, (i as u32 + 1) | WAITS);
            }
        }
        let mut next = Vec::new();
        let steps = self.steps();
        while !ring.is_empty() {
            for index in ring.drain(..) {
                let at = self.at(index);
                let sample = self.cells[at] & !WAITS;
                self.cells[at] = sample;
                let (from, middle) = (points[sample as usize - 1], self.middle(index, edge));
                // Not what is kept of it: rounding would add up on the way.
                let own = limit - distance2(from, middle);
                for axis in 0..3 {
                    // |v ± e|² = |v|² ± 2·v·e + e²
                    let across = 2.0 * edge * (middle[axis] - from[axis]);
                    let step =
                        |to: u32| at + steps[axis][to as usize] - steps[axis][index[axis] as usize];
                    for (to, more) in [(index[axis] - 1, -across), (index[axis] + 1, across)] {
                        let (at, by) = (step(to), own - more - edge * edge);
                        let other = self.cells[at];
                        if by >= edge * edge && by > nearer[at] && other & !WAITS != sample {
                            if other & WAITS == 0 {
                                let mut index = index;
                                index[axis] = to;
                                next.push(index);
                            }
                            (nearer[at], self.cells[at]) = (by, sample | WAITS);
                        }
                    }
                }
            }
            std::mem::swap(&mut ring, &mut next);
        }
    }

    /// What each place on each axis adds to [`NearestField::at`].
    fn steps(&self) -> [Vec<usize>; 3] {
        std::array::from_fn(|axis| {
            let place = |v: u32| std::array::from_fn(|i| if i == axis { v } else { 0 });
            (0..self.size[axis] as u32).map(|v| self.at(place(v))).collect()
        })
    }

    #[inline]
    fn at(&self, [x, y, z]: [u32; 3]) -> usize {
        let [bx, by, bz] = [x, y, z].map(|v| (v >> BRICK) as usize);
        let [x, y, z] = [x, y, z].map(|v| (v & IN_BRICK) as usize);
        let brick = (bz * self.bricks[1] + by) * self.bricks[0] + bx;
        ((brick << BRICK | z) << BRICK | y) << BRICK | x
    }

    #[inline]
    fn middle(&self, index: [u32; 3], edge: f32) -> [f32; 3] {
        std::array::from_fn(|i| self.origin[i] + (index[i] as f32 + 0.5) * edge)
    }

    /// The voxel of a place; `None` outside.
    #[inline]
    fn index(&self, p: [f32; 3]) -> Option<[u32; 3]> {
        let mut index = [0; 3];
        for i in 0..3 {
            let v = (p[i] - self.origin[i]) * self.inverse_edge;
            if !(v >= 0.0 && v < self.size[i] as f32) {
                return None;
            }
            index[i] = v as u32;
        }
        Some(index)
    }

    /// Index of the sample nearest to `p` (to within a voxel's half diagonal); `None` beyond reach.
    #[inline]
    #[must_use]
    pub fn nearest(&self, p: [f32; 3]) -> Option<usize> {
        let at = self.at(self.index(p)?);
        (self.cells[at] as usize).checked_sub(1)
    }

    /// Where its grid begins, metres, and how many voxels there are in a metre.
    #[must_use]
    pub fn grid(&self) -> ([f32; 3], f32) {
        (self.origin, self.inverse_edge)
    }

    /// Voxels on each axis.
    #[must_use]
    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// The same as [`NearestField::nearest`] for any place in a voxel of the grid; `None` outside.
    #[inline]
    #[must_use]
    pub fn in_voxel(&self, index: [u32; 3]) -> Option<usize> {
        (*self.cells.get(self.at(index))? as usize).checked_sub(1)
    }

    /// Bytes kept.
    #[must_use]
    pub fn weight_bytes(&self) -> usize {
        self.cells.len() * 4
    }
}

#[inline]
fn distance2(a: [f32; 3], b: [f32; 3]) -> f32 {
    (0..3).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_agrees_with_search_to_a_voxel() {
        // A bent sheet of samples.
        let points: Vec<[f32; 3]> = (0..40)
            .flat_map(|i| (0..40).map(move |j| (i as f32 * 0.01, j as f32 * 0.01)))
            .map(|(x, y)| [x, y, 0.2 * (x * 7.0).sin()])
            .collect();
        let field = NearestField::new(&points, 0.008, 0.05);
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f32 / (1 << 24) as f32
        };
        let mut n_near = 0;
        for _ in 0..5000 {
            let p = [random() * 0.5 - 0.05, random() * 0.5 - 0.05, random() * 0.5 - 0.25];
            let exact =
                points.iter().map(|q| distance2(p, *q)).fold(f32::INFINITY, f32::min).sqrt();
            match field.nearest(p) {
                Some(i) => {
                    n_near += 1;
                    assert!(distance2(p, points[i]).sqrt() <= exact + 0.008 * 1.74);
                }
                None => assert!(exact > 0.05 - 0.008),
            }
        }
        assert!(n_near > 500);
    }
}
