//! Nearest sample by look-up: samples of a surface in; out comes, for any place near it, the index of the nearest
//! sample, in constant time. Keeps the index, not the distance, so that the true facet serves point-to-plane.

use crate::Aabb;

/// A voxel grid about a surface: each voxel within reach holds the index of the sample nearest to its middle.
#[derive(Debug, Clone, Default)]
pub struct NearestField {
    origin: [f32; 3],
    inverse_edge: f32,
    size: [usize; 3],
    /// Index of the nearest sample + 1; 0 beyond reach. x fastest.
    cells: Vec<u32>,
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
            cells: vec![0; size[0] * size[1] * size[2]],
        };
        field.fill(points, edge, reach);
        field
    }

    /// Spreads each sample from its own voxel outwards, ring by ring, while it is nearer than what is there.
    fn fill(&mut self, points: &[[f32; 3]], edge: f32, reach: f32) {
        let mut ring: Vec<usize> = Vec::new();
        for (i, p) in points.iter().enumerate() {
            let Some(at) = self.cell(*p) else { continue };
            let old = self.cells[at];
            if old == 0 {
                ring.push(at);
            }
            let middle = self.middle(at, edge);
            if old == 0 || distance2(points[old as usize - 1], middle) > distance2(*p, middle) {
                self.cells[at] = i as u32 + 1;
            }
        }
        let reach2 = reach * reach;
        let mut next = Vec::new();
        while !ring.is_empty() {
            for &at in &ring {
                let sample = self.cells[at];
                let from = points[sample as usize - 1];
                for neighbour in self.around(at) {
                    let middle = self.middle(neighbour, edge);
                    let d2 = distance2(from, middle);
                    if d2 > reach2 {
                        continue;
                    }
                    let old = self.cells[neighbour];
                    if old == sample
                        || (old != 0 && distance2(points[old as usize - 1], middle) <= d2)
                    {
                        continue;
                    }
                    self.cells[neighbour] = sample;
                    next.push(neighbour);
                }
            }
            std::mem::swap(&mut ring, &mut next);
            next.clear();
        }
    }

    /// The six neighbours across faces. The border of the grid lies beyond reach and is never left.
    fn around(&self, at: usize) -> [usize; 6] {
        let (row, slab) = (self.size[0], self.size[0] * self.size[1]);
        [at - 1, at + 1, at - row, at + row, at - slab, at + slab]
    }

    fn middle(&self, at: usize, edge: f32) -> [f32; 3] {
        let [w, h, _] = self.size;
        let index = [at % w, at / w % h, at / (w * h)];
        std::array::from_fn(|i| self.origin[i] + (index[i] as f32 + 0.5) * edge)
    }

    #[inline]
    fn cell(&self, p: [f32; 3]) -> Option<usize> {
        let mut index = [0; 3];
        for i in 0..3 {
            let v = (p[i] - self.origin[i]) * self.inverse_edge;
            if !(v >= 0.0 && v < self.size[i] as f32) {
                return None;
            }
            index[i] = v as usize;
        }
        Some((index[2] * self.size[1] + index[1]) * self.size[0] + index[0])
    }

    /// Index of the sample nearest to `p` (to within a voxel's half diagonal); `None` beyond reach.
    #[inline]
    #[must_use]
    pub fn nearest(&self, p: [f32; 3]) -> Option<usize> {
        let at = self.cell(p)?;
        (self.cells[at] as usize).checked_sub(1)
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
