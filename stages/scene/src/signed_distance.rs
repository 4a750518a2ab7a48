//! Signed distances of voxels from obstacles: exact between middles of voxels, by one sweep along
//! each axis (lower envelopes of parabolas).

/// Signed distance of the middle of each voxel from the surface of the obstacles, in edges of a
/// voxel: positive outside, negative inside, and zero where a free voxel meets an obstacle. It is
/// the distance of the nearest voxel of the other kind, middle to middle, less half an edge; where
/// there is none of the other kind, it is `f32::MAX` or `-f32::MAX`. Voxels are by `[x][y][z]`.
///
/// # Panics
/// If `is_obstacle` has not one value for each voxel.
#[must_use]
pub fn signed_distances(is_obstacle: &[bool], size: [usize; 3]) -> Vec<f32> {
    assert_eq!(is_obstacle.len(), size.iter().product::<usize>(), "a value for each voxel");
    let outside = squared(is_obstacle, size);
    let is_free: Vec<bool> = is_obstacle.iter().map(|is| !is).collect();
    let inside = squared(&is_free, size);
    let one = |(to_obstacle, to_free): (&f64, &f64)| {
        let (far, sign) = if *to_obstacle > 0.0 { (to_obstacle, 1.0) } else { (to_free, -1.0) };
        if far.is_finite() { (sign * (far.sqrt() - 0.5)) as f32 } else { sign as f32 * f32::MAX }
    };
    outside.iter().zip(&inside).map(one).collect()
}

/// Squared distance of each voxel from the nearest one that is meant, in edges; infinite if there
/// is none.
fn squared(is_meant: &[bool], size: [usize; 3]) -> Vec<f64> {
    let mut out: Vec<f64> =
        is_meant.iter().map(|is| if *is { 0.0 } else { f64::INFINITY }).collect();
    let [nx, ny, nz] = size;
    let strides = [ny * nz, nz, 1];
    let (mut line, mut hull) = (Vec::new(), Vec::new());
    for axis in 0..3 {
        let (n, step) = (size[axis], strides[axis]);
        for start in (0..nx * ny * nz).filter(|at| at / step % n == 0) {
            line.clear();
            line.extend((0..n).map(|k| out[start + k * step]));
            sweep(&line, &mut hull);
            let mut part = 0;
            for k in 0..n {
                while part + 1 < hull.len() && hull[part + 1].1 <= k as f64 {
                    part += 1;
                }
                if let Some((foot, _)) = hull.get(part) {
                    let apart = k as f64 - *foot as f64;
                    out[start + k * step] = apart * apart + line[*foot];
                }
            }
        }
    }
    out
}

/// The lower envelope of the parabolas over a line: places of their feet, and from where on each
/// is the lowest.
fn sweep(line: &[f64], hull: &mut Vec<(usize, f64)>) {
    hull.clear();
    for (foot, height) in line.iter().enumerate().filter(|(_, height)| height.is_finite()) {
        let mut from = f64::NEG_INFINITY;
        while let Some((last, begins)) = hull.last().copied() {
            let (a, b) = (last as f64, foot as f64);
            from = ((height + b * b) - (line[last] + a * a)) / (2.0 * (b - a));
            if from > begins {
                break;
            }
            hull.pop();
            from = f64::NEG_INFINITY;
        }
        hull.push((foot, from));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_all_pairs() {
        let size = [7, 9, 5];
        let n: usize = size.iter().product();
        let mut state = 7_u64;
        let is_obstacle: Vec<bool> = (0..n)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                state >> 33 & 15 == 0
            })
            .collect();
        let place = |at: usize| [at / 45, at / 5 % 9, at % 5].map(|v| v as f64);
        let found = signed_distances(&is_obstacle, size);
        for at in 0..n {
            let others = (0..n).filter(|other| is_obstacle[*other] != is_obstacle[at]);
            let apart = |other: usize| {
                let (a, b) = (place(at), place(other));
                (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
            };
            let nearest = others.map(apart).fold(f64::INFINITY, f64::min) - 0.5;
            let sign = if is_obstacle[at] { -1.0 } else { 1.0 };
            assert!((f64::from(found[at]) - sign * nearest).abs() < 1e-6, "voxel {at}");
        }
        assert_eq!(signed_distances(&[false; 8], [2, 2, 2]), [f32::MAX; 8]);
        assert_eq!(signed_distances(&[true; 8], [2, 2, 2]), [-f32::MAX; 8]);
    }
}
