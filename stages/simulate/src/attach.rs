//! Bodies of what robots carry: hoses, tools and parts.

use crate::scene::{Hose, Tool, ToolShape};
use crate::solid::{Solid, bolts, cuboid, disc, lathe, tube};
use geometry::{Point, Vector};

/// Number of straight pieces of one hanging arc.
const ARC_PIECES: usize = 24;
/// Number of sides of a hose's cross-section.
const HOSE_SIDES: usize = 14;

/// A hose through points of the world (metres): parabolas between them that hang down by `sag` of
/// each distance. Returns its runs from anchor to anchor: whether the run moves, and its body. A
/// run moves with a link that holds one of its ends; `moves` tells that of each anchor.
pub(crate) fn hose(hose: &Hose, held: &[Point], moves: &[bool]) -> Vec<(bool, Solid)> {
    let mut path = vec![held[0]];
    for pair in held.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let depth = hose.sag * (b - a).norm();
        for k in 1..=ARC_PIECES {
            let t = k as f64 / ARC_PIECES as f64;
            path.push(a + (b - a) * t - Vector::z() * (4.0 * depth * t * (1.0 - t)));
        }
    }
    // Smoothing makes the hose bend where two arcs meet, instead of folding.
    for _ in 0..6 {
        for i in 1..path.len() - 1 {
            path[i] = Point::from(
                (path[i - 1].coords + path[i].coords * 2.0 + path[i + 1].coords) * 0.25,
            );
        }
    }
    let run_moves: Vec<bool> = moves.windows(2).map(|pair| pair[0] || pair[1]).collect();
    let mut out: Vec<(bool, Solid)> = Vec::new();
    let mut first = 0;
    for run in run_moves.chunk_by(|a, b| a == b) {
        let pieces = &path[first * ARC_PIECES..=(first + run.len()) * ARC_PIECES];
        out.push((run[0], tube(pieces, hose.radius, HOSE_SIDES)));
        first += run.len();
    }
    let last = out.len().saturating_sub(1);
    for (run, end) in
        [(0, [path[0], path[1]]), (last, [path[path.len() - 1], path[path.len() - 2]])]
    {
        let along = (end[1] - end[0]).try_normalize(1e-9).unwrap_or_else(Vector::z);
        let sleeve = [end[0] - along * 0.01, end[0] + along * 0.04];
        if let Some((_, body)) = out.get_mut(run) {
            body.add(&tube(&sleeve, 1.4 * hose.radius, HOSE_SIDES));
        }
    }
    out
}

/// A tool standing on the plane z = 0 of its own frame.
pub(crate) fn tool(tool: &Tool) -> Solid {
    let l = tool.length;
    match tool.shape {
        ToolShape::Gripper => Solid::of([
            lathe(&[[0.05, 0.0], [0.05, 0.02], [0.04, 0.03], [0.04, 0.25 * l]], 32),
            cuboid([0.6 * l, 0.09, 0.3 * l], 0.008).at([0.0, 0.0, 0.4 * l]),
            cuboid([0.03, 0.05, 0.5 * l], 0.004).at([-0.2 * l, 0.0, 0.75 * l]),
            cuboid([0.03, 0.05, 0.5 * l], 0.004).at([0.22 * l, 0.01, 0.75 * l]),
            disc(0.02, 0.0, 0.12, 0.003, 20).along_y().at([0.15 * l, 0.0, 0.42 * l]),
        ]),
        ToolShape::Cups => {
            let mut out = Solid::of([
                lathe(&[[0.06, 0.0], [0.06, 0.02], [0.03, 0.04], [0.03, 0.6 * l]], 32),
                cuboid([2.0 * l, 0.05, 0.05], 0.004).at([0.0, 0.0, 0.6 * l]),
                cuboid([0.05, 1.4 * l, 0.05], 0.004).at([-0.5 * l, 0.0, 0.6 * l]),
                cuboid([0.05, 1.4 * l, 0.05], 0.004).at([0.7 * l, 0.0, 0.6 * l]),
                bolts(6, 0.05, 0.02, 0.01),
            ]);
            for (x, y) in [(-0.5, -0.6), (-0.5, 0.6), (0.7, -0.6), (0.7, 0.6), (0.1, 0.0)] {
                let cup =
                    lathe(&[[0.008, 0.6 * l], [0.008, 0.85 * l], [0.02, 0.9 * l], [0.03, l]], 20);
                out.add(&cup.at([x * l, y * l, 0.0]));
            }
            out
        }
        ToolShape::Torch => {
            let neck = [
                [0.0, 0.0, 0.3],
                [0.0, 0.0, 0.6],
                [0.05, 0.0, 0.75],
                [0.2, 0.0, 0.95],
                [0.28, 0.0, 1.05],
            ];
            let path = neck.map(|p| Point::new(p[0] * l, p[1] * l, p[2] * l));
            Solid::of([
                lathe(&[[0.045, 0.0], [0.045, 0.03], [0.03, 0.04], [0.03, 0.35 * l]], 32),
                cuboid([0.07, 0.05, 0.12], 0.006).at([-0.03, 0.0, 0.15 * l]),
                tube(&path, 0.012, 16),
                tube(&path[3..], 0.018, 16),
            ])
        }
    }
}
