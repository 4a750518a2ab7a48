//! Finds the points that are near a plane along the surface they lie on, by Dijkstra's algorithm on
//! the graph of nearest neighbours (the source, §3.1; METHOD.md §10).

use geometry::Vector;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use crate::settings::Settings;

/// Largest distance from the plane along the surface of a body that stands on it, metres.
pub(crate) fn farthest(
    points: &[Vector],
    settings: &Settings,
    height: impl Fn(&Vector) -> f64,
) -> f64 {
    distances(points, settings, height).into_iter().filter(|d| d.is_finite()).fold(0.0, f64::max)
}

/// Connected sets of the points whose distance from the plane along the surface is at most `limit`,
/// largest first.
pub(crate) fn near_plane(
    points: &[Vector],
    settings: &Settings,
    height: impl Fn(&Vector) -> f64,
    limit: f64,
) -> Vec<Vec<usize>> {
    let near = distances(points, settings, height);
    let edges = neighbours(points, settings);
    let mut seen = vec![false; points.len()];
    let mut out: Vec<Vec<usize>> = Vec::new();
    for seed in 0..points.len() {
        if seen[seed] || near[seed] > limit {
            continue;
        }
        seen[seed] = true;
        let (mut set, mut open) = (Vec::new(), vec![seed]);
        while let Some(at) = open.pop() {
            set.push(at);
            for &(next, _) in &edges[at] {
                if !seen[next] && near[next] <= limit {
                    seen[next] = true;
                    open.push(next);
                }
            }
        }
        set.sort_unstable();
        out.push(set);
    }
    out.retain(|s| s.len() >= MIN_POINTS);
    out.sort_by_key(|s| Reverse(s.len()));
    out
}

/// Fewer points are no base.
const MIN_POINTS: usize = 100;

/// Distance of each point from the plane along the graph, metres; infinite where no way leads
/// there.
fn distances(points: &[Vector], settings: &Settings, height: impl Fn(&Vector) -> f64) -> Vec<f64> {
    let edges = neighbours(points, settings);
    let mut distance = vec![f64::INFINITY; points.len()];
    let mut open = BinaryHeap::new();
    for (i, p) in points.iter().enumerate() {
        if height(p) <= settings.foot_high {
            distance[i] = height(p).max(0.0);
            open.push(Reverse((Length(distance[i]), i)));
        }
    }
    while let Some(Reverse((Length(so_far), at))) = open.pop() {
        if so_far > distance[at] {
            continue;
        }
        for &(next, length) in &edges[at] {
            if so_far + length < distance[next] {
                distance[next] = so_far + length;
                open.push(Reverse((Length(distance[next]), next)));
            }
        }
    }
    distance
}

/// The nearest neighbours of each point within the longest edge, with their distances; both ways.
fn neighbours(points: &[Vector], settings: &Settings) -> Vec<Vec<(usize, f64)>> {
    let cell = |p: &Vector| [p.x, p.y, p.z].map(|v| (v / settings.max_edge).floor() as i64);
    let mut cells: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    for (i, p) in points.iter().enumerate() {
        cells.entry(cell(p)).or_default().push(i);
    }
    let mut out = vec![Vec::new(); points.len()];
    for (i, p) in points.iter().enumerate() {
        let c = cell(p);
        let mut near: Vec<(f64, usize)> = (0..27)
            .filter_map(|k| cells.get(&[c[0] + k % 3 - 1, c[1] + k / 3 % 3 - 1, c[2] + k / 9 - 1]))
            .flatten()
            .filter(|&&j| j != i)
            .map(|&j| ((points[j] - p).norm(), j))
            .filter(|(d, _)| *d <= settings.max_edge)
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (d, j) in near.into_iter().take(settings.n_neighbours) {
            out[i].push((j, d));
            out[j].push((i, d));
        }
    }
    out
}

/// A length that can be ordered.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Length(f64);

impl Eq for Length {}

impl PartialOrd for Length {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Length {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_leads_over_the_surface_of_a_box() {
        // A box of 0.4 × 0.4 × 0.3 m, sampled every 12 mm: from the ground up a side and to the
        // middle of the top.
        let n = |v: f64| (v / 0.012).round() as i32;
        let mut points = Vec::new();
        for i in 0..=n(0.4) {
            for k in 0..=n(0.3) {
                let (a, z) = (f64::from(i) * 0.012, f64::from(k) * 0.012);
                points.extend([Vector::new(a, 0.0, z), Vector::new(a, 0.4, z)]);
                points.extend([Vector::new(0.0, a, z), Vector::new(0.4, a, z)]);
            }
            for j in 0..=n(0.4) {
                points.push(Vector::new(f64::from(i) * 0.012, f64::from(j) * 0.012, 0.3));
            }
        }
        let far = farthest(&points, &Settings::default(), |p| p.z);
        // 0.5 m, less what edges of the graph cut off the corners.
        assert!((0.47..0.53).contains(&far), "{far}");
    }
}
