//! Covers voxels with few boxes.

use crate::plant_scene::FixedBox;
use std::collections::BTreeSet;

/// Boxes that together are exactly the given voxels: each grows along x, then y, then z from the
/// first voxel that is left. `edge` is that of a voxel, metres; voxel `[0, 0, 0]` begins at the
/// origin of the world.
#[must_use]
pub fn voxel_boxes(voxels: &BTreeSet<[i64; 3]>, edge: f64) -> Vec<FixedBox> {
    let mut left = voxels.clone();
    let mut out = Vec::new();
    while let Some(first) = left.first().copied() {
        let mut last = first;
        for axis in [2, 1, 0] {
            loop {
                let mut layer = (first, last);
                layer.0[axis] = last[axis] + 1;
                layer.1[axis] = last[axis] + 1;
                if !cells(layer.0, layer.1).all(|cell| left.contains(&cell)) {
                    break;
                }
                last[axis] += 1;
            }
        }
        for cell in cells(first, last) {
            left.remove(&cell);
        }
        let at = |i: usize, v: i64| (first[i] + last[i] + v) as f64 / 2.0 * edge;
        out.push(FixedBox {
            center: std::array::from_fn(|i| at(i, 1)),
            size: std::array::from_fn(|i| (last[i] - first[i] + 1) as f64 * edge),
        });
    }
    out
}

fn cells(first: [i64; 3], last: [i64; 3]) -> impl Iterator<Item = [i64; 3]> {
    let [x, y, z] = std::array::from_fn(|i| first[i]..=last[i]);
    x.flat_map(move |x| {
        let z = z.clone();
        y.clone().flat_map(move |y| z.clone().map(move |z| [x, y, z]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_the_voxels_and_no_more() {
        let mut voxels: BTreeSet<[i64; 3]> = cells([-2, 0, 0], [3, 1, 0]).collect();
        voxels.extend(cells([0, 0, 1], [0, 0, 5]));
        voxels.insert([10, 10, 10]);
        let boxes = voxel_boxes(&voxels, 0.05);
        let volume: f64 = boxes.iter().map(|b| b.size.iter().product::<f64>()).sum();
        assert!((volume - voxels.len() as f64 * 0.05_f64.powi(3)).abs() < 1e-12);
        for cell in &voxels {
            let middle = cell.map(|v| (v as f64 + 0.5) * 0.05);
            let holds =
                |b: &&FixedBox| (0..3).all(|i| (middle[i] - b.center[i]).abs() < b.size[i] / 2.0);
            assert_eq!(boxes.iter().filter(holds).count(), 1);
        }
        assert!(boxes.len() <= 5, "{}", boxes.len());
    }
}
