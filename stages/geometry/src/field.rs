//! Nearest sample by look-up: samples of a surface in; out comes, for any place near it, the index of the nearest
//! sample, in constant time. Keeps the index, not the distance, so that the true facet serves point-to-plane.

use crate::Aabb;

/// A voxel grid about a surface: each voxel within reach holds the index of the sample nearest to its middle.
#[derive(Debug, Clone, Default)]
pub struct NearestField {
    origin: [f32; 3],
    inverse_edge: f32,
    size: [usize; 3],
    /// Farthest place from a sample that knows it, metres.
    reach: f32,
    /// Index of the nearest sample + 1; 0 beyond reach. x fastest.
    cells: Vec<u32>,
}

/// What a voxel knows while samples spread: squared distance of its middle from its sample, the sample's index + 1, and
/// whether it is still to tell its six neighbours. The border of the grid lies beyond reach and never is.
#[derive(Clone, Copy)]
struct Nearest {
    d2: f32,
    sample: u32,
    waits: bool,
}

impl Nearest {
    const NONE: Self = Self { d2: f32::INFINITY, sample: 0, waits: false };
}

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
        let mut field = Self {
            origin: bounds.min.map(|v| v as f32),
            inverse_edge: 1.0 / edge,
            size,
            reach: reach + edge,
            cells: vec![0; size[0] * size[1] * size[2]],
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

    /// Spreads each sample from its own voxel outwards, ring by ring, while it is nearer than what is there.
    fn fill(&mut self, points: &[[f32; 3]], edge: f32, reach: f32) {
        let mut nearest = vec![Nearest::NONE; self.cells.len()];
        let mut ring: Vec<u32> = Vec::new();
        for (i, p) in points.iter().enumerate() {
            let Some(index) = self.index(*p) else { continue };
            let (at, d2) = (self.at(index), distance2(*p, self.middle(index, edge)));
            let own = &mut nearest[at];
            if own.sample == 0 {
                ring.push(at as u32);
            }
            if d2 < own.d2 {
                *own = Nearest { d2, sample: i as u32 + 1, waits: true };
            }
        }
        let (reach2, mut next) = (reach * reach, Vec::new());
        let strides = [1, self.size[0], self.size[0] * self.size[1]];
        while !ring.is_empty() {
            for at in ring.drain(..).map(|at| at as usize) {
                nearest[at].waits = false;
                let sample = nearest[at].sample;
                let (from, middle) =
                    (points[sample as usize - 1], self.middle(self.place(at), edge));
                // Not what is kept of it: rounding would add up on the way.
                let own_d2 = distance2(from, middle);
                for axis in 0..3 {
                    // |v ± e|² = |v|² ± 2·v·e + e²
                    let across = 2.0 * edge * (middle[axis] - from[axis]);
                    let both = [(at - strides[axis], -across), (at + strides[axis], across)];
                    for (at, more) in both {
                        let (own, d2) = (&mut nearest[at], own_d2 + more + edge * edge);
                        if d2 <= reach2 && d2 < own.d2 && own.sample != sample {
                            if !own.waits {
                                next.push(at as u32);
                            }
                            *own = Nearest { d2, sample, waits: true };
                        }
                    }
                }
            }
            std::mem::swap(&mut ring, &mut next);
        }
        for (cell, own) in self.cells.iter_mut().zip(&nearest) {
            *cell = own.sample;
        }
    }

    /// The voxel at a place of `cells`.
    #[inline]
    fn place(&self, at: usize) -> [u32; 3] {
        let (row, x) = (at / self.size[0], at % self.size[0]);
        [x, row % self.size[1], row / self.size[1]].map(|v| v as u32)
    }

    #[inline]
    fn at(&self, [x, y, z]: [u32; 3]) -> usize {
        (z as usize * self.size[1] + y as usize) * self.size[0] + x as usize
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

    /// No place farther than this from all samples knows one, metres.
    #[must_use]
    pub fn reach(&self) -> f64 {
        f64::from(self.reach)
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
