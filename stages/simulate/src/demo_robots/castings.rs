//! The pieces that links of demo robots are made of. x is forward, y left, z up; joints turn about
//! y.

use crate::solid::{Ring, Solid, bolts, cuboid, disc, lathe, loft, prism, rounded, tube};
use geometry::Point;
use std::f64::consts::TAU;

/// Number of sides of a hub.
const HUB_SIDES: usize = 44;

/// Convex outline around circles (centre, radius), counter-clockwise, metres.
pub(super) fn hull(circles: &[([f64; 2], f64)]) -> Vec<[f64; 2]> {
    let mut points: Vec<[f64; 2]> = Vec::new();
    for (centre, radius) in circles {
        for k in 0..HUB_SIDES {
            let (sin, cos) = (TAU * k as f64 / HUB_SIDES as f64).sin_cos();
            points.push([centre[0] + radius * cos, centre[1] + radius * sin]);
        }
    }
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let turn = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let half = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut out: Vec<[f64; 2]> = Vec::new();
        for p in points {
            // Corners that are nearly straight are left out, since they only give slivers.
            while out.len() >= 2 && turn(out[out.len() - 2], out[out.len() - 1], p) <= 1e-7 {
                out.pop();
            }
            out.push(p);
        }
        out.pop();
        out
    };
    let mut out = half(&mut points.iter().copied());
    out.extend(half(&mut points.iter().rev().copied()));
    out
}

/// An outline in the xz plane, extruded from `y[0]` to `y[1]`.
pub(super) fn side_prism(outline: &[[f64; 2]], y: [f64; 2], chamfer: f64) -> Solid {
    prism(outline, -y[1], -y[0], chamfer).turned([90.0, 0.0, 0.0])
}

/// A plate around circles in the xz plane, from `y[0]` to `y[1]`.
pub(super) fn cheek(circles: &[([f64; 2], f64)], y: [f64; 2], chamfer: f64) -> Solid {
    side_prism(&hull(circles), y, chamfer)
}

/// A hub about y at (x, z), from `y[0]` to `y[1]`, with a bolted cover at both ends.
pub(super) fn hub(at: [f64; 2], radius: f64, y: [f64; 2]) -> Solid {
    let c = 0.06 * radius;
    let body = [
        [0.72 * radius, y[0] - c],
        [0.78 * radius, y[0]],
        [radius - c, y[0]],
        [radius, y[0] + c],
        [radius, y[1] - c],
        [radius - c, y[1]],
        [0.78 * radius, y[1]],
        [0.72 * radius, y[1] + c],
    ];
    let size = (0.14 * radius).min(0.022);
    let ring = bolts(8, 0.88 * radius, y[1], size);
    let other = bolts(8, 0.88 * radius, -y[0], size).turned([180.0, 0.0, 0.0]);
    // The axis of the lathe is laid along +y: (x, y, z) becomes (x, z, −y), so that a hub is drawn
    // upright with z = y.
    Solid::of([lathe(&body, HUB_SIDES), ring, other]).along_y().at([at[0], 0.0, at[1]])
}

/// A section of a boom: x, centre (y, z), size (y, z), radius of its corners; metres.
pub(super) type BoomSection = (f64, [f64; 2], [f64; 2], f64);

/// A casting along x through sections.
pub(super) fn boom(sections: &[BoomSection]) -> Solid {
    let rings: Vec<Ring> = sections
        .iter()
        .map(|&(x, c, s, r)| rounded([-c[1], c[0], x], [s[1], s[0]], r, 8))
        .collect();
    loft(&rings).along_x()
}

/// A casting along z through sections: z, centre (x, y), size (x, y), radius of its corners.
pub(super) fn trunk(sections: &[BoomSection]) -> Solid {
    let rings: Vec<Ring> =
        sections.iter().map(|&(z, c, s, r)| rounded([c[0], c[1], z], s, r, 8)).collect();
    loft(&rings)
}

/// A motor standing on z = 0: gear neck, finned body, brake cover, and a plug box on its +x side.
pub(super) fn motor(radius: f64, length: f64) -> Solid {
    let mut profile =
        vec![[0.75 * radius, 0.0], [0.75 * radius, 0.1 * length], [radius, 0.12 * length]];
    let fins = 4;
    for k in 0..fins {
        let z = length * (0.2 + 0.45 * k as f64 / f64::from(fins));
        let step = length * 0.45 / f64::from(fins);
        profile.extend([
            [radius, z],
            [0.93 * radius, z + 0.15 * step],
            [0.93 * radius, z + 0.5 * step],
            [radius, z + 0.65 * step],
        ]);
    }
    profile.extend([
        [radius, 0.7 * length],
        [0.88 * radius, 0.72 * length],
        [0.88 * radius, 0.95 * length],
        [0.75 * radius, length],
    ]);
    Solid::of([
        lathe(&profile, 32),
        cuboid([0.7 * radius, 0.8 * radius, 0.3 * length], 0.08 * radius).at([
            1.1 * radius,
            0.0,
            0.82 * length,
        ]),
        disc(0.22 * radius, 0.0, 0.5 * radius, 0.02 * radius, 20).along_x().at([
            1.4 * radius,
            0.0,
            0.82 * length,
        ]),
    ])
}

/// A foot: plate with corner lugs and bolts, from z = 0.
pub(super) fn foot(size: [f64; 2], thick: f64) -> Solid {
    let mut out = trunk(&[
        (0.0, [0.0; 2], size, 0.12 * size[0]),
        (0.8 * thick, [0.0; 2], size, 0.12 * size[0]),
        (thick, [0.0; 2], size.map(|s| s - 0.4 * thick), 0.11 * size[0]),
    ]);
    for (sx, sy) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let (x, y) = (sx * 0.42 * size[0], sy * 0.42 * size[1]);
        out.add(&disc(0.08 * size[0], 0.0, 1.2 * thick, 0.1 * thick, 28).at([x, y, 0.0]));
        out.add(&disc(0.03 * size[0], 1.1 * thick, 1.8 * thick, 0.1 * thick, 6).at([x, y, 0.0]));
    }
    out
}

/// A round bar in the plane y = `y` from (x, z) to (x, z) with an eye at both ends: link rods and
/// coupler bars.
pub(super) fn bar(from: [f64; 2], to: [f64; 2], y: f64, radius: f64) -> Solid {
    let (p, q) = (Point::new(from[0], y, from[1]), Point::new(to[0], y, to[1]));
    let along = (q - p).normalize();
    Solid::of([
        tube(&[p + along * radius, q - along * radius], radius, 28),
        tube(&[p + along * 2.0 * radius, p + along * 5.0 * radius], 1.25 * radius, 28),
        hub(from, 1.9 * radius, [y - radius, y + radius]),
        hub(to, 1.7 * radius, [y - 0.9 * radius, y + 0.9 * radius]),
    ])
}

/// A tool plate on the plane x = 0, facing +x: disc, bolt ring, dowel, and a plug on one side that
/// makes its rotation visible.
pub(super) fn tool_plate(radius: f64, thick: f64) -> Solid {
    let upright = Solid::of([
        disc(0.8 * radius, 0.0, 0.5 * thick, 0.0, 48),
        disc(radius, 0.4 * thick, thick, 0.08 * thick, 48),
        bolts(6, 0.72 * radius, thick, 0.22 * radius),
        disc(0.3 * radius, 0.9 * thick, 1.25 * thick, 0.05 * thick, 32),
    ]);
    Solid::of([
        upright.along_x(),
        cuboid([0.9 * thick, 0.9 * radius, 0.6 * radius], 0.05 * radius).at([
            0.5 * thick,
            0.25 * radius,
            1.1 * radius,
        ]),
        disc(0.16 * radius, 0.0, 0.6 * radius, 0.02 * radius, 20).along_y().at([
            0.5 * thick,
            0.7 * radius,
            1.1 * radius,
        ]),
    ])
}

/// A rib: a thin upright plate through three or more corners (x, z) at `y`, `thick` wide.
pub(super) fn rib(corners: &[[f64; 2]], y: f64, thick: f64) -> Solid {
    side_prism(corners, [y - 0.5 * thick, y + 0.5 * thick], 0.0)
}

/// A cable or pipe along corners.
pub(super) fn pipe(corners: &[[f64; 3]], radius: f64) -> Solid {
    let mut path: Vec<Point> = Vec::new();
    for (i, pair) in corners.windows(2).enumerate() {
        let (a, b) = (Point::from(pair[0]), Point::from(pair[1]));
        // Two points near each corner round it off.
        if i == 0 {
            path.push(a);
        }
        path.push(a + (b - a) * 0.2);
        path.push(a + (b - a) * 0.8);
        if i + 2 == corners.len() {
            path.push(b);
        }
    }
    tube(&path, radius, 16)
}
