//! Insets and triangulations of plane polygons.

/// Twice the signed area of triangle `abc`: positive counter-clockwise.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The n − 2 triangles of a simple polygon (counter-clockwise), by ear clipping.
pub(super) fn ears(polygon: &[[f64; 2]]) -> Vec<[u32; 3]> {
    let mut left: Vec<u32> = (0..polygon.len() as u32).collect();
    let mut out = Vec::with_capacity(polygon.len().saturating_sub(2));
    let at = |i: u32| polygon[i as usize];
    while left.len() > 3 {
        let n = left.len();
        // The fattest ear is cut, which avoids slivers. A polygon without an ear (one that touches
        // itself) is cut at its first corner.
        let best = (0..n)
            .filter_map(|k| {
                let (a, b, c) = (left[(k + n - 1) % n], left[k], left[(k + 1) % n]);
                let area = turn(at(a), at(b), at(c));
                let is_ear = area > 0.0
                    && left.iter().filter(|&&p| p != a && p != b && p != c).all(|&p| {
                        turn(at(a), at(b), at(p)) < 0.0
                            || turn(at(b), at(c), at(p)) < 0.0
                            || turn(at(c), at(a), at(p)) < 0.0
                    });
                is_ear.then_some((k, area))
            })
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .map_or(0, |best| best.0);
        out.push([left[(best + n - 1) % n], left[best], left[(best + 1) % n]]);
        left.remove(best);
    }
    if let [a, b, c] = left[..] {
        out.push([a, b, c]);
    }
    out
}

/// The polygon (counter-clockwise) moved inwards by `inset`, each corner along its mitre.
pub(super) fn inset(polygon: &[[f64; 2]], inset: f64) -> Vec<[f64; 2]> {
    let n = polygon.len();
    (0..n)
        .map(|i| {
            let (before, here, after) =
                (polygon[(i + n - 1) % n], polygon[i], polygon[(i + 1) % n]);
            let inward = |a: [f64; 2], b: [f64; 2]| {
                let (x, y) = (b[0] - a[0], b[1] - a[1]);
                let length = x.hypot(y).max(1e-12);
                [-y / length, x / length]
            };
            let (u, v) = (inward(before, here), inward(here, after));
            let cos = (u[0] * v[0] + u[1] * v[1]).max(-0.8);
            let scale = inset / (1.0 + cos);
            [here[0] + (u[0] + v[0]) * scale, here[1] + (u[1] + v[1]) * scale]
        })
        .collect()
}
